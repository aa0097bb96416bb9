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
mod controller;
mod orbits;
mod overrides;
mod shaker;
mod structure;
pub mod table;

use std::f64::consts::{PI, TAU};
use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use lovines::cavity::GRAVITY;
use lovines::table::{LAWS, PARAMETERS, Parameter, Range, Values};
use lovines::{Cavity, InvalidValue, Plant, Restitution, State, StructureState};
use phase_lock::{ConfigError, Number};
use serde::de::{Error, MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use shaker::ShakerSection;
use structure::StructureSection;
use toml::Table;
use vines_model::ArgumentError;

use crate::knowledge::{Knowledge, has_friction};

pub use chain::ChainSettings;
pub use controller::{ControllerSettings, KEYS, PhaseLock, Units, key, phase_target, refusal};
pub use lovines::{Parameters, table::PARAMETERS as PLANT_PARAMETERS};
pub use overrides::{Family, Override};
pub use shaker::{ARMATURE, Channel, Limits, Release, SceneShaker, TABLE};
pub use shaker::{PLACES, frequencies};
pub use structure::{Excitation, Structure, StructureMode};
pub use vines_model::{Definition, Dimensionless, Measurand, Reference, Sensor};
pub use vines_rig::{Name, Names};

/// The default scene, embedded so that the program works from any folder.
pub const PAPER: &str = include_str!("../../../scenes/paper.toml");

/// Largest number of times the default samples that a scene takes by itself, a limit of run time: a backbone then takes about a minute.
const OVERSAMPLED: f64 = 16.0;

/// A checked scene in SI units; build one with [`Scene::load`] or [`Scene::parse`].
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Scene {
    /// The oscillator and its particle, SI units; with a structure, the oscillator of its driven mode as the cavity has it: M = 1/phi².
    #[serde(serialize_with = "serialize")]
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
        let by_force = self
            .structure
            .as_ref()
            .is_some_and(|one| one.excitation == Excitation::Force);
        let reference = if by_force {
            Reference::Force
        } else {
            self.resonance.reference
        };
        let phase = self.controller.phase_target.to_radians();
        Definition { reference, phase, ..self.resonance }
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
        let mut knowledge = Knowledge::of(&self.plant, self.definition(), self.amplitude, self.sample_time());
        knowledge.shaker = self.structure.as_ref().and_then(|structure| structure.shaker_path());
        if let Some(path) = &mut knowledge.shaker {
            path.aliased = self.aliased(1.0).unwrap_or(0.0);
        }
        knowledge.target.through_shaker = knowledge.shaker.is_some();
        let forced = self
            .structure
            .as_ref()
            .filter(|one| one.excitation == Excitation::Force);
        knowledge.base_per_newton = forced.map(Structure::base_per_drive);
        knowledge.nearest_pole = self.structure.as_ref().map_or(f64::INFINITY, Structure::nearest_pole);
        knowledge.ringing = self.structure.as_ref().map_or(0.0, Structure::ringing);
        knowledge.target.held = self.chain.hold;
        knowledge.target.filter = self.chain.filter.map(|cut_off| cut_off * knowledge.linear.omega0);
        knowledge
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
        let (structure, shaker) = self
            .structure
            .as_ref()
            .and_then(|one| Some((one, one.shaker.as_ref()?)))?;
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
        Some(force * impacts * at.powi(order) * passed * structure.base_per_drive())
    }

    /// What is possible, but hardly meant: a value in another unit, such as kN/m, g or mm.
    pub fn implausible(&self) -> impl Iterator<Item = Implausible> {
        let d = Dimensionless::of(&self.plant, 0.0);
        let hertz = d.omega0 / TAU;
        let nothing = [0.0, 0.0, f64::INFINITY, 0.0, 0.0];
        let [heavy, shaken, lift, sag, stroke] = self.doubtful_shaker().unwrap_or(nothing);
        [
            ("epsilon = m/M", d.epsilon, "", d.epsilon > 0.3),
            ("lambda = c/(m omega0)", d.lambda, "", d.lambda > 30.0),
            ("b", d.b, "m", d.b > 1.0),
            ("the natural frequency", hertz, "Hz", hertz < 0.1),
            (
                "armature over structure: resonance of both, over the structure's, which the loop holds",
                shaken,
                "",
                heavy > 1.0,
            ),
            (
                "largest force of the coil over the weight of the armature",
                lift,
                "",
                lift < 1.0,
            ),
            (
                "sag of the armature under its weight, over shaker.stroke_max",
                sag,
                "",
                sag > 1.0,
            ),
            ("shaker.stroke_max", stroke, "m", stroke > 1.0),
        ]
        .into_iter()
        .filter_map(|(name, value, unit, is)| is.then_some(Implausible { name, value, unit }))
    }

    /// Mass of the armature over the mass that all modes have at its point, and the frequency of the pole with which structure and shaker answer the
    /// command, over the natural frequency. What the amplifier's limit gives as a force, over the weight of the armature, whose sag, over the
    /// stroke, and the stroke, m: other units than SI are wrong by a factor of 1000.
    fn doubtful_shaker(&self) -> Option<[f64; 5]> {
        let (structure, path) = (self.structure.as_ref()?, self.knowledge().shaker?);
        let SceneShaker { shaker, limits, .. } = structure.shaker.as_ref()?;
        let squares = |point: usize| {
            structure
                .modes
                .iter()
                .map(|mode| mode.shape[point].powi(2))
                .sum::<f64>()
        };
        // A heavy armature under a table is what a slip table is.
        let share = structure.drive.map_or(0.0, |point| shaker.mass * squares(point));
        let current = limits.voltage.map(|voltage| voltage / shaker.resistance).into_iter();
        let current = current.chain(limits.current).fold(f64::INFINITY, f64::min);
        let (weight, stroke) = (shaker.mass * GRAVITY, limits.stroke);
        Some([
            share,
            1.0 - path.pole.im / structure.mode().omega,
            shaker.force_factor * current / weight,
            stroke.map_or(0.0, |stroke| weight / (shaker.suspension[0] * stroke)),
            stroke.unwrap_or(0.0),
        ])
    }

    /// The controller's sample time, s: rig and controller agree on it before anything is measured. It has 31 significant bits (2e-10 of it is
    /// rounded), so that sums and multiples of it are exact and equal for four million samples: components with a clock of their own compare times
    /// with a tolerance that may be the rounding error of a number near 1.
    pub fn sample_time(&self) -> f64 {
        let exact = TAU / self.plant.natural_frequency() / self.controller.samples_per_period;
        f64::from_bits((exact.to_bits() + DROPPED / 2) / DROPPED * DROPPED)
    }
}

