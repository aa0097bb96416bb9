//! The adaptive harmonic filter.

use crate::angle::Complex;

/// Most harmonics an adaptive filter follows.
pub const MAX_HARMONICS: usize = 8;

/// Which harmonics to follow, and how fast.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Harmonics {
    /// How many, the fundamental included.
    pub count: usize,
    /// 1, 3, 5, … instead of 1, 2, 3, …
    pub odd_only: bool,
    /// Step of the adaptation, per sample: the coefficient's distance from the truth shrinks by this fraction.
    pub step: f64,
}

/// A constant and Fourier coefficients relative to the oscillator's phase: the signal is
/// `offset + Σ Re(c_h exp(i h phase))`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Coefficients {
    offset: f64,
    /// The first is the fundamental's.
    pub harmonic: [Complex; MAX_HARMONICS],
}

impl Harmonics {
    /// Order of the highest harmonic.
    pub fn highest(&self) -> usize {
        if self.odd_only {
            2 * self.count - 1
        } else {
            self.count
        }
    }

    /// Sum of the steps of all coefficients; the filter is stable below 2 and well behaved below 1.
    pub fn total_step(&self) -> f64 {
        self.step * (2 * self.count + 1) as f64
    }

    /// Takes a sample at the oscillator's phase (`rotor = exp(i phase)`) and returns what the filter left unexplained.
    ///
    /// Least mean squares (LMS): every coefficient moves down the gradient of the squared residual. Since all
    /// harmonics and the offset share one residual, what belongs to one does not ripple through the others.
    pub fn update(&self, c: &mut Coefficients, sample: f64, rotor: Complex) -> f64 {
        let stride = if self.odd_only {
            rotor.times(rotor)
        } else {
            rotor
        };
        let mut rotors = [Complex::default(); MAX_HARMONICS];
        let mut next = rotor;
        let mut estimate = c.offset;
        for (harmonic, kept) in c.harmonic.iter().zip(&mut rotors).take(self.count) {
            *kept = next;
            estimate += harmonic.re * next.re - harmonic.im * next.im;
            next = next.times(stride);
        }
        let residual = sample - estimate;
        c.offset += self.step * residual;
        let gain = 2.0 * self.step * residual;
        for (harmonic, rotor) in c.harmonic.iter_mut().zip(&rotors).take(self.count) {
            harmonic.re += gain * rotor.re;
            harmonic.im -= gain * rotor.im;
        }
        residual
    }
}
