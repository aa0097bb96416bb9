//! Tests of `overdamped`.

use super::*;

#[test]
fn the_series_meets_the_quotient_where_they_change_over() {
    let (below, above) = (integrals(-0.5 + 1e-15, 1.0), integrals(-0.5 - 1e-15, 1.0));
    assert!((below.0 - above.0).abs() < 4e-15 && (below.1 - above.1).abs() < 4e-15);
}

#[test]
fn a_push_from_rest_obeys_the_equation_of_motion() {
    let oscillator = Oscillator::new(1.0, 1.0, 6.0);
    assert!(is_apart(&oscillator));
    for t in [0.01, 0.3, 2.0, 30.0] {
        let ((once, twice), m) = (pushed(&oscillator, t), oscillator.flow(t).0);
        // The integral of the equation of the velocity, once and twice.
        assert!((m.vv + 6.0 * m.xv + once - 1.0).abs() < 1e-14);
        assert!((m.xv + 6.0 * once + twice - t).abs() < 1e-14 * t.max(1.0));
    }
}
