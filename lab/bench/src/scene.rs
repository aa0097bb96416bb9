//! Scenes: plant, excitation, controller, measurement chain and durations, read from TOML.

mod backbone;
mod chain;
mod configuration;
mod controller;
mod error;
mod family;
mod linear_response;
mod load;
mod names;
mod option;
mod overrides;
mod phase_lock;
mod plant;
mod record;
mod sections;
mod validate;

pub use lovines::Parameters;
use lovines::State;
use serde::Serialize;

pub use backbone::Backbone;
pub use chain::{Chain, RatioOf};
pub use controller::Controller;
pub use error::{SceneError, SyntaxError};
pub use family::Family;
pub use linear_response::LinearResponse;
pub use names::{Name, Names};
pub use overrides::Override;
pub use phase_lock::{KEYS, PhaseLock, key, refusal};
pub use record::Record;
pub use vines_model::{Definition, Dimensionless, Reference, Resonance, Sensor};

/// The default scene, embedded so that the program works from any folder.
pub const PAPER: &str = include_str!("../../../scenes/paper.toml");

/// A checked scene in SI units; build one with [`Scene::load`] or [`Scene::parse`].
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Scene {
    /// The oscillator and its particle, SI units.
    #[serde(serialize_with = "plant::serialize")]
    pub plant: Parameters,
    /// Where the motion starts, SI units.
    pub start: State,
    /// Amplitude E of the base displacement, m.
    pub amplitude: f64,
    /// The phase-locked loop, in units of omega0 and of the natural period.
    pub controller: Controller,
    /// Further parameters of the loop.
    pub phase_lock: PhaseLock,
    /// How long to drive and to record, in periods.
    pub record: Record,
    /// How the backbone is tracked, in units of b and in periods.
    pub backbone: Backbone,
    /// The measurement chain between rig and controller.
    pub chain: Chain,
    /// What counts as resonance, and what is measured.
    pub resonance: Definition,
    /// What a rig other than the simulated one calls its variables.
    #[serde(skip_serializing_if = "Names::is_empty")]
    pub rig_names: Names,
    /// What a controller other than the built-in one calls its variables.
    #[serde(skip_serializing_if = "Names::is_empty")]
    pub controller_names: Names,
    /// The linear response that the loop check has measured on the rig; not part of a file.
    #[serde(skip)]
    pub measured: Option<LinearResponse>,
}

impl Scene {
    /// The numbers that the dimensionless model, the theory and the exact orbits depend on. Natural frequency and damping are those that
    /// the loop check has measured, if it has run.
    pub fn dimensionless(&self) -> Dimensionless {
        let stated = Dimensionless {
            definition: self.resonance,
            ..Dimensionless::of(&self.plant, self.amplitude)
        };
        self.measured.map_or(stated, |measured| Dimensionless {
            omega0: measured.omega0,
            lambda: 2.0 * measured.damping_rate.max(0.0) / (stated.epsilon * measured.omega0),
            ..stated
        })
    }

    /// The linear response: as measured, otherwise that of the scene's plant.
    pub fn linear(&self) -> LinearResponse {
        self.measured.unwrap_or_else(|| LinearResponse::of(self))
    }

    /// Levels of the tracked backbone, amplitudes of the response, m, in the order in which they are visited.
    pub fn levels(&self) -> Vec<f64> {
        self.backbone.levels(self.plant.half_width)
    }

    /// The start (q1, q1', q2, q2'), displacements over b and velocities over `b omega0`.
    pub fn dimensionless_start(&self) -> [f64; 4] {
        self.dimensionless().state(&self.start)
    }

    /// The controller's sample time, s: rig and controller agree on it before anything is measured.
    pub fn sample_time(&self) -> f64 {
        Dimensionless::of(&self.plant, self.amplitude).natural_period() / self.controller.samples_per_period
    }
}