/// Multiple of which the last bits of a sample time are: 22 of 53 are zero.
const DROPPED: u64 = 1 << 22;

/// A value of a scene that is possible, but hardly meant.
#[derive(Debug, Clone, Copy, PartialEq)]
#[expect(missing_docs, reason = "the structure explains them")]
pub struct Implausible {
    pub name: &'static str,
    pub value: f64,
    pub unit: &'static str,
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

/// The amplitude of the drive; exactly one of the keys is given.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct ExcitationSection {
    #[serde(rename = "G")]
    g: Option<f64>,
    #[serde(rename = "E")]
    e: Option<f64>,
    #[serde(rename = "F")]
    f: Option<f64>,
}

impl ExcitationSection {
    /// Amplitude E of the base displacement, m, that moves the oscillator of `plant` alike.
    fn in_metres(&self, origin: &str, d: &Dimensionless, structure: Option<&Structure>) -> Result<f64, SceneError> {
        let (excitation, factor) = structure.map_or((Excitation::Base, 1.0), |structure| {
            (structure.excitation, structure.base_per_drive())
        });
        let key = match excitation {
            Excitation::Base => "E (m)",
            Excitation::Force => "F (N)",
        };
        match (self.g, self.e, self.f, excitation) {
            (Some(g), None, None, _) => {
                not_negative("excitation.G", g, "(dimensionless)")?;
                Ok(d.amplitude(g))
            }
            (None, Some(e), None, Excitation::Base) => {
                not_negative("excitation.E", e, "m")?;
                Ok(e * factor)
            }
            (None, None, Some(f), Excitation::Force) => {
                not_negative("excitation.F", f, "N")?;
                Ok(f * factor)
            }
            (None, Some(_), None, _) | (None, None, Some(_), _) => Err(SceneError::text(
                origin,
                format!(
                    "[excitation] does not fit the drive: give G (dimensionless) or {key}; E belongs to a base, F to a structure with excitation = \"force\""
                ),
            )),
            (given, ..) => {
                let given = match [given, self.e, self.f].iter().flatten().count() {
                    0 => "neither",
                    2 if structure.is_none() => "both",
                    _ => "more than one",
                };
                let one = format!("of G (dimensionless) and {key}: give exactly one, with G = E/(b epsilon)");
                Err(SceneError::text(origin, format!("[excitation] has {given} {one}")))
            }
        }
    }
}

