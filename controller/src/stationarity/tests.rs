//! Tests of the lock criterion.

use super::*;

const CRITERION: Stationarity = Stationarity {
    phase_tolerance: 0.01,
    unlock_tolerance: 0.1,
    frequency_drift: 1e-6,
    amplitude_drift: 1e-4,
    block: 5,
};
const CONSTANT: Reading = Reading {
    error: 0.0,
    integral: 1.0,
    omega: 1.0,
    amplitude: 1.0,
    residuals: [0.0; 2],
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
        dwell.settled()
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

#[test]
fn a_scatter_counts_as_noise_only_if_the_residual_has_no_correlation() {
    for step in [1.0, 0.01] {
        let reading = |t: f64| {
            let sample = step * libm::round(10.0 * t);
            Reading {
                amplitude: 1.0 + 0.01 * noise(libm::floor(t - 0.05)),
                residuals: [sample, sample - step]
                    .map(|one| 0.1 * if step < 1.0 { libm::sin(one) } else { noise(one) }),
                ..CONSTANT
            }
        };
        assert_eq!(after_40_periods(reading).settled(), step == 1.0);
    }
}

fn after_40_periods(reading: impl Fn(f64) -> Reading) -> Dwell {
    let mut dwell = Dwell::default();
    for sample in 10..410 {
        CRITERION.update(&mut dwell, &reading(f64::from(sample) / 10.0), sample % 10 == 9);
    }
    dwell
}

/// A reproducible number between -1 and 1.
fn noise(n: f64) -> f64 {
    let x = libm::sin(n * 12.9898) * 43_758.547;
    2.0 * (x - libm::floor(x)) - 1.0
}

#[test]
fn noise_that_hides_the_tolerances_settles_after_two_dwells() {
    let noisy = |t: f64| Reading {
        amplitude: 1.0 + 0.01 * noise(libm::floor(t - 0.05)),
        ..CONSTANT
    };
    assert_eq!(periods_to_settle(noisy), Some(40));
}

#[test]
fn a_drift_that_exceeds_the_noise_does_not_settle() {
    let drifting = |t: f64| Reading {
        amplitude: 1.0 + 2e-3 * t + 0.01 * noise(libm::floor(t - 0.05)),
        ..CONSTANT
    };
    assert_eq!(periods_to_settle(drifting), None);
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
