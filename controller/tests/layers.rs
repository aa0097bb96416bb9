//! The modules of the core form layers: no circular imports.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

/// For each module of the core, the modules that it imports outside its tests.
fn imports() -> BTreeMap<String, BTreeSet<String>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let files = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    files
        .filter(|path| path.extension().is_some_and(|extension| extension == "rs"))
        .map(|path| {
            let text = fs::read_to_string(&path).unwrap();
            let (code, _) = text.split_once("#[cfg(test)]").unwrap_or((&text, ""));
            let imported = code.split("use crate::").skip(1);
            let names = imported.map(|rest| rest.split("::").next().unwrap().to_owned());
            let module = path.file_stem().unwrap().to_str().unwrap();
            (module.to_owned(), names.collect())
        })
        .filter(|(module, _)| module != "lib")
        .collect()
}

#[test]
fn the_modules_of_the_core_have_no_circular_imports() {
    let mut left = imports();
    assert!(left["controller"].contains("config"), "imports are found");
    // Removes the modules that import no remaining one, layer by layer.
    while !left.is_empty() {
        let remaining: BTreeSet<_> = left.keys().cloned().collect();
        left.retain(|_, imported| !imported.is_disjoint(&remaining));
        assert!(left.len() < remaining.len(), "circular imports: {left:?}");
    }
}