impl Sections {
    /// The checked scene; `table`: the sections as written, which show what is not given.
    fn resolve(self, origin: &str, table: &Table) -> Result<Scene, SceneError> {
        // Paths are relative to the scene file.
        let folder = Path::new(origin).parent().unwrap_or(Path::new(""));
        let mut plant = self.plant;
        let mut structure = self
            .structure
            .map(|section| section.resolve(origin, folder))
            .transpose()?;
        if let Some(shaker) = &self.shaker {
            let host = match structure.take() {
                Some(structure) => structure,
                None => plant.take_oscillator(origin, shaker)?,
            };
            let attached = shaker
                .attach(host)
                .map_err(|message| SceneError::text(origin, format!("[shaker]: {message}")))?;
            structure = Some(attached);
        }
        let mut resonance = self.resonance;
        if let Some(structure) = &structure {
            plant = plant.of_structure(origin, structure)?;
            if resonance.reference == Reference::Force {
                let message = "resonance.reference = \"force\" beside [structure]: its `excitation` is the reference; drop the key";
                return Err(SceneError::text(origin, message));
            }
            if self.start.q1 != 0.0 || self.start.dq1 != 0.0 {
                return Err(SceneError::text(
                    origin,
                    "[start] has q1 or dq1: a structure starts at rest; give q2 and dq2 of the particle only",
                ));
            }
            resonance.sensor = Sensor::Q1;
        }
        let plant = plant.resolve(origin)?;
        if let Some(structure) = &structure {
            structure
                .reached_by(plant.particle_mass)
                .map_err(|message| SceneError::text(origin, format!("[structure]: {message}")))?;
        }
        let d = Dimensionless::of(&plant, 0.0);
        let mut scene = Scene {
            start: self.start.resolve(&plant)?,
            amplitude: self.excitation.in_metres(origin, &d, structure.as_ref())?,
            plant,
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
        if let Some(structure) = &scene.structure {
            let State { q2, dq2, .. } = scene.start;
            let start = StructureState { q2, dq2, ..StructureState::default() };
            Plant::with_host(structure.host.clone(), scene.plant, &start)
                .map_err(|error| SceneError::text(origin, format!("[structure]: {error}")))?;
        }
        let shaken = scene.structure.as_ref().filter(|one| one.shaker.is_some());
        if let Some(structure) = shaken {
            if !scene.chain.reference {
                let turn = structure
                    .shaker_path()
                    .map_or(f64::NAN, |path| path.turn().to_degrees());
                let message = format!(
                    "[shaker] with chain.reference = false: the drive's phase turns by {turn:.1} degrees within the half-power bandwidth; the loop \
                     needs the force cell, or the sensor of the table, as its reference"
                );
                return Err(SceneError::text(origin, message));
            }
            // The least response at which particles hit: half of the cavity.
            if let Some(message) = structure.beyond_limits(scene.amplitude, 0.5 * scene.plant.half_width) {
                return Err(SceneError::text(origin, message));
            }
        }
        let controller = table.get("controller");
        let is_sampled = || controller.is_some_and(|keys| keys.get("samples_per_period").is_some());
        if !is_sampled() {
            scene.controller.samples_per_period *= scene.oversampling();
        }
        scene.controller.check()?;
        scene.backbone.check()?;
        scene.record.check(&scene)?;
        scene.chain.check(&scene.controller, scene.reading_units())?;
        check(
            "chain.base_range",
            scene.chain.base_range,
            "(over b epsilon)",
            scene.amplitude <= scene.drive_range(),
            format!(
                "must be at least G = {:.6}, or the converter of the base saturates",
                d.excitation(scene.amplitude)
            ),
        )?;
        if scene.resonance.reference == Reference::Force && !scene.chain.reference {
            let message = "resonance.reference = \"force\" with chain.reference = false: the force k e + c e' follows from the base \
                           sensor; switch it on, or take the reference \"base\"";
            return Err(SceneError::text(origin, message));
        }
        let Definition { sensor, reference, sensor_quantity, reference_quantity, .. } = scene.resonance;
        if sensor == Sensor::V && sensor_quantity != Measurand::Displacement {
            let name = sensor_quantity.name();
            let message = format!(
                "resonance.sensor_quantity = \"{name}\" with resonance.sensor = \"v\": v contains the particle, which no sensor on the structure \
                 reads; set resonance.sensor = \"q1\""
            );
            return Err(SceneError::text(origin, message));
        }
        if reference == Reference::Force && reference_quantity != Measurand::Displacement {
            let name = reference_quantity.name();
            let message = format!(
                "resonance.reference_quantity = \"{name}\" with resonance.reference = \"force\": the force k e + c e' follows from the displacement of \
                 the base; take the reference \"base\", or the quantity \"displacement\""
            );
            return Err(SceneError::text(origin, message));
        }
        let is_force = |one: &Structure| one.excitation == Excitation::Force;
        if scene.structure.as_ref().is_some_and(is_force) && reference_quantity != Measurand::Displacement {
            let name = reference_quantity.name();
            let message = format!(
                "resonance.reference_quantity = \"{name}\" where a force drives the structure: the reference is this force; drop the key, which belongs to \
                 a base"
            );
            return Err(SceneError::text(origin, message));
        }
        if !scene.chain.reference && reference_quantity != Measurand::Displacement {
            let name = reference_quantity.name();
            let message = format!(
                "resonance.reference_quantity = \"{name}\" with chain.reference = false: no sensor reads the base, and the reference is the displacement \
                 that is commanded; drop one of the keys"
            );
            return Err(SceneError::text(origin, message));
        }
        let fastest = scene.controller.omega_max * scene.dimensionless().omega0;
        lovines::Drive::harmonic(scene.amplitude, fastest)
            .validate()
            .map_err(SceneError::Drive)?;
        Ok(scene)
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
        let (sections, table) = overrides::read(origin, text, overrides)?;
        let scene = sections.resolve(origin, &table)?;
        scene.check_controller()?;
        Ok(scene)
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

// The `[plant]` section, in SI units or dimensionless, and the `[start]` section.

/// The section as written: rows of the plant's table, or dimensionless numbers.
#[derive(Debug, Clone, Default)]
struct PlantSection {
    values: Values,
    epsilon: Option<f64>,
    lambda: Option<f64>,
}

/// Keys of the section: the symbols of the table, and these two after them.
static PLANT_KEYS: LazyLock<Vec<&str>> = LazyLock::new(|| {
    let symbols = PARAMETERS.iter().map(|row| row.symbol);
    symbols.chain(["epsilon", "lambda"]).collect()
});

/// The place of a key in [`PLANT_KEYS`].
struct PlantKey(usize);

impl<'de> Deserialize<'de> for PlantKey {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        let key = String::deserialize(from)?;
        let place = PLANT_KEYS.iter().position(|known| *known == key);
        place
            .map(Self)
            .ok_or_else(|| D::Error::unknown_field(&key, &PLANT_KEYS))
    }
}

impl<'de> Deserialize<'de> for PlantSection {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        struct Section;

        impl<'de> Visitor<'de> for Section {
            type Value = PlantSection;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a map")
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<PlantSection, A::Error> {
                let mut section = PlantSection::default();
                while let Some(PlantKey(n)) = map.next_key()? {
                    let row = PARAMETERS.get(n);
                    let value = match row.map(|row| row.range) {
                        Some(Range::Law) => law(&map.next_value::<String>()?)?,
                        Some(Range::Whole) => map.next_value::<u32>()?.into(),
                        _ => map.next_value()?,
                    };
                    *match n.checked_sub(PARAMETERS.len()) {
                        None => &mut section.values.0[n],
                        Some(0) => &mut section.epsilon,
                        Some(_) => &mut section.lambda,
                    } = Some(value);
                }
                Ok(section)
            }
        }

        from.deserialize_map(Section)
    }
}

/// The code of a law of restitution.
fn law<E: Error>(word: &str) -> Result<f64, E> {
    let code = LAWS.iter().position(|law| *law == word);
    code.map(|code| code as f64)
        .ok_or_else(|| E::unknown_variant(word, &LAWS))
}

impl PlantSection {
    /// Whether the plant is in SI units. Of two sets of units, one would silently be ignored.
    fn is_si(&self) -> Result<bool, &'static str> {
        let is_si = ["M", "k", "c", "m", "b"]
            .iter()
            .any(|symbol| self.get(symbol).is_some());
        if is_si && (self.epsilon.is_some() || self.lambda.is_some()) {
            return Err(
                "[plant] mixes SI keys (M, k, c, m, b) with dimensionless ones (epsilon, lambda): \
                 give one set or the other, and r (epsilon = m/M, lambda = c/(m omega0))",
            );
        }
        Ok(is_si)
    }

