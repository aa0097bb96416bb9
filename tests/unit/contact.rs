//! Tests of `contact`.

use super::*;
use proptest::prelude::*;

proptest! {
    #[test]
    fn an_impact_keeps_momentum_and_dissipates_what_it_says(
        epsilon in 1e-6..1.0f64, r in 1e-3..=1.0f64, v1 in -2.0..2.0f64, v2 in -2.0..2.0f64,
    ) {
        let p = Parameters::dimensionless(epsilon, 1.0, r);
        let wall = if v1 > v2 { Wall::Plus } else { Wall::Minus };
        let after = ImpactLaw::new(&p).touch(wall, (v1, v2, v1 - v2), |_, _| false);
        prop_assert!((after.primary + epsilon * after.particle - v1 - epsilon * v2).abs() < 4e-15);
        prop_assert!((after.primary - after.particle - after.relative).abs() < 4e-15);
        let energy = |v1: f64, v2: f64| 0.5 * (v1 * v1 + epsilon * v2 * v2);
        let lost = energy(v1, v2) - energy(after.primary, after.particle);
        prop_assert!((lost - after.dissipated).abs() < 2e-14);
        prop_assert!(after.dissipated >= 0.0);
    }
}
