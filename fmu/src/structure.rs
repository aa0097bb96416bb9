//! A structure in the place of the oscillator: what the resources of `Structure.fmu` say of it, and its outputs.

use fmi2_component::{Model as _, Refusal, Resources, foreign, guid_of};
use lovines::host::{Equations, Row};
use lovines::table::Values;
use lovines::{Excitation, Host, Parameters, Plant, Refused, State, Structure, StructureState};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::ops::Range;

use super::variables::Model;
use super::{LoViNes, Simulation};

/// The file in `resources/`.
const FILE: &str = "structure.json";

/// Value reference of the first output at a point. Those of point n are `FIRST + 3 n` for its displacement, velocity and acceleration.
const FIRST: u32 = 1000;

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
    /// Start values of parameters, by symbol.
    parameters: BTreeMap<String, f64>,
    /// Displacement and velocity of the particle at the start, m and m/s.
    particle: [f64; 2],
}

/// A point: its displacement in the sections of the host.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Point {
    name: String,
    row: Row,
}

/// The structure and its points.
#[derive(Debug)]
pub(super) struct Adopted {
    host: Host,
    /// The row of each point.
    points: Vec<Row>,
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
        if let Some(point) = file.points.iter().find(|point| point.row.len() != size) {
            return Err(refused(format!(
                "the row of {} has {} pairs; expected {size}",
                point.name,
                point.row.len()
            )));
        }
        let points = file.points.into_iter().map(|point| point.row).collect();
        Ok(Self { host, points, values, particle: file.particle })
    }

    /// A plant at its start.
    pub fn plant(&self, parameters: Parameters, start: State) -> Result<Plant<Structure>, Refused> {
        let start = StructureState { q2: start.q2, dq2: start.dq2, ..StructureState::default() };
        Plant::with_host(self.host.clone(), parameters, &start)
    }

    /// The value references of the outputs at its points.
    pub fn outputs(&self) -> Range<u32> {
        FIRST..FIRST + 3 * self.points.len() as u32
    }

    /// The largest displacement of the cavity that a constant drive can cause, m per unit.
    pub fn displacement_per_drive(&self) -> f64 {
        let sections = self.host.sections().iter();
        sections
            .map(|section| (section.cavity[0] * section.drive[0] / section.oscillator.omega0_squared).abs())
            .sum()
    }
}

impl LoViNes {
    /// A displacement, velocity or acceleration at a point, at the end of the last step.
    pub(super) fn at_point(&self, reference: u32) -> f64 {
        let (n, quantity) = ((reference - FIRST) / 3, (reference - FIRST) % 3);
        match (&self.adopted, &self.simulation) {
            (Some(adopted), Simulation::Structure(plant)) => {
                plant.point(&adopted.points[n as usize])[quantity as usize]
            }
            _ => 0.0,
        }
    }
}
