//! Unit tests of slow flow.

use super::*;

#[test]
fn a_multiplier_is_one_at_the_fold_and_minus_one_where_symmetry_breaks() {
    for r in [0.3, 0.65, 0.9] {
        let nearest = |b: f64, to: f64| half_period_multipliers(r, b).map(|one| (one - to).norm());
        let fold = nearest(Manifold::new(r).b_min(), 1.0);
        let breaking = nearest(B_SYMMETRY_BREAKING, -1.0);
        assert!(fold[0].min(fold[1]) < 1e-12 && breaking[0].min(breaking[1]) < 1e-12);
    }
}

#[test]
fn all_roots_of_a_product_are_found() {
    // (x - 1)(x - 2)(x + 3)(x - 0.5)
    let roots = real_roots(&[-3.0, 9.5, -7.0, -0.5, 1.0]);
    let product = |x: f64| (x - 1.0) * (x - 2.0) * (x + 3.0) * (x - 0.5);
    assert_eq!(roots.len(), 4, "{roots:?}");
    assert!(roots.iter().all(|root| product(*root).abs() < 1e-12));
}

#[test]
fn a_double_root_is_found_once() {
    let roots = real_roots(&[1.0, -2.0, 1.0]);
    assert_eq!(roots.len(), 1);
    assert!((roots[0] - 1.0).abs() < 1e-7);
}

#[test]
fn a_polynomial_without_real_roots_has_none() {
    assert!(real_roots(&[1.0, 0.0, 1.0]).is_empty());
    assert!(real_roots(&[5.0]).is_empty());
    assert!(real_roots(&[0.0, 0.0]).is_empty());
}
