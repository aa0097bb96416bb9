//! What counts as resonance: the first harmonic of a sensor's response lags a reference by a quarter of a period, or has another phase that is asked for.

use std::f64::consts::{FRAC_PI_2, PI};

use lovines::Excitation;
use serde::{Deserialize, Serialize};

/// Reference, sensor and phase that define resonance. The default is the definition of the study.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Definition {
    /// Phase of the response relative to the reference, both as displacements, rad: -pi/2 is phase resonance.
    #[serde(skip)]
    pub phase: f64,
    /// What the phase refers to.
    pub reference: Reference,
    /// The point whose displacement is the response.
    pub sensor: Sensor,
    /// What the sensor of the response measures of it.
    pub sensor_quantity: Measurand,
    /// What the sensor of the base measures of it.
    pub reference_quantity: Measurand,
}

impl Default for Definition {
    fn default() -> Self {
        Self {
            phase: -FRAC_PI_2,
            reference: Reference::default(),
            sensor: Sensor::default(),
            sensor_quantity: Measurand::default(),
            reference_quantity: Measurand::default(),
        }
    }
}

/// The quantity that a sensor of a motion measures. All results are displacements: a harmonic of the frequency w is divided by `(i w)^n`.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Measurand {
    /// A displacement, m.
    #[default]
    Displacement,
    /// Its first derivative, m/s.
    Velocity,
    /// Its second derivative, m/s².
    Acceleration,
}

impl Measurand {
    /// All of them, by their order.
    pub const ALL: [Self; 3] = [Self::Displacement, Self::Velocity, Self::Acceleration];

    /// How often a displacement is differentiated.
    pub fn order(self) -> i32 {
        self as i32
    }

    /// The SI unit.
    pub fn unit(self) -> &'static str {
        ["m", "m/s", "m/s²"][self as usize]
    }

    /// The SI unit as in an FMU.
    pub fn unit_in_ascii(self) -> &'static str {
        ["m", "m/s", "m/s2"][self as usize]
    }

    /// In words.
    pub fn name(self) -> &'static str {
        ["displacement", "velocity", "acceleration"][self as usize]
    }

    /// The measurand that has this SI unit.
    pub fn of_unit(unit: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|one| one.unit() == unit)
    }

    /// Phase by which a harmonic leads its displacement, rad.
    pub fn lead(self) -> f64 {
        f64::from(self.order()) * FRAC_PI_2
    }
}

/// What the phase of the response refers to, and what drives a structure.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Reference {
    /// The base displacement e.
    #[default]
    Base,
    /// The force k e + c e' that the base exerts on the primary mass, or a force at a point of a structure.
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
}

impl Definition {
    /// All definitions, by displacements.
    pub fn all() -> Vec<Self> {
        let with = |reference| [Sensor::V, Sensor::Q1].map(|sensor| Self { reference, sensor, ..Self::default() });
        [Reference::Base, Reference::Force].into_iter().flat_map(with).collect()
    }

    /// What the two channels measure: response and reference.
    pub fn measurands(&self) -> [Measurand; 2] {
        [self.sensor_quantity, self.reference_quantity]
    }

    /// Whether the sensors need differences of samples, so that response and reference are read one sample late.
    pub fn is_late(&self) -> bool {
        self.measurands() != [Measurand::Displacement; 2] || self.reference == Reference::Force
    }

    /// The channels, as a rig at a network address states them: 0 and 1 for v and q1, 4 more for the force, 8 more for each derivative of the
    /// response, and 32 more for each of the base.
    pub fn channels(&self) -> u8 {
        let Self { reference, sensor, sensor_quantity, reference_quantity, .. } = *self;
        sensor as u8 + 4 * reference as u8 + 8 * sensor_quantity as u8 + 32 * reference_quantity as u8
    }

    /// The definition with these [channels](Self::channels).
    pub fn of_channels(channels: u8) -> Option<Self> {
        let quantity = |bits: u8| Measurand::ALL.get(usize::from(bits & 3)).copied();
        let (sensor_quantity, reference_quantity) = (quantity(channels >> 3)?, quantity(channels >> 5)?);
        let of = |one: Self| Self { sensor_quantity, reference_quantity, ..one };
        Self::all().into_iter().map(of).find(|one| one.channels() == channels)
    }

    /// The channels in words: response and reference.
    pub fn channel_names(&self) -> String {
        let of = |measurand: Measurand, name: &str| match measurand {
            Measurand::Displacement => name.to_string(),
            other => format!("the {} of {name}", other.name()),
        };
        let [response, reference] = self.measurands();
        let response = of(response, self.sensor.name());
        format!("{response} and {}", of(reference, self.reference.name()))
    }

    /// In words, as in a table.
    pub fn name(&self) -> String {
        let of = format!("phase of {} to {}", self.sensor.name(), self.reference.name());
        match self.is_phase_resonance() {
            true => of,
            false => format!("{of}, {} degrees", self.phase_in_degrees()),
        }
    }

    /// The phase in degrees, without the rounding of the conversion.
    pub fn phase_in_degrees(&self) -> f64 {
        (1e9 * self.phase.to_degrees()).round() / 1e9
    }

    /// Whether the response lags the reference by a quarter of a period.
    pub fn is_phase_resonance(&self) -> bool {
        self.phase == -FRAC_PI_2
    }

    /// The same channels at another phase, rad.
    #[must_use]
    pub fn at_phase(self, phase: f64) -> Self {
        Self { phase, ..self }
    }

    /// Phase beyond phase resonance, rad, from -pi/2 to pi/2. A channel with the opposite sign turns it by pi, which leaves the motion as it is.
    pub fn off_resonance(&self) -> f64 {
        let off = self.phase + FRAC_PI_2;
        off - PI * (off / PI).round()
    }
}

impl Sensor {
    /// As in a table.
    pub fn name(&self) -> &'static str {
        match self {
            Sensor::V => "v",
            Sensor::Q1 => "q1",
        }
    }
}

impl Reference {
    /// As in a table.
    pub fn name(&self) -> &'static str {
        match self {
            Reference::Base => "e",
            Reference::Force => "the force",
        }
    }

    /// SI unit of a displacement of the base, or of a force.
    pub fn unit(self) -> &'static str {
        match self {
            Reference::Base => "m",
            Reference::Force => "N",
        }
    }

    /// What drives the host of a plant with this reference.
    pub fn excitation(self) -> Excitation {
        match self {
            Reference::Base => Excitation::Base,
            Reference::Force => Excitation::Force,
        }
    }

    /// Amplitude of the reference, a force as its static displacement, over that of the base that makes it at omega0; `damping`: 2 zeta.
    pub fn per_base(self, damping: f64) -> f64 {
        match self {
            Reference::Base => 1.0,
            Reference::Force => 1.0_f64.hypot(damping),
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
