//! A rig that is an FMU: ours, or anybody's with the same variable names.

use std::f64::consts::TAU;
use std::path::Path;

use lovines::table::PARAMETERS as PLANT_PARAMETERS;
use phase_lock::Value;
use vines_rig::{
    Definition, Drive, FrictionTotals, GroundTruth, Names, Reference as ReferenceSignal, Rig, RigError, Sensors,
};

use crate::instance::{Connection, Fmu, FmuError, Use, Variable, connections};

/// What the bench uses beside the parameters, with SI units.
const RIG_VARIABLES: [(&str, &str); 16] = [
    ("omega", "rad/s"),
    ("E", "m"),
    ("e", "m"),
    ("response", "m"),
    ("v", "m"),
    ("base", "m"),
    ("impacts", ""),
    ("impact_time", "s"),
    ("impact_velocity", "m/s"),
    ("sticks", ""),
    ("stuck_time", "s"),
    ("friction_loss", "J"),
    ("q1", "m"),
    ("der(q1)", "m/s"),
    ("q2", "m"),
    ("der(q2)", "m/s"),
];

/// Variables with a start value in the scene.
const START_VARIABLES: [&str; 4] = ["q1", "der(q1)", "q2", "der(q2)"];

/// All that the bench uses, with SI units: of response and base those of the scene's definition where the scene maps them.
fn used(names: &Names, definition: Definition) -> Vec<(String, &'static str)> {
    let parameters = PLANT_PARAMETERS.iter().map(|row| (row.symbol, row.unit));
    let measured = [
        ("response", definition.sensor_quantity),
        ("base", definition.reference_quantity),
    ];
    let unit = |(name, unit)| {
        let channel = measured
            .into_iter()
            .find(|(ours, _)| *ours == name && names.mapped(name).is_some());
        (
            name.to_owned(),
            channel.map_or(unit, |(_, quantity)| quantity.unit_in_ascii()),
        )
    };
    RIG_VARIABLES.into_iter().chain(parameters).map(unit).collect()
}

/// What the bench asks of the FMU of a plant.
pub struct Asked<'a> {
    /// What the FMU calls its variables.
    pub names: &'a Names,
    /// What is measured.
    pub definition: Definition,
    /// Time from sample to sample, s.
    pub sample_time: f64,
    /// Names and units of the amplitude of the drive, of its signal, and of the reference.
    pub drive: [(&'static str, &'static str); 3],
    /// The response, by the name of this bench.
    pub response: String,
    /// The displacement of a force cell whose mass is compensated.
    pub cell: Option<String>,
    /// Parameters and start values, by the names of this bench, SI units.
    pub starts: Vec<(&'static str, Value)>,
    /// Whether there is friction in the cavity, so that what it does is read.
    pub has_friction: bool,
    /// -1 where the response is this variable with the opposite sign, else 1.
    pub direction: f64,
}

/// A plant FMU, stepped sample by sample.
///
/// It needs the output that the sensor reads, `v` or `q1`, from which a velocity or an acceleration follows (or what the scene maps `response`
/// to, which is read as it is), and
/// the inputs `omega` and `E`, or the input `e` for held samples of the base displacement, or both. Where it has `base`, that is the
/// reference sensor; where it has `impacts`, `impact_time`, `impact_velocity` and `der(q2)`, it reports its impacts. The parameters `M`,
/// `k`, `c`, `m`, `b`, `r`, those of the scene's real cavity, and the start `q1`, `der(q1)`, `q2`, `der(q2)` are set as far as the FMU has
/// them. A scene maps all names.
///
/// Of a scene with a structure it is the FMU of that structure: with its inputs, and the displacement at the sensor as output `q[POINT]`.
pub struct FmuRig {
    fmu: Fmu,
    /// `omega` and `E`.
    inputs: Option<[Variable; 2]>,
    /// `e`, for held samples of the base displacement.
    held: Option<Variable>,
    /// Phase of the base for an FMU without an oscillator, rad.
    phase: f64,
    response: Variable,
    reference: Option<Variable>,
    /// Displacement of a force cell whose mass is compensated.
    cell: Option<Variable>,
    inside: Option<Inside>,
    /// -1 where the response is this variable with the opposite sign, else 1.
    direction: f64,
}

/// The variables of the ground truth.
#[derive(Clone, Copy)]
struct Inside {
    impacts: Variable,
    /// `impact_time`, `impact_velocity` and `der(q2)`.
    reals: [Variable; 3],
    /// `sticks`, `stuck_time` and `friction_loss`, for a plant with friction.
    friction: Option<[Variable; 3]>,
}

