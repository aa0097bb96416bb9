//! What the tests of sweeps share.

#![allow(dead_code, reason = "every test program uses a part of it")]

use std::{collections::BTreeMap, fs, path::Path, sync::Arc};

use vines_sweep::{Settings, Sweep};
use vines_testbench::scene::Family;
use zarrs::{
    array::Array,
    storage::{WritableStorageTraits, store::MemoryStore},
};

pub fn settings(axes: &[&str]) -> Settings {
    Settings {
        axes: axes.iter().map(|axis| axis.parse().unwrap()).collect(),
        periods: 200,
        chunk: 7,
        ..Settings::default()
    }
}

pub fn plan(settings: Settings) -> Result<Sweep, String> {
    Sweep::new(Family::parse("", None, &[]).unwrap(), settings).map_err(|error| error.to_string())
}

pub fn refused(settings: Settings) -> String {
    plan(settings).unwrap_err()
}

/// All files of a store.
pub fn files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut all = BTreeMap::new();
    let mut folders = vec![folder.to_path_buf()];
    while let Some(one) = folders.pop() {
        for entry in fs::read_dir(&one).unwrap().flatten() {
            let path = entry.path();
            if path.is_dir() {
                folders.push(path);
            } else {
                let name = path.strip_prefix(folder).unwrap().display().to_string();
                all.insert(name, fs::read(&path).unwrap());
            }
        }
    }
    all
}

/// The numbers of a variable.
pub fn numbers(folder: &Path, name: &str) -> Vec<f64> {
    let array = array(folder, name);
    array.retrieve_array_subset(&array.subset_all()).unwrap()
}

pub fn array(folder: &Path, name: &str) -> Array<MemoryStore> {
    let memory = MemoryStore::new();
    for (key, value) in files(&folder.join(name)) {
        let key = format!("a/{key}").as_str().try_into().unwrap();
        memory.set(&key, value.into()).unwrap();
    }
    Array::open(Arc::new(memory), "/a").unwrap()
}
