//! The dimensionless numbers of a scene.

use lovines::{InvalidValue, Parameters, Plant, State};
use serde::Serialize;

/// What is left of a scene when lengths are measured in b and times in 1/omega0.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Dimensionless {
    /// Mass ratio `m/M`.
    pub epsilon: f64,
    /// Damping `c/(m omega0)`.
    pub lambda: f64,
    /// Restitution coefficient, in (0, 1].
    pub r: f64,
    /// Base amplitude `E/(b epsilon)`.
    #[serde(rename = "G")]
    pub g: f64,
    /// Natural frequency `sqrt(k/M)`, rad/s: the unit of frequency.
    pub omega0: f64,
    /// Half-width of the cavity, m: the unit of length.
    pub b: f64,
}

impl Dimensionless {
    /// The bare dimensionless model, with `omega0 = 1` and `b = 1`.
    #[must_use]
    pub fn new(epsilon: f64, lambda: f64, r: f64, g: f64) -> Self {
        Self {
            epsilon,
            lambda,
            r,
            g,
            omega0: 1.0,
            b: 1.0,
        }
    }

    /// Detuning `sigma = (Omega - 1)/epsilon` of the angular frequency `omega`, rad/s.
    #[must_use]
    pub fn sigma(&self, omega: f64) -> f64 {
        (omega / self.omega0 - 1.0) / self.epsilon
    }

    /// Angular frequency, rad/s, at the detuning `sigma`.
    #[must_use]
    pub fn omega(&self, sigma: f64) -> f64 {
        self.omega0 * (1.0 + self.epsilon * sigma)
    }

    /// The plant of these numbers in dimensionless form, M = k = b = 1, at (q1, q1', q2, q2').
    ///
    /// # Errors
    /// Parameters or a start that make no sense.
    pub fn plant(&self, [q1, dq1, q2, dq2]: [f64; 4]) -> Result<Plant, InvalidValue> {
        let parameters = Parameters {
            primary_mass: 1.0,
            stiffness: 1.0,
            damping: self.epsilon * self.lambda,
            particle_mass: self.epsilon,
            half_width: 1.0,
            restitution: self.r,
        };
        Plant::new(parameters, State { q1, dq1, q2, dq2 })
    }
}
