//! Tests of `pack`.

use std::io::Read;

use super::*;

#[test]
fn what_goes_in_comes_out_again_and_the_same_entries_give_the_same_bytes() {
    let entries = [
        ("a.xml".to_owned(), b"<a/>".to_vec()),
        ("binaries/x/a.so".to_owned(), vec![7; 5000]),
        ("resources/a.fmu".to_owned(), vec![8; 50]),
    ];
    let bytes = || archive("a.ssp".into(), &entries).unwrap().1;
    assert_eq!(bytes(), bytes());
    let mut archive = zip::ZipArchive::new(Cursor::new(bytes())).unwrap();
    for (name, content) in entries {
        let mut read = Vec::new();
        archive.by_name(&name).unwrap().read_to_end(&mut read).unwrap();
        assert_eq!(read, content);
    }
}

#[test]
fn seconds_become_a_date_in_universal_time() {
    assert_eq!(format_date("1700000000").unwrap(), "2023-11-14T22:13:20Z");
}

#[test]
fn what_is_no_number_of_seconds_is_refused() {
    for text in ["yesterday", "1.5", "99999999999999999"] {
        let message = format_date(text).expect_err("no date").to_string();
        assert!(message.contains(text) && message.contains("1700000000"), "{message}");
    }
}
