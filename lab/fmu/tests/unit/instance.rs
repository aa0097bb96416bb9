//! Tests of `instance`.

use super::*;

#[test]
fn a_file_that_is_not_an_archive_is_refused() {
    let path = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/Cargo.toml"));
    let error = Fmu::load(path, "rig").err().unwrap();
    let FmuError::Load { source, .. } = &error else {
        panic!("{error}");
    };
    assert!(matches!(source, LoadError::Archive(_)), "{error}");
    let message = error.to_string();
    assert!(
        message.contains("Cargo.toml") && message.contains("zip archive"),
        "{message}"
    );
}
