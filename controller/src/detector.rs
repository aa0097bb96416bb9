//! The phase detector of one channel.

use crate::angle::Complex;
use crate::config::Detector as Kind;
use crate::harmonics::{Coefficients, Harmonics};

/// Either detector, ready to run. Both are first order with the same bandwidth.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Detector {
    Adaptive(Harmonics),
    Demodulator { step: f64 },
}

/// What is known of one channel.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Estimate {
    /// In m, relative to the oscillator's phase; the demodulator knows only the fundamental.
    coefficients: Coefficients,
    /// Mean square of what the detector leaves unexplained, m².
    residual_power: f64,
}

impl Estimate {
    fn fundamental(&self) -> Complex {
        self.coefficients.harmonic[0]
    }

    /// Amplitude of the fundamental, m.
    pub fn amplitude(&self) -> f64 {
        self.fundamental().magnitude()
    }

    /// Phase of `sin` relative to the oscillator's sine, rad.
    pub fn argument(&self) -> f64 {
        // Re(c exp(i phase)) is a cosine; a sine is a cosine a quarter turn late.
        let Complex { re, im } = self.fundamental();
        Complex { re: -im, im: re }.argument()
    }

    /// Share of the fundamental in the power of itself and the residual; 0 for silence.
    pub fn coherence(&self) -> f64 {
        let power = 0.5 * self.amplitude() * self.amplitude();
        let total = power + self.residual_power;
        if total > 0.0 { power / total } else { 0.0 }
    }
}

impl Detector {
    /// A detector of the given bandwidth (rad/s), sampled every `sample_time` s.
    pub fn new(kind: Kind, bandwidth: f64, sample_time: f64) -> Self {
        let step = -libm::expm1(-bandwidth * sample_time);
        match kind {
            Kind::Adaptive {
                harmonics,
                odd_only,
            } => Self::Adaptive(Harmonics {
                count: harmonics.into(),
                odd_only,
                step,
            }),
            Kind::Demodulator => Self::Demodulator { step },
        }
    }

    /// Sum of the steps of all coefficients: the share of a residual that one update takes away, at most 1.
    pub fn total_step(&self) -> f64 {
        match self {
            Self::Adaptive(harmonics) => harmonics.total_step(),
            Self::Demodulator { step } => *step,
        }
    }

    /// Order of the highest harmonic that must be sampled well.
    pub fn highest_harmonic(&self) -> usize {
        match self {
            Self::Adaptive(harmonics) => harmonics.highest(),
            Self::Demodulator { .. } => 2,
        }
    }

    /// Takes a sample, m, at the oscillator's phase.
    pub fn update(&self, estimate: &mut Estimate, sample: f64, rotor: Complex) {
        let (residual, step) = match self {
            Self::Adaptive(harmonics) => {
                let residual = harmonics.update(&mut estimate.coefficients, sample, rotor);
                (residual, harmonics.step)
            }
            Self::Demodulator { step } => {
                let low_pass = &mut estimate.coefficients.harmonic[0];
                let residual = sample - (low_pass.re * rotor.re - low_pass.im * rotor.im);
                low_pass.re += step * (2.0 * sample * rotor.re - low_pass.re);
                low_pass.im -= step * (2.0 * sample * rotor.im + low_pass.im);
                (residual, *step)
            }
        };
        estimate.residual_power += step * (residual * residual - estimate.residual_power);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::oscillator::Oscillator;

    const ADAPTIVE: Kind = Kind::Adaptive {
        harmonics: 3,
        odd_only: true,
    };

    /// Largest distance of amplitude and phase from the truth over the last of many periods.
    fn ripple(kind: Kind, signal: impl Fn(f64) -> f64, truth: (f64, f64)) -> f64 {
        let (omega, sample_time) = (1.0, core::f64::consts::TAU / 100.3);
        let detector = Detector::new(kind, 0.1, sample_time);
        let mut estimate = Estimate::default();
        let mut oscillator = Oscillator::default();
        let mut worst = 0.0_f64;
        for n in 0..10_000 {
            detector.update(
                &mut estimate,
                signal(oscillator.phase()),
                oscillator.rotor(),
            );
            oscillator.advance(omega, sample_time);
            if n >= 9_900 {
                let (amplitude, phase) = (estimate.amplitude(), estimate.argument());
                worst = worst.max((amplitude - truth.0).abs().max((phase - truth.1).abs()));
            }
        }
        worst
    }

    fn with_third_harmonic(phase: f64) -> f64 {
        2.0 * libm::sin(phase + 0.7) - 0.3 * libm::sin(3.0 * phase + 0.2)
    }

    #[test]
    fn the_adaptive_filter_rejects_harmonics_it_follows() {
        let error = ripple(ADAPTIVE, with_third_harmonic, (2.0, 0.7));
        assert!(error < 1e-12, "{error}");
    }

    #[test]
    fn the_adaptive_filter_rejects_an_offset() {
        let error = ripple(ADAPTIVE, |phase| 5.0 + libm::sin(phase), (1.0, 0.0));
        assert!(error < 1e-12, "{error}");
    }

    #[test]
    fn the_demodulator_finds_the_fundamental_but_ripples() {
        let error = ripple(Kind::Demodulator, with_third_harmonic, (2.0, 0.7));
        assert!((1e-2..0.2).contains(&error), "{error}");
    }

    #[test]
    fn a_clean_sine_is_coherent_and_silence_is_not() {
        let detector = Detector::new(ADAPTIVE, 0.1, 0.06);
        let mut estimate = Estimate::default();
        assert_eq!(estimate.coherence(), 0.0);
        let mut oscillator = Oscillator::default();
        for _ in 0..5_000 {
            let rotor = oscillator.rotor();
            detector.update(&mut estimate, rotor.im, rotor);
            oscillator.advance(1.0, 0.06);
        }
        assert!(estimate.coherence() > 1.0 - 1e-12);
        assert!((estimate.amplitude() - 1.0).abs() < 1e-9);
    }
}
