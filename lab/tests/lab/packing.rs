//! Guards packing: FMUs from libraries built here, and the refusal of everything else.

use std::{
    env::consts::{DLL_PREFIX, DLL_SUFFIX},
    fs,
    io::{Cursor, Read},
    path::{Path, PathBuf},
    process::Command,
};

use vines::pack::{Binary, Component, File, PackError, own_libraries, pack};

const GUID: &str = "0f2e5d6c-3b1a-4a7e-9c58-d40f1e2b7a96";

fn component() -> Component {
    Component {
        identifier: "Tiny",
        package: "tiny-fmu",
        xml: format!(
            "<fmiModelDescription fmiVersion=\"2.0\" modelName=\"Tiny\" guid=\"{GUID}\"><ModelVariables/></fmiModelDescription>"
        ),
        library_guid: GUID.into(),
        png: b"",
        page: "".into(),
        files: Vec::new(),
    }
}

fn library(folder: &Path) -> PathBuf {
    folder.join(format!("{DLL_PREFIX}tiny_fmu{DLL_SUFFIX}"))
}

/// Builds a shared library that exports one function and holds a guid.
fn build(folder: &Path, function: &str, guid: &str) {
    let source = folder.join("tiny.rs");
    let code = format!("#[unsafe(no_mangle)] pub extern \"C\" fn {function}() -> *const u8 {{ \"{guid}\".as_ptr() }}");
    fs::write(&source, code).unwrap();
    let rustc = std::env::var_os("RUSTC").unwrap_or("rustc".into());
    let status = Command::new(rustc)
        .args(["--edition", "2024", "--crate-type", "cdylib", "-o"])
        .arg(library(folder))
        .arg(&source)
        .status()
        .expect("rustc runs");
    assert!(status.success());
}

/// Packs the libraries of this machine in `folder`, and others.
fn packed(folder: &Path, others: &[Binary]) -> Result<Vec<File>, PackError> {
    let own = own_libraries(&[component()], folder)?;
    pack(&[component()], &[&own, others].concat())
}

/// The only library in an FMU: its name, and its size in bytes.
fn packed_library((_, fmu): &File) -> (String, u64) {
    let mut zip = zip::ZipArchive::new(Cursor::new(fmu)).unwrap();
    let mut description = String::new();
    let mut entry = zip.by_name("modelDescription.xml").unwrap();
    entry.read_to_string(&mut description).unwrap();
    assert_eq!(description, component().xml);
    drop(entry);
    let names = zip.file_names().map(|name| name.unwrap().into_owned());
    let names: Vec<_> = names.filter(|name| name.starts_with("binaries/")).collect();
    let [name]: [String; 1] = names.try_into().unwrap();
    let size = zip.by_name(&name).unwrap().size();
    (name, size)
}

#[test]
fn a_component_is_packed_with_its_library_or_with_the_one_that_is_given_in_its_place() {
    let folder = tempfile::tempdir().unwrap();
    build(folder.path(), "fmi2Instantiate", GUID);
    let fmus = packed(folder.path(), &[]).unwrap();
    assert!(fmus.len() == 1 && fmus[0].0 == "Tiny.fmu");
    let (name, size) = packed_library(&fmus[0]);
    assert_eq!(size, fs::metadata(library(folder.path())).unwrap().len());
    // The folder of the platform: the FMU crate loads the library from it in the tests of endpoints.
    let platform = name.split('/').nth(1).unwrap();
    assert_eq!(name, format!("binaries/{platform}/Tiny{DLL_SUFFIX}"));
    let other = folder.path().join("other");
    let content = format!("a library with {GUID}");
    fs::write(&other, &content).unwrap();
    let other: Binary = format!("{platform}={}", other.display()).parse().unwrap();
    let fmus = packed(folder.path(), &[other]).unwrap();
    assert_eq!(packed_library(&fmus[0]), (name, content.len() as u64));
}

#[test]
fn a_library_that_is_missing_or_of_another_kind_is_named_with_its_package() {
    let folder = tempfile::tempdir().unwrap();
    let path = library(folder.path());
    let refused = |part: &str| {
        let error = packed(folder.path(), &[]).expect_err("a mistake");
        assert!(
            matches!(error, PackError::NotOwn { package: "tiny-fmu", .. }),
            "{error}"
        );
        let (message, named) = (error.to_string(), path.display().to_string());
        assert!(message.contains(part) && message.contains(&named), "{message}");
    };
    refused("not the library of Tiny for this machine");
    // The header of a library of the other world: a PE file for x86-64 here, or an ELF file on Windows.
    let mut other = vec![0u8; 1024];
    if cfg!(windows) {
        other[..6].copy_from_slice(b"\x7fELF\x02\x01");
    } else {
        other[..2].copy_from_slice(b"MZ");
        other[0x3c] = 0x40;
        other[0x40..0x44].copy_from_slice(b"PE\0\0");
    }
    for content in [&other[..], b"", b"hello", b"\x7fELF"] {
        fs::write(&path, content).unwrap();
        refused("not the library of Tiny for this machine");
    }
    fs::remove_file(&path).unwrap();
    build(folder.path(), "something_else", GUID);
    refused("fmi2Instantiate");
    build(folder.path(), "fmi2Instantiate", "of an older table");
    let error = packed(folder.path(), &[]).expect_err("a mistake");
    assert!(matches!(error, PackError::Foreign(_)), "{error}");
}
