//! A structure in the place of the oscillator: what the resources of `Structure.fmu` say of it, and its outputs.
//!
//! With a shaker its drive is the command of the amplifier, V, and outputs beside its points are linear in state and command.

use fmi2_component::{Log, Model as _, Refusal, Resources, foreign, guid_of};
use lovines::host::{Equations, Row};
use lovines::table::Values;
use lovines::{
    Drive, Excitation, Host, InvalidValue, Outcome, Parameters, Plant, Refused, State, Structure, StructureState,
};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::ops::Range;

use super::variables::Model;
use super::{LoViNes, Simulation, log};

/// The file in `resources/`.
const FILE: &str = "structure.json";

/// Value reference of the first output at a point. Those of point n are `FIRST_POINT_REFERENCE + 3 n` for its displacement, velocity and acceleration.
const FIRST_POINT_REFERENCE: u32 = 1000;

/// Parameters of the oscillator whose place the structure takes.
pub(super) const REPLACED: [&str; 3] = ["M", "k", "c"];

/// Refusal of a value that the structure determines.
pub(super) fn replaced(name: &str) -> Refusal {
    Refusal::error(format!(
        "{name} cannot be set: the structure in the resources has the place of the oscillator, and starts at rest"
    ))
}

/// The file, as `vines pack` writes it.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    excitation: Excitation,
    equations: Equations,
    points: Vec<Point>,
    /// The drive is clipped at this limit to each side.
    #[serde(default = "unlimited")]
    largest_drive: f64,
    /// Longest time between two checks of the outputs that have a limit, s.
    #[serde(default = "unlimited")]
    check_interval: f64,
    /// Start values of parameters, by symbol.
    parameters: BTreeMap<String, f64>,
    /// Displacement and velocity of the particle at the start, m and m/s.
    particle: [f64; 2],
}

/// A point, or another output: its displacement, or value, in the sections of the host, and what the drive adds to it.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Point {
    name: String,
    row: Row,
    #[serde(default)]
    per_drive: f64,
    /// A step in which it is found beyond this fails.
    #[serde(default = "unlimited")]
    limit: f64,
}

fn unlimited() -> f64 {
    f64::INFINITY
}

/// The structure and its points.
#[derive(Debug)]
pub(super) struct Adopted {
    host: Host,
    points: Vec<Point>,
    pub largest_drive: f64,
    check_interval: f64,
    /// Values at the start.
    pub values: Values,
    pub particle: [f64; 2],
}

impl Adopted {
    /// Reads the file that belongs to a description with that GUID.
    pub fn read(guid: &str, resources: &Resources) -> Result<Self, Refusal> {
        let refused = |reason: String| Refusal::error(format!("{FILE} is refused: {reason}"));
        let bytes = resources.read(FILE).map_err(|missing| {
            let foreign = foreign::<Model>(guid);
            Refusal::error(format!("{}; {}", foreign.message(), missing.message()))
        })?;
        let expected = guid_of(Model::GUID, &bytes);
        if guid != expected {
            return Err(Refusal::error(format!(
                "fmuGUID is {guid}, and that of this library with the {FILE} beside it is {expected}: one of modelDescription.xml, \
                 library and resources is damaged or of another FMU; pack the scene again"
            )));
        }
        let file: File = serde_json::from_slice(&bytes).map_err(|error| refused(error.to_string()))?;
        let mut values = Values::default();
        for (symbol, value) in file.parameters {
            let place = Values::place(&symbol).ok_or_else(|| refused(format!("{symbol} is no parameter")))?;
            values.0[place] = Some(value);
        }
        let host = file.equations.host(file.excitation)?;
        let size = host.sections().len();
        for (name, value) in [
            ("largest_drive", file.largest_drive),
            ("check_interval", file.check_interval),
        ] {
            if value <= 0.0 {
                return Err(refused(format!("{name} = {value}; it must be positive")));
            }
        }
        if let Some(point) = file.points.iter().find(|point| point.row.len() != size) {
            return Err(refused(format!(
                "the row of {} has {} pairs; expected {size}",
                point.name,
                point.row.len()
            )));
        }
        let File { points, largest_drive, check_interval, particle, .. } = file;
        Ok(Self {
            host,
            points,
            largest_drive,
            check_interval,
            values,
            particle,
        })
    }

