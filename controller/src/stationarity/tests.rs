//! Tests of the lock criterion.

use super::*;

/// A detector of a tenth of the frequency, with a hundred samples per period.
const CRITERION: Stationarity = Stationarity {
    phase_tolerance: 0.01,
    unlock_tolerance: 0.1,
    drifts: [1e-6, 1e-4],
    passed: 0.08,
    integral_gain: 0.1,
    block: 5,
};
const CONSTANT: Reading = Reading {
    error: 0.0,
    integral: 1.0,
    omega: 1.0,
    amplitude: 1.0,
    residual_power: 0.0,
    valid: true,
};

/// Number of periods of ten samples until settled; None after 200.
fn periods_to_settle(reading: impl Fn(f64) -> Reading) -> Option<u32> {
    let mut dwell = Dwell::default();
    (1..=200).find(|period| {
        for sample in 0..10 {
            let periods = f64::from(*period) + f64::from(sample) / 10.0;
            CRITERION.update(&mut dwell, &reading(periods), sample == 9);
        }
        dwell.settled
    })
}

#[test]
fn a_constant_signal_settles_after_the_dwell() {
    assert_eq!(periods_to_settle(|_| CONSTANT), Some(20));
}

#[test]
fn ripple_within_the_period_does_not_matter() {
    let reading = |t: f64| Reading {
        error: 0.05 * libm::sin(core::f64::consts::TAU * t),
        ..CONSTANT
    };
    assert_eq!(periods_to_settle(reading), Some(20));
}

#[test]
fn a_signal_that_drifts_too_fast_does_not_settle() {
    let amplitude = |rate: f64| move |t: f64| Reading { amplitude: 1.0 + rate * t, ..CONSTANT };
    assert_eq!(periods_to_settle(amplitude(1.1e-4)), None);
    assert_eq!(periods_to_settle(amplitude(0.9e-4)), Some(20));
    let frequency = |t: f64| Reading { integral: 1.0 + 1.1e-6 * t, ..CONSTANT };
    assert_eq!(periods_to_settle(frequency), None);
}

#[test]
fn a_slow_modulation_is_not_stationary_at_its_crest() {
    let reading = |t: f64| Reading { amplitude: 1.0 + 0.1 * libm::sin(0.06 * t), ..CONSTANT };
    assert_eq!(periods_to_settle(reading), None);
}

/// A reproducible number between -1 and 1.
fn noise(n: f64) -> f64 {
    let x = libm::sin(n * 12.9898) * 43_758.547;
    2.0 * (x - libm::floor(x)) - 1.0
}

/// An amplitude with a drift per period and noise of `scatter` in its means, and readings with noise of the power that leads to it.
fn noisy(drift: f64, scatter: f64) -> impl Fn(f64) -> Reading {
    move |t| Reading {
        amplitude: 1.0 + drift * t + scatter * 3_f64.sqrt() * noise(libm::floor(t - 0.05)),
        residual_power: (scatter / CRITERION.passed) * (scatter / CRITERION.passed),
        ..CONSTANT
    }
}

#[test]
fn noise_that_hides_the_tolerances_settles_after_two_dwells() {
    assert_eq!(periods_to_settle(noisy(0.0, 0.01)), Some(40));
}

#[test]
fn a_scatter_without_noise_of_the_readings_does_not_settle() {
    let reading = |t: f64| Reading { residual_power: 0.0, ..noisy(0.0, 0.01)(t) };
    assert_eq!(periods_to_settle(reading), None);
}

#[test]
fn a_modulation_is_no_noise_although_it_has_a_residual() {
    for period in [4.0, 10.0, 30.0, 60.0] {
        let rate = core::f64::consts::TAU / period;
        let residual = rate / libm::hypot(rate, 0.1 * core::f64::consts::TAU);
        let estimate = libm::sqrt(1.0 - residual * residual);
        let reading = |t: f64| Reading {
            amplitude: 1.0 + 0.02 * estimate * libm::sin(rate * t),
            residual_power: 0.5 * (0.02 * residual) * (0.02 * residual),
            ..CONSTANT
        };
        assert_eq!(periods_to_settle(reading), None, "{period}");
    }
}

#[test]
fn a_drift_that_exceeds_the_noise_does_not_settle() {
    for drift in [1.5e-3, 5e-3] {
        assert_eq!(periods_to_settle(noisy(drift, 0.01)), None, "{drift}");
    }
}

#[test]
fn one_invalid_sample_restarts_the_dwell() {
    let reading = |t: f64| Reading { valid: t != 10.5, ..CONSTANT };
    assert_eq!(periods_to_settle(reading), Some(30));
}

#[test]
fn the_lock_is_lost_only_beyond_the_wider_tolerance() {
    let mut dwell = Dwell::default();
    let mut is_lost = |error| CRITERION.update(&mut dwell, &Reading { error, ..CONSTANT }, true);
    assert!(!is_lost(0.05) && !is_lost(-0.09));
    assert!(is_lost(0.11));
}
