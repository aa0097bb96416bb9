//! Harmonics of one period of the drive.

use nalgebra::{Complex, DVector};
use vines_model::numerics::{HarmonicBasis, mean};

use crate::experiment::{Sample, drive_phases};

/// Harmonics of the sensor signals over one period of the drive.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cycle {
    /// Mean frequency of the drive, rad/s.
    pub omega: f64,
    /// Harmonics 1 to 3 of the response relative to the drive's phase, m: `Im Σ a_h exp(i h phase)`.
    pub response: [Complex<f64>; 3],
    /// Fundamental of the base, m: measured if a sensor reads it, otherwise commanded.
    pub base: Complex<f64>,
    /// Phase error, rad: response minus base minus target.
    pub phase_error: f64,
}

/// Offset, and sine and cosine of three harmonics.
const TERMS: usize = 7;

impl Cycle {
    /// The samples of one period; `phase` (rad) is that of the drive at the first, `target` (rad) that of the response to the
    /// base. `None` for too few samples.
    #[must_use]
    pub fn of(samples: &[Sample], sample_time: f64, phase: f64, target: f64) -> Option<Self> {
        if samples.len() <= TERMS {
            return None;
        }
        let phases = drive_phases(samples, sample_time, phase);
        let basis = HarmonicBasis::new(&phases, 0, &[Some(0); 3]);
        let fitted =
            |value: fn(&Sample) -> f64| basis.fit(&DVector::from_iterator(samples.len(), samples.iter().map(value)));
        let response = fitted(|s| s.sensors.response)?;
        let mean = |value: fn(&Sample) -> f64| mean(samples.iter().map(value));
        let measured = samples.iter().all(|s| s.sensors.reference.is_some());
        let base = if measured {
            fitted(|s| s.sensors.reference.unwrap_or(0.0))?.harmonic(1)
        } else {
            Complex::new(mean(|s| s.command.drive.amplitude), 0.0)
        };
        let response = [1, 2, 3].map(|n| response.harmonic(n));
        let phase_error = if measured {
            (response[0] * base.conj() * Complex::from_polar(1.0, -target)).arg()
        } else {
            // The controller compensates the delay.
            mean(|s| s.command.phase_error)
        };
        Some(Self {
            omega: mean(|s| s.command.drive.omega),
            response,
            base,
            phase_error,
        })
    }
}
