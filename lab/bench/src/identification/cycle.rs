//! Harmonics of one period of the drive.

use std::f64::consts::TAU;

use nalgebra::{Complex, DVector};
use vines_model::numerics::{HarmonicBasis, mean};

use crate::record::{Sample, drive_phases};

/// Harmonics of the sensor signals over one period of the drive.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cycle {
    /// Mean time, s.
    pub time: f64,
    /// Mean phase of the drive, rad, counted on from period to period.
    pub drive_phase: f64,
    /// Mean frequency of the drive, rad/s.
    pub omega: f64,
    /// Fundamental of the commanded base motion, m, without noise; and its change over half the period.
    pub commanded: [Complex<f64>; 2],
    /// Fundamental of the response relative to the drive's phase, m: `Im a exp(i phase)`.
    pub response: Complex<f64>,
    /// Fundamental of the base, m: measured if a sensor reads it, otherwise commanded.
    pub base: Complex<f64>,
    /// Phase error, rad: response minus base minus target.
    pub phase_error: f64,
    /// Variances of the fundamental of response and base by the noise of the sensors, m²: of each of its two components.
    pub noise: [f64; 2],
    /// Number of samples.
    pub samples: usize,
    /// Their duration, s.
    pub duration: f64,
}

/// Offset, sine and cosine of three harmonics, and the drift of the first.
const TERMS: usize = 9;

impl Cycle {
    /// The samples of one period; `phase` (rad) is that of the drive at the first, `target` (rad) that of the response to the
    /// base. `None` for too few samples.
    #[must_use]
    pub fn of(samples: &[Sample], sample_time: f64, phase: f64, target: f64) -> Option<Self> {
        if samples.len() <= TERMS {
            return None;
        }
        let phases = drive_phases(samples, sample_time, phase);
        let mean_omega = mean(samples.iter().map(|s| s.command.drive.omega));
        let drive_phase = mean(phases.iter().copied());
        // The response does not follow every change of the drive's frequency: its phase is that of a uniform motion.
        let middle = 0.5 * (samples.len() - 1) as f64;
        let uniform: Vec<f64> = (0..samples.len())
            .map(|n| drive_phase + (n as f64 - middle) * sample_time * mean_omega)
            .collect();
        let basis = HarmonicBasis::new(&uniform, 0, &[Some(0); 3]);
        // A change of the amplitude within the period is not noise.
        let drifting = HarmonicBasis::new(&uniform, 0, &[Some(1), Some(0), Some(0)]);
        let degrees = (samples.len() - TERMS) as f64;
        let fitted = |value: fn(&Sample) -> f64| {
            let values = DVector::from_iterator(samples.len(), samples.iter().map(value));
            let fit = basis.fit(&values)?;
            let residual = drifting.residual(&values, &drifting.fit(&values)?);
            let variance = residual.norm_squared() / degrees;
            Some((fit.harmonic(1), variance * 2.0 / samples.len() as f64))
        };
        let (response, noise) = fitted(|s| s.sensors.response)?;
        let mean = |value: fn(&Sample) -> f64| mean(samples.iter().map(value));
        // The amplitude commanded at a sample begins there; a sensor reads what the one before left.
        let before = |n: usize| samples[n.saturating_sub(1)].command.drive.amplitude;
        let motion =
            |amplitude: &dyn Fn(usize) -> f64| DVector::from_fn(samples.len(), |n, _| amplitude(n) * phases[n].sin());
        let commanded = drifting.fit(&motion(&|n| 0.5 * (before(n) + samples[n].command.drive.amplitude)))?;
        let as_read = basis.fit(&motion(&before))?.harmonic(1);
        let measured = samples.iter().all(|s| s.sensors.reference.is_some());
        let (base, base_noise) = if measured {
            let (base, noise) = fitted(|s| s.sensors.reference.unwrap_or(0.0))?;
            (base * commanded.harmonic(1) / as_read, noise)
        } else {
            (Complex::new(mean(|s| s.command.drive.amplitude), 0.0), 0.0)
        };
        let phase_error = if measured {
            (response * base.conj() * Complex::from_polar(1.0, -target)).arg()
        } else {
            // The controller compensates the delay.
            mean(|s| s.command.phase_error.unwrap_or(0.0))
        };
        Some(Self {
            commanded: [commanded.harmonic(1), commanded.drift(1)],
            time: mean(|s| s.time),
            drive_phase,
            omega: mean_omega,
            response,
            base,
            phase_error,
            noise: [noise, base_noise],
            samples: samples.len(),
            duration: samples.len() as f64 * sample_time,
        })
    }

    /// The complete periods of the drive in these samples, in order.
    #[must_use]
    pub fn all(samples: &[Sample], sample_time: f64, target: f64) -> Vec<Self> {
        let (mut cycles, mut begin, mut turns, mut phase) = (Vec::new(), 0, 0.0, 0.0);
        for (n, sample) in samples.iter().enumerate() {
            turns += sample.command.drive.omega * sample_time / TAU;
            if turns >= f64::floor(phase) + 1.0 {
                cycles.extend(Self::of(&samples[begin..=n], sample_time, phase * TAU, target));
                (begin, phase) = (n + 1, turns);
            }
        }
        cycles
    }

    /// Amplitude of the response, m.
    #[must_use]
    pub fn amplitude(&self) -> f64 {
        self.response.norm()
    }
}
