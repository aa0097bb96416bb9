//! Tests of `pack/date`.

use super::*;

#[test]
fn seconds_become_a_date_in_universal_time() {
    assert_eq!(format("1700000000").unwrap(), "2023-11-14T22:13:20Z");
}

#[test]
fn what_is_no_number_of_seconds_is_refused() {
    for text in ["yesterday", "1.5", "99999999999999999"] {
        let message = format(text).expect_err("no date").to_string();
        assert!(message.contains(text) && message.contains("1700000000"), "{message}");
    }
}
