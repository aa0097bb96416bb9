//! The study's oscillator as a section of a host, under the harmonic base.

use lovines::Section;
use lovines::oscillator::Oscillator;
use nalgebra::{Complex, Vector2};

use crate::Dimensionless;

/// The study's oscillator on its base, dimensionless: mass and natural frequency are 1, and `damping` is `2 zeta = epsilon lambda`.
pub(crate) fn section(damping: f64) -> Section {
    Section {
        oscillator: Oscillator::new(1.0, 1.0, damping),
        drive: [1.0, damping],
        kick: [0.0, 1.0],
        cavity: [1.0, 0.0],
    }
}

/// The oscillator at one frequency and excitation.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ForcedOscillator {
    pub(super) free: Section,
    pub(super) omega: f64,
    epsilon: f64,
    pub(super) g: f64,
    /// Harmonic response of q1 to the base, per G, and its derivative by Omega.
    pub(super) unit: [Complex<f64>; 2],
}

impl ForcedOscillator {
    /// The oscillator of `scene` (except its G) at the frequency `omega` over omega0 and the excitation `g`.
    pub(crate) fn new(scene: &Dimensionless, omega: f64, g: f64) -> Self {
        let free = section(scene.epsilon * scene.lambda);
        let compliance = free.stiffness(omega).inv();
        let unit = free.driven(omega)[0] * compliance * scene.epsilon;
        let stiffness_by = Complex::new(-2.0 * omega, 2.0 * free.oscillator.delta);
        let unit_by = (Complex::new(0.0, free.drive[1]) * scene.epsilon - unit * stiffness_by) * compliance;
        Self {
            free,
            omega,
            epsilon: scene.epsilon,
            g,
            unit: [unit, unit_by],
        }
    }

    /// Force of the base on the primary mass.
    pub(super) fn force(&self, phase: f64) -> f64 {
        let amplitude = self.free.driven(self.omega)[0] * (self.epsilon * self.g);
        (amplitude * Complex::from_polar(1.0, phase)).im
    }

    /// Harmonic of q1 from a phase of the base on.
    pub(crate) fn response(&self, phase: f64) -> Complex<f64> {
        self.driven(self.unit[0] * self.g) * Complex::from_polar(1.0, phase)
    }

    /// Harmonic response (q, q') at a phase of the base.
    pub(crate) fn harmonic(&self, phase: f64) -> Vector2<f64> {
        let z = self.response(phase);
        Vector2::new(z.im, self.omega * z.re)
    }

    /// Derivatives of the harmonic response by phase, Omega and G.
    pub(super) fn derivatives(&self, phase: f64) -> [Vector2<f64>; 3] {
        let [unit, unit_by] = self.unit;
        let turned = [unit * self.g, unit_by * self.g, unit].map(|z| self.driven(z) * Complex::from_polar(1.0, phase));
        let [z, slope, per_g] = turned;
        [
            Vector2::new(z.re, -self.omega * z.im),
            Vector2::new(slope.im, z.re + self.omega * slope.re),
            Vector2::new(per_g.im, self.omega * per_g.re),
        ]
    }

    /// A response to the base: without excitation it is zero, even at an undamped resonance.
    pub(super) fn driven(&self, z: Complex<f64>) -> Complex<f64> {
        if z.is_nan() && self.g == 0.0 {
            return Complex::new(0.0, 0.0);
        }
        z
    }
}
