//! Tests of the phase detector.

use super::*;
use crate::oscillator::Oscillator;

/// A detector of bandwidth 0.1 for a frequency near 1.
fn detector(detector: Detector, sample_time: f64) -> PhaseDetector {
    PhaseDetector::new(&Config { detector, sample_time, ..Config::for_resonance(1.0, 0.0) })
}

/// Largest error of amplitude and phase in the last period, after the transient.
fn ripple(method: Detector, signal: impl Fn(f64) -> f64, truth: (f64, f64)) -> f64 {
    let (omega, sample_time) = (1.0, core::f64::consts::TAU / 100.3);
    let detector = detector(method, sample_time);
    let mut estimate = Estimate::default();
    let mut oscillator = Oscillator::default();
    let mut worst = 0.0_f64;
    for n in 0..10_000 {
        let rotor = oscillator.rotor();
        let phase = libm::atan2(rotor.im, rotor.re);
        detector.update(&mut estimate, signal(phase), &detector.rotors(rotor));
        oscillator.advance(omega, sample_time);
        if n >= 9_900 {
            // Re(c exp(i phase)) is a cosine; a sine lags a cosine by pi/2.
            let Complex { re, im } = estimate.fundamental();
            let (amplitude, phase) = (estimate.amplitude, Complex { re: -im, im: re }.argument());
            worst = worst.max((amplitude - truth.0).abs().max((phase - truth.1).abs()));
        }
    }
    worst
}

fn with_third_harmonic(phase: f64) -> f64 {
    2.0 * libm::sin(phase + 0.7) - 0.3 * libm::sin(3.0 * phase + 0.2)
}

#[test]
fn the_adaptive_filter_separates_the_fundamental_from_a_harmonic() {
    let error = ripple(Detector::Adaptive, with_third_harmonic, (2.0, 0.7));
    assert!(error < 1e-12, "{error}");
}

#[test]
fn the_adaptive_filter_rejects_an_offset() {
    let error = ripple(Detector::Adaptive, |phase| 5.0 + libm::sin(phase), (1.0, 0.0));
    assert!(error < 1e-12, "{error}");
}

#[test]
fn the_demodulator_finds_the_fundamental_with_ripple() {
    let error = ripple(Detector::Demodulator, with_third_harmonic, (2.0, 0.7));
    assert!((1e-2..0.2).contains(&error), "{error}");
}

#[test]
fn the_coherence_is_one_for_a_sine_and_zero_for_a_zero_signal() {
    let detector = detector(Detector::Adaptive, 0.06);
    let mut estimate = Estimate::default();
    assert_eq!(estimate.coherence(), 0.0);
    let mut oscillator = Oscillator::default();
    for _ in 0..5_000 {
        let rotor = oscillator.rotor();
        detector.update(&mut estimate, rotor.im, &detector.rotors(rotor));
        oscillator.advance(1.0, 0.06);
    }
    assert!(estimate.coherence() > 1.0 - 1e-12);
    assert!((estimate.amplitude - 1.0).abs() < 1e-9);
}
