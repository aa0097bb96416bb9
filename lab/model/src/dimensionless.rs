//! The dimensionless numbers of a scene.

use lovines::{Drive, InvalidValue, Parameters, Plant, State};
use serde::Serialize;

use crate::Definition;

/// The parameters of the dimensionless model, and the units of length and frequency.
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
    /// What counts as resonance, and what is measured.
    pub definition: Definition,
}

impl Dimensionless {
    /// The bare dimensionless model, with `omega0 = 1` and `b = 1`.
    pub fn new(epsilon: f64, lambda: f64, r: f64, g: f64) -> Self {
        let definition = Definition::default();
        Self { epsilon, lambda, r, g, omega0: 1.0, b: 1.0, definition }
    }

    /// The numbers of a plant in SI units whose base moves with the amplitude `amplitude`, m.
    pub fn of(plant: &Parameters, amplitude: f64) -> Self {
        let (omega0, b) = (plant.natural_frequency(), plant.half_width);
        let lambda = plant.damping / (plant.particle_mass * omega0);
        let numbers = Self::new(plant.mass_ratio(), lambda, plant.restitution, 0.0);
        let numbers = Self { omega0, b, ..numbers };
        Self { g: numbers.excitation(amplitude), ..numbers }
    }

    /// Excitation `G = E/(b epsilon)` of the base amplitude `E`, m.
    pub fn excitation(&self, amplitude: f64) -> f64 {
        amplitude / (self.b * self.epsilon)
    }

    /// Base amplitude `E = G b epsilon`, m, of the excitation `g`.
    pub fn amplitude(&self, g: f64) -> f64 {
        g * self.b * self.epsilon
    }

    /// Velocity over `b omega0` of a velocity in m/s.
    pub fn speed(&self, velocity: f64) -> f64 {
        velocity / (self.b * self.omega0)
    }

    /// (q1, q1', q2, q2') of a state in SI units.
    pub fn state(&self, state: &State) -> [f64; 4] {
        let State { q1, dq1, q2, dq2 } = *state;
        [q1 / self.b, self.speed(dq1), q2 / self.b, self.speed(dq2)]
    }

    /// Natural period `2 pi/omega0`, s.
    pub fn natural_period(&self) -> f64 {
        std::f64::consts::TAU / self.omega0
    }

    /// Detuning `sigma = (Omega - 1)/epsilon` of the angular frequency `omega`, rad/s.
    pub fn sigma(&self, omega: f64) -> f64 {
        (omega / self.omega0 - 1.0) / self.epsilon
    }

    /// Angular frequency, rad/s, at the detuning `sigma`.
    pub fn omega(&self, sigma: f64) -> f64 {
        self.omega0 * (1.0 + self.epsilon * sigma)
    }

    /// Change of the angular frequency, rad/s, for a change of sigma.
    pub fn omega_change(&self, sigma: f64) -> f64 {
        sigma * self.epsilon * self.omega0
    }

    /// The drive of the dimensionless plant at the detuning `sigma`.
    pub fn drive(&self, sigma: f64) -> Drive {
        Drive::harmonic(self.epsilon * self.g, 1.0 + self.epsilon * sigma)
    }

    /// The plant of these numbers in dimensionless form, M = k = b = 1, at (q1, q1', q2, q2').
    pub fn plant(&self, state: [f64; 4]) -> Result<Plant, InvalidValue> {
        let parameters = Parameters::dimensionless(self.epsilon, self.lambda, self.r);
        Plant::new(parameters, state.into())
    }
}
