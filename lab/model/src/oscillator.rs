//! The study's oscillator as a section of a host, under the harmonic base.

use lovines::Section;
use lovines::oscillator::Oscillator;
use nalgebra::Complex;

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

/// Harmonic response of q1 to the base of a scene at the frequency `omega` over omega0.
pub(crate) fn response(scene: &Dimensionless, omega: f64) -> Complex<f64> {
    let free = section(scene.epsilon * scene.lambda);
    // Without excitation there is no response, even at an undamped resonance.
    if scene.g == 0.0 {
        return Complex::ZERO;
    }
    free.driven(omega)[0] * free.stiffness(omega).inv() * (scene.epsilon * scene.g)
}
