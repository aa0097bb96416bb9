//! Tests of `pack/archive`.

use std::io::Read;

use super::*;

#[test]
fn what_goes_in_comes_out_again() {
    let entries: [(&str, &[u8]); 3] = [
        ("a.xml", b"<a/>"),
        ("binaries/x/a.so", &[7; 5000]),
        ("resources/a.fmu", &[8; 50]),
    ];
    let bytes = zip(&entries).unwrap();
    let mut archive = zip::ZipArchive::new(Cursor::new(bytes)).unwrap();
    for (name, content) in entries {
        let mut read = Vec::new();
        archive.by_name(name).unwrap().read_to_end(&mut read).unwrap();
        assert_eq!(read, content);
    }
}

#[test]
fn the_same_entries_give_the_same_bytes() {
    let bytes = || zip(&[("a", b"content")]).unwrap();
    assert_eq!(bytes(), bytes());
}
