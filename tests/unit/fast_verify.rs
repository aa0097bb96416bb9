//! Tests of `fast/verify`.

use super::*;
use proptest::prelude::*;

proptest! {
    #[test]
    fn a_sample_verified_as_open_is_open(
        w in -1.0..=1.0f64, dw in -2.0..2.0f64, ddw in -3.0..3.0f64, jerk in 0.0..2.0f64, t in 0.01..3.0f64,
    ) {
        let open = Sample { w, dw, ddw }.is_open(1.0, jerk, t);
        let farthest = (1..=400).map(|n| {
            let h = t * f64::from(n) / 400.0;
            (w + h * (dw + 0.5 * h * ddw)).abs() + jerk * h * h * h / 6.0
        }).fold(0.0, f64::max);
        prop_assert!(!open || farthest < 1.0, "{farthest}");
    }

    #[test]
    fn a_clear_sample_is_verified(w in -0.5..0.5f64, dw in -0.2..0.2f64, ddw in -0.1..0.1f64) {
        let open = Sample { w, dw, ddw }.is_open(1.0, 0.1, 1.0);
        prop_assert!(open);
    }

    #[test]
    fn a_start_on_a_wall_is_open_only_if_it_leaves(dw in -2.0..2.0f64) {
        let open = Sample { w: 1.0, dw, ddw: 0.0 }.is_open(1.0, 1e-3, 0.1);
        prop_assert_eq!(open, dw < -1e-5);
    }
}
