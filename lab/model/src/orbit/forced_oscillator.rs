//! The oscillator under the harmonic base motion: its steady response and the derivatives of that.

use nalgebra::{Complex, Vector2};

use super::oscillator::Oscillator;
use crate::Dimensionless;

/// The oscillator at one frequency and excitation.
#[derive(Debug, Clone, Copy)]
pub(super) struct ForcedOscillator {
    pub(super) free: Oscillator,
    pub(super) zeta: f64,
    pub(super) omega: f64,
    epsilon: f64,
    g: f64,
    /// Harmonic response of q1 to the base, per G, and its derivative by Omega.
    unit: [Complex<f64>; 2],
}

impl ForcedOscillator {
    /// The oscillator of `scene` (except its G) at the frequency `omega` over omega0 and the excitation `g`.
    pub(super) fn new(scene: &Dimensionless, omega: f64, g: f64) -> Self {
        let zeta = scene.epsilon * scene.lambda / 2.0;
        let free = Oscillator::new(zeta);
        let (force, compliance) = (free.base_force(omega), free.compliance(omega));
        let unit = force * compliance * scene.epsilon;
        let stiffness_by = Complex::new(-2.0 * omega, 2.0 * zeta);
        let unit_by = (Complex::new(0.0, 2.0 * zeta) * scene.epsilon - unit * stiffness_by) * compliance;
        Self {
            free,
            zeta,
            omega,
            epsilon: scene.epsilon,
            g,
            unit: [unit, unit_by],
        }
    }

    /// Bound of the acceleration of the steady response.
    pub(super) fn acceleration(&self) -> f64 {
        if self.g == 0.0 {
            0.0
        } else {
            (self.unit[0] * self.g).norm() * self.omega * self.omega
        }
    }

    /// Force of the base on the primary mass.
    pub(super) fn force(&self, phase: f64) -> f64 {
        let amplitude = self.free.base_force(self.omega) * (self.epsilon * self.g);
        (amplitude * Complex::from_polar(1.0, phase)).im
    }

    /// Harmonic response (q, q') at a phase of the base.
    pub(super) fn harmonic(&self, phase: f64) -> Vector2<f64> {
        let z = self.turned(self.unit[0] * self.g, phase);
        Vector2::new(z.im, self.omega * z.re)
    }

    pub(super) fn by_phase(&self, phase: f64) -> Vector2<f64> {
        let z = self.turned(self.unit[0] * self.g, phase);
        Vector2::new(z.re, -self.omega * z.im)
    }

    pub(super) fn by_omega(&self, phase: f64) -> Vector2<f64> {
        let z = self.turned(self.unit[0] * self.g, phase);
        let slope = self.turned(self.unit[1] * self.g, phase);
        Vector2::new(slope.im, z.re + self.omega * slope.re)
    }

    pub(super) fn by_g(&self, phase: f64) -> Vector2<f64> {
        let z = self.turned(self.unit[0], phase);
        Vector2::new(z.im, self.omega * z.re)
    }

    /// Without excitation the response is zero, even at an undamped resonance.
    fn turned(&self, z: Complex<f64>, phase: f64) -> Complex<f64> {
        if z.is_nan() && self.g == 0.0 {
            return Complex::new(0.0, 0.0);
        }
        z * Complex::from_polar(1.0, phase)
    }
}