    /// The number under a symbol of the table.
    fn get(&self, symbol: &str) -> Option<f64> {
        self.values.0[Values::place(symbol)?]
    }

    /// The oscillator as a structure with one mode, on the table of a shaker or driven by its force.
    fn take_oscillator(&mut self, origin: &str, shaker: &ShakerSection) -> Result<Structure, SceneError> {
        let excitation = if shaker.has_table() {
            Excitation::Base
        } else {
            Excitation::Force
        };
        let mut numbers = [0.0; 3];
        for (number, symbol) in numbers.iter_mut().zip(["M", "k", "c"]) {
            let place = Values::place(symbol);
            *number = place.and_then(|place| self.values.0[place].take()).ok_or_else(|| {
                let message = format!(
                    "[shaker] with a [plant] without `{symbol}`: give M, k and c in SI units, or a [structure]"
                );
                SceneError::text(origin, message)
            })?;
        }
        let [mass, stiffness, damping] = numbers;
        positive("plant.M", mass, "kg")?;
        positive("plant.k", stiffness, "N/m")?;
        not_negative("plant.c", damping, "N s/m")?;
        Structure::of_oscillator(numbers, excitation)
    }

    /// The section with the oscillator of a structure's driven mode.
    fn of_structure(mut self, origin: &str, structure: &Structure) -> Result<Self, SceneError> {
        if let Some(key) = ["M", "k", "c"].into_iter().find(|key| self.get(key).is_some()) {
            let message =
                format!("[plant] has `{key}` beside [structure], which takes the place of M, k and c: drop it");
            return Err(SceneError::text(origin, message));
        }
        let mode = structure.mode();
        let mass = structure.at_cavity(mode).powi(-2);
        for (symbol, value) in [
            ("M", mass),
            ("k", mass * mode.omega * mode.omega),
            ("c", 2.0 * mode.zeta * mode.omega * mass),
        ] {
            if let Some(place) = Values::place(symbol) {
                self.values.0[place] = Some(value);
            }
        }
        Ok(self)
    }

