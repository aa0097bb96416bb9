//! The linear response of a rig, without impacts.

use num_complex::Complex64;

use super::Scene;

/// Frequency response without impacts, near its resonance: response over base `gain/(damping_rate + i (omega - omega0))`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LinearResponse {
    /// Natural frequency, rad/s.
    pub omega0: f64,
    /// Damping rate, rad/s.
    pub damping_rate: f64,
    /// Standard uncertainty of natural frequency and damping rate, rad/s.
    pub uncertainty: f64,
    /// Growth rate of the response at resonance per amplitude of the base, 1/s, with its phase relative to the base.
    pub gain: Complex64,
}

impl LinearResponse {
    /// That of the plant of a scene.
    pub fn of(scene: &Scene) -> Self {
        let omega0 = scene.dimensionless().omega0;
        Self {
            omega0,
            damping_rate: 0.5 * scene.plant.damping / scene.plant.primary_mass,
            uncertainty: 0.0,
            gain: Complex64::new(0.0, -0.5 * omega0),
        }
    }

    /// Response over base at the frequency `omega`, rad/s.
    pub fn at(&self, omega: f64) -> Complex64 {
        self.gain / Complex64::new(self.damping_rate, omega - self.omega0)
    }
}
