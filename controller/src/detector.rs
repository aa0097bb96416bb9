//! The phase detector of one channel: amplitude and phase of the fundamental, relative to the oscillator.
//!
//! The signal is estimated as `offset + Σ Re(c_h exp(i h phase))`. The adaptive filter (least mean squares, LMS) moves every coefficient down the
//! gradient of the squared residual. All harmonics and the offset share one residual, so that no component causes ripple in another. The
//! demodulator estimates the fundamental only. Both are of first order and have the same bandwidth.

use crate::config::{Config, Detector, MAX_HARMONICS};
use crate::oscillator::Complex;
use crate::real::Real;

/// Rotors of the harmonics in a sample. The first entry belongs to the fundamental.
pub type Rotors = [Complex; MAX_HARMONICS];

/// Coefficients of a phase detector.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct PhaseDetector {
    method: Detector,
    /// Number of harmonics, including the fundamental.
    harmonics: usize,
    odd_only: bool,
    /// Share of the error of a coefficient that a sample corrects.
    pub step: Real,
}

/// The signal of one channel, as estimated.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Signal {
    /// m
    offset: Real,
    /// m, relative to the oscillator's phase. The first entry belongs to the fundamental.
    harmonic: Rotors,
    /// Mean square of the residual, m².
    pub residual_power: Real,
    /// Amplitude of the fundamental, m: many need it, and it takes a root.
    pub amplitude: Real,
}

impl Signal {
    /// Coefficient of the fundamental, m: the signal contains `Re(c exp(i phase))`.
    pub fn fundamental(&self) -> Complex {
        self.harmonic[0]
    }

    /// Power of the fundamental over the sum of itself and the residual power; 0 for a zero signal.
    pub fn coherence(&self) -> Real {
        let (power, total) = self.powers();
        if total > 0.0 { power / total } else { 0.0 }
    }

    /// Whether the coherence of a signal above 0 is at least this. (Without a division, which takes as long as ten products.)
    pub fn is_coherent(&self, least: Real) -> bool {
        let (power, total) = self.powers();
        power >= least * total
    }

    /// Power of the fundamental, and the sum of itself and the residual power, m².
    fn powers(&self) -> (Real, Real) {
        let power = 0.5 * self.amplitude * self.amplitude;
        (power, power + self.residual_power)
    }
}

impl PhaseDetector {
    /// The detector of a configuration.
    pub fn new(config: &Config) -> Self {
        Self {
            method: config.detector,
            harmonics: config.harmonics.into(),
            odd_only: config.odd_only,
            step: config.step(config.bandwidth),
        }
    }

    /// `exp(i h phase)` of every harmonic `h`, for all channels; `rotor` is `exp(i phase)` of the oscillator.
    pub fn rotors(&self, rotor: Complex) -> Rotors {
        let stride = if self.odd_only { rotor.times(rotor) } else { rotor };
        let (mut rotors, mut next) = ([rotor; MAX_HARMONICS], rotor);
        for kept in rotors.iter_mut().take(self.harmonics) {
            *kept = next;
            next = next.times(stride);
        }
        rotors
    }

    /// Whether the sum of the amplitudes of the harmonics above the fundamental is at most this, m.
    pub fn harmonics_within(&self, estimate: &Signal, limit: Real) -> bool {
        let used = || estimate.harmonic.iter().take(self.harmonics).skip(1);
        // The bound without roots decides almost always.
        used().map(|c| c.re.abs() + c.im.abs()).sum::<Real>() <= limit
            || used().map(|c| c.magnitude()).sum::<Real>() <= limit
    }

    /// Updates the estimate with a sample, m. Returns the difference between the sample and its prediction, m.
    pub fn update(&self, estimate: &mut Signal, sample: Real, rotors: &Rotors) -> Real {
        let Self { step, harmonics, .. } = *self;
        let residual = match self.method {
            Detector::Adaptive => {
                let mut predicted = estimate.offset;
                for (c, rotor) in estimate.harmonic.iter().zip(rotors).take(harmonics) {
                    predicted += c.re * rotor.re - c.im * rotor.im;
                }
                let residual = sample - predicted;
                estimate.offset += step * residual;
                let gain = 2.0 * step * residual;
                for (c, rotor) in estimate.harmonic.iter_mut().zip(rotors).take(harmonics) {
                    c.re += gain * rotor.re;
                    c.im -= gain * rotor.im;
                }
                residual
            }
            Detector::Demodulator => {
                let (c, rotor) = (&mut estimate.harmonic[0], rotors[0]);
                let residual = sample - (c.re * rotor.re - c.im * rotor.im);
                c.re += step * (2.0 * sample * rotor.re - c.re);
                c.im -= step * (2.0 * sample * rotor.im + c.im);
                residual
            }
        };
        estimate.residual_power += step * (residual * residual - estimate.residual_power);
        estimate.amplitude = estimate.fundamental().magnitude();
        residual
    }
}

#[cfg(test)]
#[cfg(not(feature = "f32"))]
mod tests {
    use super::*;
    use crate::oscillator::PhaseAccumulator;

    /// A detector of bandwidth 0.1 for a frequency near 1.
    fn detector(detector: Detector, sample_time: f64) -> PhaseDetector {
        PhaseDetector::new(&Config { detector, sample_time, ..Config::for_resonance(1.0, 0.0) })
    }

    /// Largest error of amplitude and phase in the last period, after the transient.
    fn ripple(method: Detector, signal: impl Fn(f64) -> f64, truth: (f64, f64)) -> f64 {
        let (omega, sample_time) = (1.0, core::f64::consts::TAU / 100.3);
        let detector = detector(method, sample_time);
        let mut estimate = Signal::default();
        let mut oscillator = PhaseAccumulator::default();
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
    fn the_adaptive_filter_separates_the_fundamental_from_harmonic_and_offset_and_the_demodulator_finds_it_with_ripple()
    {
        for (method, signal, truth, allowed) in [
            (
                Detector::Adaptive,
                with_third_harmonic as fn(f64) -> f64,
                (2.0, 0.7),
                0.0..1e-12,
            ),
            (
                Detector::Adaptive,
                |phase| 5.0 + libm::sin(phase),
                (1.0, 0.0),
                0.0..1e-12,
            ),
            (Detector::Demodulator, with_third_harmonic, (2.0, 0.7), 1e-2..0.2),
        ] {
            let error = ripple(method, signal, truth);
            assert!(allowed.contains(&error), "{method:?}: {error}");
        }
    }

    #[test]
    fn the_coherence_is_one_for_a_sine_and_zero_for_a_zero_signal() {
        let detector = detector(Detector::Adaptive, 0.06);
        let mut estimate = Signal::default();
        assert_eq!(estimate.coherence(), 0.0);
        let mut oscillator = PhaseAccumulator::default();
        for _ in 0..5_000 {
            let rotor = oscillator.rotor();
            detector.update(&mut estimate, rotor.im, &detector.rotors(rotor));
            oscillator.advance(1.0, 0.06);
        }
        assert!(estimate.coherence() > 1.0 - 1e-12);
        assert!((estimate.amplitude - 1.0).abs() < 1e-9);
    }
}
