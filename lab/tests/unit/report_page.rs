//! Tests of `report/page`.

use super::*;

#[test]
fn an_image_inside_an_address_has_no_markup() {
    assert_eq!(
        utf8_percent_encode("<a b=\"#\">", UNRESERVED).to_string(),
        "%3Ca%20b%3D%22%23%22%3E"
    );
}
