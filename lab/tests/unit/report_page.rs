//! Tests of `report/page`.

use super::*;

#[test]
fn an_image_inside_an_address_has_no_markup() {
    assert_eq!(percent_encoded("<a b=\"#\">"), "%3Ca%20b%3D%22%23%22%3E");
}