    fn resolve(&self, origin: &str) -> Result<Parameters, SceneError> {
        let keys = |message: &str| SceneError::text(origin, message);
        let is_si = self.is_si().map_err(keys)?;
        let need = |value: Option<f64>, key: &str| {
            value.ok_or_else(|| {
                keys(&format!(
                    "[plant] has no `{key}`: give M, k, c, m, b and r (SI), or epsilon, lambda and r (dimensionless)"
                ))
            })
        };
        if self.get("r_law").is_some_and(|law| law != 0.0) && self.get("r_plus").is_none() {
            return Err(keys(
                "[plant] has an `r_law` without its parameter: give r_plus, which is k in (s/m)^(1/5) of \"viscoelastic\", or the yield speed in \
                 m/s of \"plastic\"",
            ));
        }
        for (row, value) in self.values.given() {
            row.check(value)?;
        }
        let mut plant = self.values.parameters();
        if is_si {
            for row in PARAMETERS.iter().filter(|row| row.default.is_none()) {
                need(self.get(row.symbol), row.symbol)?;
            }
        } else {
            let (epsilon, lambda) = (need(self.epsilon, "epsilon")?, need(self.lambda, "lambda")?);
            positive("plant.epsilon", epsilon, "(dimensionless)")?;
            not_negative("plant.lambda", lambda, "(dimensionless)")?;
            plant = Parameters {
                cavity: plant.cavity,
                ..Parameters::dimensionless(epsilon, lambda, need(self.get("r"), "r")?)
            };
        }
        plant.validate()?;
        Ok(plant)
    }
}

