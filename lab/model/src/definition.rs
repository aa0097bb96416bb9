//! What counts as resonance: the first harmonic of a sensor's response lags a reference by a quarter of a period.

use serde::{Deserialize, Serialize};

/// Reference and sensor that define resonance. The default is the definition of the study.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Definition {
    /// What the phase refers to.
    pub reference: Reference,
    /// What is measured of the response.
    pub sensor: Sensor,
}

/// What the phase of the response refers to.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Reference {
    /// The base displacement e.
    #[default]
    Base,
    /// The force k e + c e' that the base exerts on the primary mass.
    Force,
}

/// What is measured of the response.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Sensor {
    /// `v = q1 + epsilon q2`, the centre of mass times 1 + epsilon.
    #[default]
    V,
    /// The displacement of the primary mass.
    Q1,
    /// The acceleration of the primary mass over omega0^2, with the sign of its displacement: `-q1''`.
    Acceleration,
}

impl Definition {
    /// All definitions.
    pub fn all() -> Vec<Self> {
        let sensors = [Sensor::V, Sensor::Q1, Sensor::Acceleration];
        let with = |reference| sensors.map(|sensor| Self { reference, sensor });
        [Reference::Base, Reference::Force].into_iter().flat_map(with).collect()
    }

    /// Whether the sensors need differences of samples, so that response and reference are read one sample late.
    pub fn is_late(&self) -> bool {
        self.sensor == Sensor::Acceleration || self.reference == Reference::Force
    }

    /// The channels, as a rig at a network address states them: 0, 1 and 2 for v, q1 and the acceleration, and 4 more for the force.
    pub fn channels(&self) -> u8 {
        self.sensor as u8 + 4 * self.reference as u8
    }

    /// The channels in words: response and reference.
    pub fn channel_names(&self) -> String {
        format!("{} and {}", self.sensor.name(), self.reference.name())
    }

    /// In words, as in a table.
    pub fn name(&self) -> String {
        format!("phase of {} to {}", self.sensor.name(), self.reference.name())
    }
}

impl Sensor {
    /// As in a table.
    pub fn name(&self) -> &'static str {
        match self {
            Sensor::V => "v",
            Sensor::Q1 => "q1",
            Sensor::Acceleration => "acceleration",
        }
    }
}

impl Reference {
    /// As in a table.
    pub fn name(&self) -> &'static str {
        match self {
            Reference::Base => "e",
            Reference::Force => "k e + c e'",
        }
    }

    /// Phase of the reference relative to the base, rad, at the frequency `omega` over omega0 and for `2 zeta = epsilon lambda`.
    pub(crate) fn phase(self, damping: f64, omega: f64) -> f64 {
        match self {
            Reference::Base => 0.0,
            Reference::Force => (damping * omega).atan(),
        }
    }

    /// Its derivative by omega.
    pub(crate) fn phase_slope(self, damping: f64, omega: f64) -> f64 {
        match self {
            Reference::Base => 0.0,
            Reference::Force => damping / (1.0 + (damping * omega).powi(2)),
        }
    }
}
