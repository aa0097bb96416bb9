//! Tests of `stability`.

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
