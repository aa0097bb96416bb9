//! Tests of `crossings`.

use super::*;

#[test]
fn a_sine_has_its_frequency_and_its_amplitude_in_every_period() {
    let dt = 0.061;
    let values: Vec<f64> = (0..1000).map(|n| 0.7 * (f64::from(n) * dt + 0.3).sin()).collect();
    let found = periods(&values, dt);
    assert!(found.len() > 15);
    for period in found {
        assert!((period.omega - 1.0).abs() < 1e-7, "{period:?}");
        assert!((period.amplitude - 0.7).abs() < 0.01, "{period:?}");
    }
}

#[test]
fn what_never_crosses_zero_has_no_period() {
    assert_eq!(periods(&[1.0; 100], 0.1), []);
    assert_eq!(periods(&[], 0.1), []);
}
