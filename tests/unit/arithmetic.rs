//! Tests of `arithmetic`.

use super::*;

#[test]
fn a_million_parts_added_and_taken_off_leave_nothing() {
    let part = 0.1;
    let mut sum = Sum::default();
    for _ in 0..1_000_000 {
        sum = sum.plus(part);
    }
    for _ in 0..1_000_000 {
        sum = sum.minus(Sum::from(part));
    }
    assert!(sum.value().abs() < 1e-18, "{sum:?}");
}
