//! What counts as resonance: the definition of the backbone, the reference of the phase, and the sensor of the response.

use serde::{Deserialize, Serialize};

/// How resonance is defined, and what is measured. The default is the definition of the study.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Definition {
    /// What singles out the motions of the backbone.
    #[serde(rename = "definition")]
    pub resonance: Resonance,
    /// What the phase refers to.
    pub reference: Reference,
    /// What is measured of the response.
    pub sensor: Sensor,
}

/// What singles out the motions of the backbone.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Resonance {
    /// The first harmonic of the response lags the reference by a quarter of a period.
    #[default]
    Phase,
    /// Its amplitude is largest along the frequency response at constant G.
    Peak,
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
    /// All definitions that differ: at the peak, the reference does not matter.
    pub fn all() -> Vec<Self> {
        let sensors = [Sensor::V, Sensor::Q1, Sensor::Acceleration];
        let cases = [
            (Resonance::Phase, Reference::Base),
            (Resonance::Phase, Reference::Force),
            (Resonance::Peak, Reference::Base),
        ];
        let with = |(resonance, reference)| sensors.map(|sensor| Self { resonance, reference, sensor });
        cases.into_iter().flat_map(with).collect()
    }

    /// Whether resonance is the peak of the response. Without the feature `peak` nothing that finds the peak is compiled.
    ///
    /// # Panics
    /// For a peak without the feature.
    pub fn is_peak(&self) -> bool {
        let peak = self.resonance == Resonance::Peak;
        assert!(
            !peak || cfg!(feature = "peak"),
            "the peak of the response needs the feature `peak`"
        );
        peak && cfg!(feature = "peak")
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
        let sensor = self.sensor.name();
        match self.resonance {
            Resonance::Peak => format!("peak of {sensor}"),
            Resonance::Phase => format!("phase of {sensor} to {}", self.reference.name()),
        }
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