impl FmuRig {
    /// Loads the plant at `path` and initialises it, under the names of `LoViNes.fmu` or those that they are mapped to. Its response and reference are
    /// displacements, or what the mapped variables measure.
    pub fn load(path: &Path, asked: &Asked) -> Result<Self, FmuError> {
        let Asked { names, definition, .. } = *asked;
        let mut used = used(names, definition);
        let displacements = asked.cell.iter().chain([&asked.response]);
        used.extend(displacements.map(|name| (name.clone(), "m")));
        used.extend(asked.drive.iter().map(|(name, unit)| ((*name).to_owned(), *unit)));
        let mut fmu = Fmu::load(path, "plant", names, &used, asked.sample_time)?;
        let [amplitude, signal, total] = asked.drive.map(|(name, _)| name);
        let inputs = fmu
            .find("omega", Use::Set)
            .zip(fmu.find(amplitude, Use::Set))
            .map(|(omega, amplitude)| [omega, amplitude]);
        let held = match inputs {
            Some(_) => fmu.find(signal, Use::Set),
            None => Some(fmu.need(signal, Use::Set)?),
        };
        let response = fmu.need(&asked.response, Use::Get)?;
        let reference = match definition.reference {
            ReferenceSignal::Base => fmu.find(total, Use::Get),
            ReferenceSignal::Force => Some(fmu.need(total, Use::Get)?),
        };
        let cell = asked.cell.as_ref().map(|name| fmu.need(name, Use::Get)).transpose()?;
        fmu.start(&asked.starts)?;
        let inside = Inside::of(&fmu, asked.has_friction);
        Ok(Self {
            fmu,
            inputs,
            held,
            phase: 0.0,
            response,
            reference,
            cell,
            inside,
            direction: asked.direction,
        })
    }

    /// What the bench uses, and what of it the FMU at `path` has.
    pub fn connections(path: &Path, names: &Names, definition: Definition) -> Result<Vec<Connection>, FmuError> {
        let parameters = PLANT_PARAMETERS.iter().map(|row| row.symbol);
        let starts: Vec<&str> = START_VARIABLES.into_iter().chain(parameters).collect();
        connections(path, names, &used(names, definition), &starts)
    }
}

impl Inside {
    fn of(fmu: &Fmu, has_friction: bool) -> Option<Self> {
        let found = |ours| fmu.find(ours, Use::Get);
        let reals = [found("impact_time"), found("impact_velocity"), found("der(q2)")];
        let (Some(impacts), [Some(a), Some(b), Some(c)]) = (found("impacts"), reals) else {
            return None;
        };
        let sticks = found("sticks").filter(|_| has_friction);
        let losses = found("stuck_time").zip(found("friction_loss"));
        let friction = sticks.zip(losses).map(|(sticks, (time, loss))| [sticks, time, loss]);
        Some(Self { impacts, reals: [a, b, c], friction })
    }
}

impl Rig for FmuRig {
    fn sense(&mut self) -> Result<Sensors, RigError> {
        Ok(Sensors {
            response: self.direction * self.fmu.get(self.response)?,
            reference: self.fmu.get_if(self.reference)?,
        })
    }

    fn advance(&mut self, drive: Drive, step: f64) -> Result<(), RigError> {
        let Drive { omega, amplitude, mut displacement, is_held } = drive;
        if let Some([of_omega, of_amplitude]) = self.inputs.filter(|_| !is_held) {
            self.fmu.set(of_omega, omega)?;
            self.fmu.set(of_amplitude, amplitude)?;
            return Ok(self.fmu.step(step)?);
        }
        if !is_held {
            // The middle of the step: the mean of what is held is then in time.
            displacement = amplitude * (self.phase + 0.5 * omega * step).sin();
            self.phase = (self.phase + omega * step) % TAU;
        }
        self.fmu.set(self.held.ok_or(RigError::NoHold)?, displacement)?;
        if let Some([_, of_amplitude]) = self.inputs {
            self.fmu.set(of_amplitude, 0.0)?;
        }
        Ok(self.fmu.step(step)?)
    }

    fn cell_displacement(&mut self) -> Result<f64, RigError> {
        Ok(self.fmu.get_if(self.cell)?.unwrap_or(0.0))
    }

    fn ground_truth(&mut self) -> Result<Option<GroundTruth>, RigError> {
        let Some(inside) = self.inside else {
            return Ok(None);
        };
        let mut get = |variable| self.fmu.get(variable);
        let [time, velocity, particle] = inside.reals.map(&mut get);
        let friction = inside.friction.map(|variables| -> Result<_, FmuError> {
            let [sticks, stuck_time, loss] = variables.map(&mut get);
            Ok(FrictionTotals { sticks: sticks? as i64, stuck_time: stuck_time?, loss: loss? })
        });
        Ok(Some(GroundTruth {
            impact_time: time?,
            impact_velocity: velocity?,
            particle_velocity: particle?,
            friction: friction.transpose()?,
            impacts: get(inside.impacts)? as i64,
        }))
    }
}
