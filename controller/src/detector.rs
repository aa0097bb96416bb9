//! The phase detector of one channel.

use crate::angle::Complex;
use crate::config::{Config, Detector};
use crate::harmonics::{Coefficients, Harmonics, MAX_HARMONICS, Rotors};
use crate::real::{self, Real};

/// Coefficients of a phase detector. Both methods are of first order and have the same bandwidth.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum PhaseDetector {
    Adaptive(Harmonics),
    Demodulator { step: Real },
}

/// Estimate of the signal of one channel.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Estimate {
    /// m, relative to the oscillator's phase. The demodulator estimates only the fundamental.
    coefficients: Coefficients,
    /// Mean square of the residual, m².
    residual_power: Real,
    /// Amplitude of the fundamental, m: many need it, and it takes a root.
    amplitude: Real,
}

impl Estimate {
    /// Coefficient of the fundamental, m, relative to the oscillator's phase: the signal contains `Re(c exp(i phase))`.
    pub fn fundamental(&self) -> Complex {
        self.coefficients.harmonic[0]
    }

    /// Sum of the amplitudes of the harmonics above the fundamental, m.
    pub fn harmonics(&self) -> Real {
        self.coefficients.harmonic[1..].iter().map(|one| one.magnitude()).sum()
    }

    /// Whether the sum of the amplitudes of the harmonics above the fundamental is at most this, m; the first `count` harmonics are used.
    pub fn harmonics_within(&self, limit: Real, count: usize) -> bool {
        let used = self.coefficients.harmonic.iter().take(count).skip(1);
        let bound: Real = used.map(|one| one.re.abs() + one.im.abs()).sum();
        // The bound without roots decides almost always.
        bound <= limit || self.harmonics() <= limit
    }

    /// Amplitude of the fundamental, m.
    pub fn amplitude(&self) -> Real {
        self.amplitude
    }

    /// Mean square of the residual, m².
    pub fn residual_power(&self) -> Real {
        self.residual_power
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
        let power = 0.5 * self.amplitude() * self.amplitude();
        (power, power + self.residual_power)
    }
}

impl PhaseDetector {
    /// The detector of a configuration.
    pub fn new(config: &Config) -> Self {
        let step = -real::expm1(-config.bandwidth * config.sample_time);
        match config.detector {
            Detector::Adaptive => Self::Adaptive(Harmonics {
                count: config.harmonics.into(),
                odd_only: config.odd_only,
                step,
            }),
            Detector::Demodulator => Self::Demodulator { step },
        }
    }

    /// Number of coefficients that one sample updates.
    pub fn coefficients(&self) -> usize {
        match self {
            Self::Adaptive(harmonics) => harmonics.coefficients(),
            Self::Demodulator { .. } => 1,
        }
    }

    /// Sum of the steps of all coefficients: the share of the residual that one update removes, at most 1.
    pub fn total_step(&self) -> Real {
        match self {
            Self::Adaptive(harmonics) => harmonics.total_step(),
            Self::Demodulator { step } => *step,
        }
    }

    /// Order of the highest harmonic that the sampling must resolve.
    pub fn highest_harmonic(&self) -> usize {
        match self {
            Self::Adaptive(harmonics) => harmonics.highest(),
            Self::Demodulator { .. } => 2,
        }
    }

    /// The rotors of a sample, for all channels; `rotor` is `exp(i phase)` of the oscillator.
    pub fn rotors(&self, rotor: Complex) -> Rotors {
        match self {
            Self::Adaptive(harmonics) => harmonics.rotors(rotor),
            Self::Demodulator { .. } => [rotor; MAX_HARMONICS],
        }
    }

    /// Updates the estimate with a sample, m. Returns the difference between the sample and its prediction, m.
    pub fn update(&self, estimate: &mut Estimate, sample: Real, rotors: &Rotors) -> Real {
        let (residual, step) = match self {
            Self::Adaptive(harmonics) => {
                let residual = harmonics.update(&mut estimate.coefficients, sample, rotors);
                (residual, harmonics.step)
            }
            Self::Demodulator { step } => {
                let (low_pass, rotor) = (&mut estimate.coefficients.harmonic[0], rotors[0]);
                let residual = sample - (low_pass.re * rotor.re - low_pass.im * rotor.im);
                low_pass.re += step * (2.0 * sample * rotor.re - low_pass.re);
                low_pass.im -= step * (2.0 * sample * rotor.im + low_pass.im);
                (residual, *step)
            }
        };
        estimate.residual_power += step * (residual * residual - estimate.residual_power);
        estimate.amplitude = estimate.fundamental().magnitude();
        residual
    }
}

#[cfg(all(test, not(feature = "f32")))]
mod tests {
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
                let (amplitude, phase) = (estimate.amplitude(), Complex { re: -im, im: re }.argument());
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
        assert!((estimate.amplitude() - 1.0).abs() < 1e-9);
    }
}