/// The `[start]` section; what is left out is zero.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct StartSection {
    q1: f64,
    dq1: f64,
    q2: f64,
    dq2: f64,
}

impl StartSection {
    /// The state, once a plant takes it.
    fn resolve(&self, plant: &Parameters) -> Result<State, SceneError> {
        let Self { q1, dq1, q2, dq2 } = *self;
        let start = State { q1, dq1, q2, dq2 };
        lovines::Plant::new(*plant, start)?;
        Ok(start)
    }
}

/// The rows of the plant's table with their numbers; of the cavity those that are not ideal.
fn given(plant: &Parameters) -> Vec<(&'static Parameter, f64)> {
    let values = Values::from(plant);
    let given = values
        .given()
        .filter(|(row, value)| row.default.is_none() || *value != 0.0);
    given.collect()
}

/// The parameters under their symbols, as a scene in SI units has them.
fn symbols(plant: &Parameters) -> Vec<(&'static str, toml::Value)> {
    let value = |(row, value): (&'static Parameter, f64)| {
        let value = match row.range {
            Range::Law => LAWS[value as usize].into(),
            Range::Whole => (value as i64).into(),
            _ => value.into(),
        };
        (row.symbol, value)
    };
    given(plant).into_iter().map(value).collect()
}

/// The keys of the section `[plant]` and their values, as a scene in SI units has them.
pub fn plant_keys(plant: &Parameters) -> Vec<(&'static str, String)> {
    let keys = symbols(plant).into_iter().map(|(symbol, value)| match value {
        toml::Value::Float(number) => (symbol, format!("{number:?}")),
        toml::Value::Integer(number) => (symbol, number.to_string()),
        text => (symbol, format!("{:?}", text.as_str().unwrap_or_default())),
    });
    keys.collect()
}

/// Writes the parameters under their symbols, as a scene has them.
fn serialize<S: Serializer>(plant: &Parameters, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_map(symbols(plant))
}

// The `[record]` section: how long to drive, to record and to average.

settings! {
    /// Durations of an experiment.
    pub struct RecordSettings {
        /// How long the settled lock is held and measured, natural periods.
        hold_periods: f64 = 20.0,
        /// Length of the recorded decay, natural periods; by default as long as the linear response takes to fall to 5 %.
        decay_periods: Option<f64> = None,
    }
}

/// Most samples of one record: about 3 GiB in memory.
const MOST_SAMPLES: f64 = 2e7;

impl RecordSettings {
    fn check(&self, scene: &Scene) -> Result<(), SceneError> {
        let unit = "(natural periods)";
        // At least enough to count impacts and measure.
        within("record.hold_periods", self.hold_periods, unit, [3.0, 1e6])?;
        positive("record.decay_periods", self.decay_periods.unwrap_or(1.0), unit)?;
        let periods = self.hold_periods + self.decay_periods.unwrap_or(0.0);
        let longest = scene.controller_config().acquire_timeout.unwrap_or(f64::INFINITY);
        let samples = (longest / scene.sample_time()).round() + scene.controller.samples_per_period * periods;
        check(
            "samples of phase_lock.acquire_timeout and of all periods of [record]",
            samples,
            "samples",
            samples <= MOST_SAMPLES,
            "must be at most 20 million",
        )
    }
}

// The `[backbone]` section: how the backbone is tracked.

settings! {
    /// How the response amplitude is stepped with the loop closed.
    pub struct BackboneSettings {
        /// First level, response amplitude over b.
        #[serde(rename = "C_from")]
        c_from: f64 = 0.7,
        /// Last level, response amplitude over b.
        #[serde(rename = "C_to")]
        c_to: f64 = 0.14,
        /// Number of levels, at equal distances.
        points: u32 = 29,
        /// Largest standard uncertainty of the drive E as a share of it, and of the frequency as a share of the half-power bandwidth of a linear rig
        /// that this drive holds at the largest level: `omega0 E/A`. Noise and transients lengthen the dwell until both are reached.
        precision: f64 = 9e-4,
    }
}

