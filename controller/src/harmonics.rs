//! The adaptive harmonic filter.

use crate::angle::Complex;
use crate::real::Real;

/// Largest number of harmonics of the adaptive filter.
pub const MAX_HARMONICS: usize = 8;

/// Rotors of the harmonics in a sample. The first entry belongs to the fundamental.
pub type Rotors = [Complex; MAX_HARMONICS];

/// Coefficients of the adaptive filter.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Harmonics {
    /// Number of harmonics, including the fundamental.
    pub count: usize,
    /// Whether the harmonics are 1, 3, 5, … instead of 1, 2, 3, ….
    pub odd_only: bool,
    /// Adaptation step: fraction by which the error of a coefficient decreases per sample.
    pub step: Real,
}

/// A constant and Fourier coefficients relative to the oscillator's phase: the signal is
/// `offset + Σ Re(c_h exp(i h phase))`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Coefficients {
    offset: Real,
    /// The first entry belongs to the fundamental.
    pub harmonic: [Complex; MAX_HARMONICS],
}

impl Harmonics {
    /// Order of the highest harmonic.
    pub fn highest(&self) -> usize {
        if self.odd_only { 2 * self.count - 1 } else { self.count }
    }

    /// Number of coefficients: the offset, and two per harmonic.
    pub fn coefficients(&self) -> usize {
        2 * self.count + 1
    }

    /// Sum of the steps of all coefficients. The filter is stable below 2; below 1 it converges without oscillation.
    pub fn total_step(&self) -> Real {
        self.step * self.coefficients() as Real
    }

    /// `exp(i h phase)` of every harmonic `h`; `rotor` is `exp(i phase)` of the oscillator.
    pub fn rotors(&self, rotor: Complex) -> Rotors {
        let stride = if self.odd_only { rotor.times(rotor) } else { rotor };
        let (mut rotors, mut next) = ([rotor; MAX_HARMONICS], rotor);
        for kept in rotors.iter_mut().take(self.count) {
            *kept = next;
            next = next.times(stride);
        }
        rotors
    }

    /// Updates the coefficients with a sample. Returns the residual.
    ///
    /// Least mean squares (LMS): every coefficient moves down the gradient of the squared residual. All harmonics and the
    /// offset share one residual, so that no component causes ripple in another.
    pub fn update(&self, c: &mut Coefficients, sample: Real, rotors: &Rotors) -> Real {
        let mut estimate = c.offset;
        for (harmonic, rotor) in c.harmonic.iter().zip(rotors).take(self.count) {
            estimate += harmonic.re * rotor.re - harmonic.im * rotor.im;
        }
        let residual = sample - estimate;
        c.offset += self.step * residual;
        let gain = 2.0 * self.step * residual;
        for (harmonic, rotor) in c.harmonic.iter_mut().zip(rotors).take(self.count) {
            harmonic.re += gain * rotor.re;
            harmonic.im -= gain * rotor.im;
        }
        residual
    }
}
