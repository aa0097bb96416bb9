//! Tests of `fit`.

use super::*;
use proptest::prelude::*;

proptest! {
    #[test]
    fn a_drifting_harmonic_is_found_from_a_poor_guess(
        amplitude in 0.1..2.0f64, phase in -3.0..3.0f64, decay in 0.0..0.02f64, guess in 0.98..1.02f64,
    ) {
        let (dt, n) = (0.063, 151);
        let middle = 75.0;
        let values: Vec<f64> = (0..n).map(|i| {
            let t = (f64::from(i) - middle) * dt;
            let theta = phase + t;
            amplitude * (1.0 - decay * t) * theta.sin() + 0.02 * (3.0 * theta + 0.3).sin() + 0.01
        }).collect();
        let fit = harmonic(&values, dt, guess).unwrap();
        prop_assert!((fit.omega - 1.0).abs() < 1e-9, "{fit:?}");
        prop_assert!((fit.amplitude - amplitude).abs() < 1e-9);
        prop_assert!((fit.phase - phase).abs() < 1e-9);
    }
}

#[test]
fn silence_has_no_harmonic() {
    assert_eq!(harmonic(&[0.0; 100], 0.1, 1.0), None);
}
