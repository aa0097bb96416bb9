//! Unit tests of slow flow.

use super::*;

#[test]
fn all_roots_of_a_product_are_found() {
    // (x - 1)(x - 2)(x + 3)(x - 0.5)
    let roots = real_roots(&[-3.0, 9.5, -7.0, -0.5, 1.0]);
    let product = |x: f64| (x - 1.0) * (x - 2.0) * (x + 3.0) * (x - 0.5);
    assert_eq!(roots.len(), 4, "{roots:?}");
    assert!(roots.iter().all(|root| product(*root).abs() < 1e-12));
}

#[test]
fn a_polynomial_without_real_roots_has_none() {
    assert!(real_roots(&[1.0, 0.0, 1.0]).is_empty());
    assert!(real_roots(&[5.0]).is_empty());
    assert!(real_roots(&[0.0, 0.0]).is_empty());
}
