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

/// The oscillator under the base of a scene at one frequency.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ForcedOscillator {
    pub(crate) free: Section,
    omega: f64,
    /// Harmonic response of q1 to the base.
    response: Complex<f64>,
}

impl ForcedOscillator {
    /// The oscillator of `scene` at the frequency `omega` over omega0.
    pub(crate) fn new(scene: &Dimensionless, omega: f64) -> Self {
        let free = section(scene.epsilon * scene.lambda);
        // Without excitation there is no response, even at an undamped resonance.
        let response = if scene.g == 0.0 {
            Complex::ZERO
        } else {
            free.driven(omega)[0] * free.stiffness(omega).inv() * (scene.epsilon * scene.g)
        };
        Self { free, omega, response }
    }

    /// Harmonic of q1 from a phase of the base on.
    pub(crate) fn response(&self, phase: f64) -> Complex<f64> {
        self.response * Complex::from_polar(1.0, phase)
    }

    /// Harmonic response (q, q') at a phase of the base.
    pub(crate) fn harmonic(&self, phase: f64) -> Vector2<f64> {
        let z = self.response(phase);
        Vector2::new(z.im, self.omega * z.re)
    }
}