impl BackboneSettings {
    fn check(&self) -> Result<(), SceneError> {
        positive("backbone.C_from", self.c_from, "(over b)")?;
        positive("backbone.C_to", self.c_to, "(over b)")?;
        positive("backbone.precision", self.precision, "(relative)")?;
        within("backbone.points", self.points.into(), "(levels)", [1.0, 1e4])
    }

    /// The levels, amplitudes of the response in m, for the half-width `b`, m, in the order in which they are visited.
    pub fn levels(&self, b: f64) -> Vec<f64> {
        let [from, to] = [self.c_from, self.c_to].map(|level| level * b);
        let steps = f64::from(self.points.max(2) - 1);
        (0..self.points)
            .map(|n| rounded(from + (to - from) * f64::from(n) / steps))
            .collect()
    }
}

/// The value to ten digits, as a person would write it: 0.0068, not 0.0067999999999999996.
fn rounded(value: f64) -> f64 {
    format!("{value:.9e}").parse().unwrap_or(value)
}

// Options of a scene: a number, or `false` or "none". Zero is a number like every other.

/// Reads an option.
fn option<'de, D: Deserializer<'de>, T: Deserialize<'de>>(from: D) -> Result<Option<T>, D::Error> {
    match toml::Value::deserialize(from)? {
        toml::Value::Boolean(false) => Ok(None),
        toml::Value::String(word) if word == "none" => Ok(None),
        value => T::deserialize(value)
            .map(Some)
            .map_err(|_| D::Error::custom("expected a number, or false or \"none\"")),
    }
}

// Range checks that name the value, its unit and what is allowed.

/// Refuses the value of a key, in its unit, unless it is finite and `ok`.
fn check(
    key: &'static str,
    value: f64,
    unit: &'static str,
    ok: bool,
    allowed: impl Into<String>,
) -> Result<(), SceneError> {
    if ok && value.is_finite() {
        return Ok(());
    }
    Err(SceneError::Value { key, value, unit, allowed: allowed.into() })
}

fn positive(key: &'static str, value: f64, unit: &'static str) -> Result<(), SceneError> {
    check(key, value, unit, value > 0.0, "must be positive and finite")
}

fn not_negative(key: &'static str, value: f64, unit: &'static str) -> Result<(), SceneError> {
    check(key, value, unit, value >= 0.0, "must be zero or positive, and finite")
}

fn within(key: &'static str, value: f64, unit: &'static str, [low, high]: [f64; 2]) -> Result<(), SceneError> {
    let allowed = format!("must be from {low} to {high}");
    check(key, value, unit, (low..=high).contains(&value), allowed)
}

// Errors of a scene.

/// Why a scene cannot be used.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the messages explain the variants")]
pub enum SceneError {
    #[error("cannot read the scene {}: {source}", path.display())]
    Read { path: PathBuf, source: std::io::Error },
    #[error("--set: {0}")]
    Argument(#[from] ArgumentError),
    #[error("--set {argument}: {message}")]
    Override { argument: String, message: String },
    #[error("{key} = {} {unit}: {allowed}", Number(*value))]
    Value {
        key: &'static str,
        value: f64,
        unit: &'static str,
        allowed: String,
    },
    #[error("[plant] or [start]: {0}")]
    Plant(#[from] InvalidValue),
    #[error("[excitation] or [controller]: {0}")]
    Drive(InvalidValue),
    #[error("{}", refusal(.0))]
    Controller(#[from] ConfigError),
    #[error("{origin}: {message}")]
    Text { origin: String, message: String },
}

impl SceneError {
    /// An error of the text that `origin` names.
    fn text(origin: &str, message: impl Into<String>) -> Self {
        Self::Text { origin: origin.into(), message: message.into() }
    }
}

/// A message of the TOML reader, without types of Rust.
fn plain(message: &str) -> String {
    let words = [
        ("expected f64", "expected a number"),
        ("expected u32", "expected a whole number from 0"),
        ("expected u64", "expected a whole number from 0"),
        ("expected a boolean", "expected true or false"),
        ("unit variant, expected string only", "expected a word in quotes"),
        ("expected a map", "expected a table"),
    ];
    let replace = |text: String, (from, to)| text.replace(from, to);
    words.into_iter().fold(message.trim().to_string(), replace)
}