    /// A plant at its start.
    pub fn plant(&self, parameters: Parameters, start: State) -> Result<Plant<Structure>, Refused> {
        let start = StructureState { q2: start.q2, dq2: start.dq2, ..StructureState::default() };
        Plant::with_host(self.host.clone(), parameters, &start)
    }

    /// The value references of the outputs at its points.
    pub fn outputs(&self) -> Range<u32> {
        FIRST_POINT_REFERENCE..FIRST_POINT_REFERENCE + 3 * self.points.len() as u32
    }

    /// The largest displacement of the cavity that a constant drive can cause, m per unit.
    pub fn displacement_per_drive(&self) -> f64 {
        let sections = self.host.sections().iter();
        sections
            .map(|section| (section.cavity[0] * section.drive[0] / section.oscillator.omega0_squared).abs())
            .sum()
    }

    /// Why the motion cannot go on: an output is beyond its limit; that of the command is where it is clipped.
    fn beyond_limit(&self, plant: &Plant<Structure>) -> Option<Refusal> {
        self.points.iter().find_map(|point| {
            let ([value, ..], Point { name, limit, .. }) = (point.of(plant), point);
            (value.abs() > limit * (1.0 + 1e-9)).then(|| {
                Refusal::error(format!(
                    "the shaker reached its limit: the {name} is {value} at t = {} s, and {limit} is allowed to each side; its amplifier has \
                     switched off",
                    plant.time()
                ))
            })
        })
    }

    /// A step under a drive that is clipped at its limit, and why it ended early, if an output passed its limit.
    fn step(
        &self,
        plant: &mut Plant<Structure>,
        drive: Drive,
        step: f64,
        log: &Log,
    ) -> Result<(Outcome, Option<Refusal>), InvalidValue> {
        let mut whole = Outcome::default();
        for (drive, duration) in drive.parts(step, self.check_interval) {
            for piece in plant.clipped(self.largest_drive, drive, duration)? {
                let begin = plant.time();
                // Lines that are not wanted are not written: one copy of the code.
                let outcome = plant.advance_with(piece.drive, piece.duration, |event| log::tell(log, begin, event))?;
                whole.elapsed += outcome.elapsed;
                whole.impacts += outcome.impacts;
                whole.released += outcome.released;
                whole.evaluations += outcome.evaluations;
                if outcome.cut_short {
                    return Ok((Outcome { cut_short: true, ..whole }, None));
                }
            }
            let beyond = self.beyond_limit(plant);
            if beyond.is_some() {
                return Ok((whole, beyond));
            }
        }
        Ok((whole, None))
    }
}

impl Point {
    /// Displacement, velocity and acceleration; the drive adds to the first.
    fn of(&self, plant: &Plant<Structure>) -> [f64; 3] {
        let [value, rates @ ..] = plant.point(&self.row);
        [value + self.per_drive * plant.base_displacement(), rates[0], rates[1]]
    }
}

impl LoViNes {
    /// A step of a structure.
    pub(super) fn step_of_structure(&mut self, time: f64, step: f64, log: &Log) -> Result<(), Refusal> {
        let (Some(adopted), Simulation::Structure(plant)) = (&self.adopted, &mut self.simulation) else {
            return Err(Refusal::error("there is no structure"));
        };
        plant.set_time(time);
        let (outcome, beyond) = adopted.step(plant, self.inputs.drive(), step, log)?;
        self.finish(time, step, &outcome)?;
        beyond.map_or(Ok(()), Err)
    }

    /// Limit of the drive to each side.
    pub(super) fn largest_drive(&self) -> f64 {
        self.adopted
            .as_ref()
            .map_or(f64::INFINITY, |adopted| adopted.largest_drive)
    }

    /// A displacement, velocity or acceleration at a point, at the end of the last step.
    pub(super) fn at_point(&self, reference: u32) -> f64 {
        let (n, quantity) = (
            (reference - FIRST_POINT_REFERENCE) / 3,
            (reference - FIRST_POINT_REFERENCE) % 3,
        );
        match (&self.adopted, &self.simulation) {
            (Some(adopted), Simulation::Structure(plant)) => adopted.points[n as usize].of(plant)[quantity as usize],
            _ => 0.0,
        }
    }
}
