//! Scenes: plant, excitation, controller, measurement chain and durations, read from TOML.

/// The keys of a section, each with its default.
macro_rules! settings {
    (
        $(#[$about:meta])*
        pub struct $name:ident { $($(#[$meaning:meta])* $key:ident: $type:ty = $default:expr,)* }
    ) => {
        $(#[$about])*
        #[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
        #[serde(deny_unknown_fields, default)]
        pub struct $name {
            $($(#[$meaning])* pub $key: $type,)*
        }

        impl Default for $name {
            fn default() -> Self {
                Self { $($key: $default,)* }
            }
        }
    };
}

mod chain;
mod checks;
mod controller;
mod error;
mod implausible;
mod orbits;
mod overrides;
mod plant;
mod record;
mod shaker;
mod structure;
pub mod table;

use std::f64::consts::{PI, TAU};
use std::path::Path;

use error::plain;
use lovines::{Cavity, Restitution, State};
use plant::{ExcitationSection, PlantSection, StartSection, given};
use serde::de::Error;
use serde::{Deserialize, Deserializer, Serialize};
use shaker::ShakerSection;
use structure::StructureSection;
use toml::{Table, Value};

use crate::knowledge::{Knowledge, Target, carried_up_to, has_friction};
use crate::linear::LinearResponse;
use crate::shaker_path::ShakerPath;

pub use crate::units::{Unit, Units};
pub use chain::ChainSettings;
pub use controller::{ControllerSettings, KEYS, PhaseLock, key, phase_target, refusal};
pub use error::SceneError;
pub use implausible::Implausible;
pub use lovines::{Parameters, table::PARAMETERS as PLANT_PARAMETERS};
pub use overrides::{Family, Override};
pub use plant::plant_keys;
pub use record::{BackboneSettings, RecordSettings};
pub use shaker::{ARMATURE, Channel, Limits, Release, SceneShaker, TABLE};
pub use shaker::{PLACES, frequencies};
pub use structure::{Structure, StructureMode};
pub use vines_model::{Definition, Dimensionless, Measurand, Reference, Sensor};
pub use vines_rig::{Name, Names};

/// The default scene, embedded so that the program works from any folder.
pub const PAPER: &str = include_str!("../paper.toml");

/// Largest number of times the default samples that a scene takes by itself, a limit of run time: a backbone then takes about a minute.
const OVERSAMPLED: f64 = 16.0;

/// A checked scene in SI units; build one with [`Scene::load`] or [`Scene::parse`].
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Scene {
    /// The oscillator and its particle, SI units; with a structure, the oscillator of its driven mode as the cavity has it: M = 1/phi².
    #[serde(serialize_with = "plant::serialize")]
    pub plant: Parameters,
    /// The structure that takes the oscillator's place.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub structure: Option<Structure>,
    /// Where the motion starts, SI units.
    pub start: State,
    /// Amplitude E of the base displacement, m; with a structure, of a base that moves the driven mode's oscillator alike.
    pub amplitude: f64,
    /// The phase-locked loop, in units of omega0 and of the natural period.
    pub controller: ControllerSettings,
    /// Further parameters of the loop.
    pub phase_lock: PhaseLock,
    /// How long to drive and to record, in periods.
    pub record: RecordSettings,
    /// How the backbone is tracked, in units of b and in periods.
    pub backbone: BackboneSettings,
    /// The measurement chain between rig and controller.
    pub chain: ChainSettings,
    /// What counts as resonance, and what is measured.
    pub resonance: Definition,
    /// Whether the user says what the sensor of the response reads, v or q1: the default scene does not say it of a rig that exists.
    #[serde(skip)]
    pub states_sensor: bool,
    /// What a rig other than the simulated one calls its variables.
    #[serde(skip_serializing_if = "Names::is_empty")]
    pub rig_names: Names,
    /// What a controller other than the built-in one calls its variables.
    #[serde(skip_serializing_if = "Names::is_empty")]
    pub controller_names: Names,
}

impl Scene {
    /// Whether response and reference are read one sample late, because a sensor needs differences of samples.
    pub fn is_late(&self) -> bool {
        self.resonance.is_late() || self.structure.as_ref().is_some_and(|one| one.compensated_mass() > 0.0)
    }

    /// The numbers that the dimensionless model, the theory and the exact orbits depend on.
    pub fn dimensionless(&self) -> Dimensionless {
        let numbers = Dimensionless::of(&self.plant, self.amplitude);
        Dimensionless { definition: self.definition(), ..numbers }
    }

    /// What counts as resonance of the oscillator or the driven mode, at the phase target of the controller. A force on a structure is what spring and damper of the oscillator pass on; its
    /// sensors are those of [`Scene::resonance`].
    pub fn definition(&self) -> Definition {
        let structure = self.structure.as_ref();
        let reference = structure.map_or(self.resonance.reference, |one| one.excitation);
        let phase = self.controller.phase_target.to_radians();
        Definition { reference, phase, ..self.resonance }
    }

    /// The units of the channels of its rig.
    pub fn units(&self) -> Units {
        self.structure.as_ref().map_or(Units::OSCILLATOR, Structure::units)
    }

    /// Its structure, and the shaker that moves it.
    pub fn shaken(&self) -> Option<(&Structure, &SceneShaker)> {
        let structure = self.structure.as_ref()?;
        Some((structure, structure.shaker.as_ref()?))
    }

    /// The start (q1, q1', q2, q2'), displacements over b and velocities over `b omega0`.
    pub fn dimensionless_start(&self) -> [f64; 4] {
        self.dimensionless().state(&self.start)
    }

    /// What theory, exact orbits of one oscillator and regime maps leave out of the scene, as a list; `None` if its cavity is ideal and it has
    /// one mode.
    pub fn left_out(&self) -> Option<String> {
        let modes = self
            .structure
            .as_ref()
            .is_some_and(|structure| structure.modes.len() > 1);
        let modes = modes.then(|| "the other modes of the structure".to_string());
        match (self.left_out_of_cavity(), modes) {
            (Some(cavity), Some(modes)) => Some(format!("{cavity}, and without {modes}")),
            (cavity, modes) => cavity.or(modes),
        }
    }

    /// What exact orbits leave out of the scene's cavity, as a list; `None` if it is ideal.
    pub fn left_out_of_cavity(&self) -> Option<String> {
        let Cavity { restitution, least_restitution, scatter, tilt, .. } = self.plant.cavity;
        let [plus, minus] = self.plant.gaps();
        let b = self.plant.half_width;
        let r = self.plant.restitution;
        let is_r = |law: Option<Restitution>| law.is_none_or(|law| law == Restitution::Constant(r));
        let effects = [
            (has_friction(&self.plant), "friction"),
            (plus != b || minus != b, "the gaps b_plus and b_minus"),
            (tilt != 0.0, "tilt"),
            (
                !restitution.into_iter().all(is_r) || least_restitution > r,
                "the restitution of r_law, r_plus, r_minus and r_min",
            ),
            (scatter != 0.0, "the scatter of the restitution"),
        ];
        let effects: Vec<&str> = effects
            .into_iter()
            .filter_map(|(is, name)| is.then_some(name))
            .collect();
        let (last, others) = effects.split_last()?;
        Some(match others {
            [] => (*last).to_string(),
            others => format!("{} and {last}", others.join(", ")),
        })
    }

    /// The scene with everything at rest at the start.
    #[must_use]
    pub fn at_rest(self) -> Self {
        Self { start: State::default(), ..self }
    }

    /// The scene with this many times the samples.
    #[must_use]
    pub fn sampled(self, factor: f64) -> Self {
        let samples_per_period = factor * self.controller.samples_per_period;
        let controller = ControllerSettings { samples_per_period, ..self.controller };
        Self { controller, ..self }
    }

    /// What the scene says of its rig.
    pub fn knowledge(&self) -> Knowledge {
        let (plant, definition, structure) = (&self.plant, self.definition(), self.structure.as_ref());
        let linear = LinearResponse::of(plant, definition.reference);
        let aliased = |path| ShakerPath { aliased: self.aliased(1.0).unwrap_or(0.0), ..path };
        let shaker = structure.and_then(Structure::shaker_path).map(aliased);
        Knowledge {
            linear,
            is_measured: false,
            numbers: self.dimensionless(),
            is_symmetric: plant.has_mirror_images(),
            carried_up_to: carried_up_to(plant),
            sample_time: self.sample_time(),
            target: Target {
                phase: definition.phase,
                measurands: definition.measurands(),
                omega0: linear.omega0,
                through_shaker: shaker.is_some(),
                filter: self.chain.filter.map(|cut_off| cut_off * linear.omega0),
                // Of the controller's configuration.
                delay: 0.0,
                units: self.units(),
                held: self.chain.hold,
                ranges: self.ranges(),
            },
            shaker,
            nearest_pole: structure.map_or(f64::INFINITY, Structure::nearest_pole),
            rings: structure.map_or([None; 2], Structure::rings),
        }
    }

    /// Number of times the default samples that a shaker needs: a power of two, at most [`OVERSAMPLED`]; 1 without a shaker.
    ///
    /// Impacts put edges into its force, and harmonics beside the sampling frequency look like the fundamental: smaller than the precision asked of a
    /// tracked drive.
    fn oversampling(&self) -> f64 {
        let allowed = self.backbone.precision * self.amplitude;
        let is_enough = |times: &f64| self.aliased(*times).is_none_or(|aliased| aliased <= allowed);
        let times = std::iter::successors(Some(1.0), |times| Some(2.0 * times));
        times
            .take_while(|times| *times < OVERSAMPLED)
            .find(is_enough)
            .unwrap_or(OVERSAMPLED)
    }

    /// Amplitude of the base, m, that a harmonic of the force of a shaker beside the sampling frequency seems to be, with this many times the samples:
    /// what the impacts on a particle of the speed b omega0, whose harmonics are 4/pi m b omega0², make of the force through structure and shaker, and
    /// through an anti-alias filter. `None` without a shaker or a drive.
    pub fn aliased(&self, times: f64) -> Option<f64> {
        let (structure, shaker) = self.shaken()?;
        if self.amplitude <= 0.0 {
            return None;
        }
        let [reference, _] = shaker.reference_and_inertia(structure.excitation);
        let (omega, order) = (structure.mode().omega, self.resonance.reference_quantity.order());
        let impacts = 4.0 / PI * self.plant.particle_mass * self.plant.half_width * omega * omega;
        let at = times * self.controller.samples_per_period;
        let filter = self.chain.filter;
        let passed = filter.map_or(1.0, |cut_off| (at / cut_off).powi(4).hypot(1.0).recip());
        let force = structure
            .host
            .frequency_response_to_cavity(&reference, at * omega)
            .norm();
        let force = force * impacts * at.powi(order) * passed;
        Some(structure.units().reference.in_metres(force))
    }

    /// The controller's sample time, s: rig and controller agree on it before anything is measured. It has 31 significant bits (2e-10 of it is
    /// rounded), so that sums and multiples of it are exact and equal for four million samples: components with a clock of their own compare times
    /// with a tolerance that may be the rounding error of a number near 1.
    pub fn sample_time(&self) -> f64 {
        let exact = TAU / self.plant.natural_frequency() / self.controller.samples_per_period;
        // Of 53 bits 22 are zero.
        let multiple = 1_u64 << 22;
        f64::from_bits((exact.to_bits() + multiple / 2) / multiple * multiple)
    }
}

// The sections of a scene as written, before they are completed and checked.

/// The file; sections left out count as empty.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct Sections {
    plant: PlantSection,
    structure: Option<StructureSection>,
    shaker: Option<ShakerSection>,
    start: StartSection,
    excitation: ExcitationSection,
    controller: ControllerSettings,
    phase_lock: PhaseLock,
    record: RecordSettings,
    backbone: BackboneSettings,
    chain: ChainSettings,
    resonance: Definition,
    rig: RigSection,
    controller_names: Names,
}

/// A rig other than the simulated one.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct RigSection {
    names: Names,
}

impl Sections {
    /// The scene, once every check of [`checks`] has passed; `table`: the sections as written, which show what is not given.
    fn resolve(mut self, origin: &str, table: &Table) -> Result<Scene, SceneError> {
        let structure = self.host(origin)?;
        let mut resonance = self.resonance;
        if let Some(structure) = &structure {
            self.plant = self.plant.of_structure(origin, structure)?;
            resonance.sensor = Sensor::Q1;
        }
        let plant = self.plant.resolve(origin)?;
        let is_given = |section: &str, key: &str| table.get(section).is_some_and(|keys| keys.get(key).is_some());
        let numbers = Dimensionless::of(&plant, 0.0);
        let mut scene = Scene {
            start: self.start.resolve(origin, &plant, structure.as_ref())?,
            amplitude: self.excitation.in_metres(origin, &numbers, structure.as_ref())?,
            plant,
            states_sensor: structure.is_some() || is_given("resonance", "sensor"),
            structure,
            controller: self.controller,
            phase_lock: self.phase_lock,
            record: self.record,
            backbone: self.backbone,
            chain: self.chain,
            resonance,
            rig_names: self.rig.names,
            controller_names: self.controller_names,
        };
        if !is_given("controller", "samples_per_period") {
            scene.controller.samples_per_period *= scene.oversampling();
        }
        checks::check(&scene, origin)?;
        Ok(scene)
    }

    /// The structure, with its shaker; an oscillator on a shaker is a structure, too.
    fn host(&mut self, origin: &str) -> Result<Option<Structure>, SceneError> {
        // Paths are relative to the scene file.
        let folder = Path::new(origin).parent().unwrap_or(Path::new(""));
        let structure = self.structure.take().map(|section| section.resolve(origin, folder));
        let structure = structure.transpose()?;
        let Some(shaker) = &self.shaker else {
            return Ok(structure);
        };
        let host = match structure {
            Some(structure) => structure,
            None => self.plant.take_oscillator(origin, shaker)?,
        };
        let attached = shaker
            .attach(host)
            .map_err(|message| SceneError::text(origin, format!("[shaker]: {message}")))?;
        Ok(Some(attached))
    }
}

// Scenes read from files and texts.

impl Scene {
    /// Reads the scene file at `path`, or the default scene without one, with the overrides applied in order.
    pub fn load(path: Option<&Path>, overrides: &[Override]) -> Result<Self, SceneError> {
        let Some(path) = path else {
            return Self::parse("paper.toml (the default scene)", PAPER, overrides);
        };
        Self::parse(&path.display().to_string(), &Self::text(path)?, overrides)
    }

    /// The text of the scene file at `path`.
    ///
    /// # Errors
    /// A file that cannot be read, or is not in UTF-8.
    pub fn text(path: &Path) -> Result<String, SceneError> {
        let bytes = std::fs::read(path).map_err(|source| SceneError::Read { path: path.into(), source })?;
        let text = utf8(&bytes).map_err(|message| SceneError::text(&path.display().to_string(), message))?;
        Ok(text.into())
    }

    /// Reads a scene from `text`; `origin` names it in messages.
    pub fn parse(origin: &str, text: &str, overrides: &[Override]) -> Result<Self, SceneError> {
        Ok(overrides::read(origin, text, overrides)?.0)
    }
}

/// The text of a file in UTF-8, without its byte order mark.
///
/// # Errors
/// What the file is instead, and what to do.
pub fn utf8(bytes: &[u8]) -> Result<&str, String> {
    if bytes.starts_with(&[0xff, 0xfe]) || bytes.starts_with(&[0xfe, 0xff]) {
        return Err("is UTF-16; save it as UTF-8".into());
    }
    if bytes.contains(&0) {
        return Err("has bytes of zero, as UTF-16 or a binary file has; save it as text in UTF-8".into());
    }
    let text = std::str::from_utf8(bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes));
    text.map_err(|error| {
        let line = 1 + bytes[..error.valid_up_to()]
            .iter()
            .filter(|byte| **byte == b'\n')
            .count();
        format!("is not UTF-8 in line {line}; save it as UTF-8")
    })
}

// Options of a scene: a number, or `false` or "none". Zero is a number like every other.

/// Whether a value says that there is no number.
fn is_none(value: &Value) -> bool {
    *value == Value::Boolean(false) || value.as_str() == Some("none")
}

/// Reads an option.
fn option<'de, D: Deserializer<'de>, T: Deserialize<'de>>(from: D) -> Result<Option<T>, D::Error> {
    let value = Some(Value::deserialize(from)?).filter(|value| !is_none(value));
    let number = value.map(T::deserialize).transpose();
    number.map_err(|_| D::Error::custom("expected a number, or false or \"none\""))
}
