//! Tests of `clearance`.

use super::*;
use proptest::prelude::*;

proptest! {
    #[test]
    fn a_gap_said_to_be_open_is_open(
        gap in 0.0..1.0f64, closing in -2.0..2.0f64, acceleration in -2.0..2.0f64, jerk in 0.0..4.0f64,
    ) {
        let g = Gap { gap, closing, acceleration, jerk };
        let h = g.certainly_open(3.0, |_| jerk);
        for n in 0..200 {
            let t = h * f64::from(n) / 200.0;
            let worst = gap - t * (closing + t * (acceleration / 2.0 + t * jerk / 6.0));
            prop_assert!(worst >= -1e-14, "h {h}, t {t}: {worst}");
        }
    }
}

#[test]
fn an_opening_gap_is_open_for_the_whole_window() {
    let g = Gap { gap: 0.1, closing: -1.0, acceleration: -0.5, jerk: 0.0 };
    assert_eq!(g.certainly_open(0.2, |_| 1.0), 0.2);
}

#[test]
fn a_start_at_rest_on_the_wall_that_draws_away_is_clear_at_once() {
    let g = Gap { gap: 0.0, closing: 0.0, acceleration: -0.5, jerk: 0.0 };
    assert!(g.certainly_open(2.0, |_| 1.0) > 0.5);
}
