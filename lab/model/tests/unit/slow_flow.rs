//! Unit tests of the roots of a polynomial.

use super::*;

#[test]
fn all_real_roots_are_found_and_no_others() {
    // (x - 1)(x - 2)(x + 3)(x - 0.5)
    let roots = real_roots(&[-3.0, 9.5, -7.0, -0.5, 1.0]);
    assert_eq!(roots.len(), 4, "{roots:?}");
    for (root, expected) in roots.iter().zip([-3.0, 0.5, 1.0, 2.0]) {
        assert!((root - expected).abs() < 1e-12, "{roots:?}");
    }
    for without in [&[1.0, 0.0, 1.0][..], &[5.0], &[0.0, 0.0]] {
        assert!(real_roots(without).is_empty());
    }
}
