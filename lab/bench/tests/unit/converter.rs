//! Tests of `converter`.

use super::*;

#[test]
fn three_bits_have_eight_values() {
    let converter = Converter::new(3, 1.0);
    let mut seen: Vec<f64> = (-300..300).map(|n| converter.convert(f64::from(n) / 100.0)).collect();
    seen.dedup();
    assert_eq!(seen, [-1.0, -0.75, -0.5, -0.25, 0.0, 0.25, 0.5, 0.75]);
}
