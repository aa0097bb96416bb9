//! A rig that is an FMU: ours, or anybody's with the same variable names.

use std::f64::consts::TAU;
use std::path::Path;

use phase_lock::Value;
use vines_testbench::rig::{Drive, FrictionTotals, GroundTruth, Measured, Rig, RigError, Sensors, has_friction};
use vines_testbench::scene::{Definition, Names, Parameters, Reference as ReferenceSignal, Sensor};

use crate::instance::{FmiType, Fmu, FmuError, Named, Reference, names_exist};

/// The names of this bench that a scene may map.
const NAMES: &str = "omega, E, e, response, base, impacts, impact_time, impact_velocity, sticks, stuck_time, friction_loss, M, k, c, \
                     m, b, r, b_plus, b_minus, theta, mu_k, mu_s, r_law, r_plus, r_minus, r_min, r_scatter, seed, q1, der(q1), q2, \
                     der(q2)";

/// A plant FMU, stepped sample by sample.
///
/// It needs the output that the sensor reads, `v` or `q1` (or what the scene maps `response` to), from which an acceleration follows, and
/// the inputs `omega` and `E`, or the input `e` for held samples of the base displacement, or both. Where it has `base`, that is the
/// reference sensor; where it has `impacts`, `impact_time`, `impact_velocity` and `der(q2)`, it reports its impacts. The parameters `M`,
/// `k`, `c`, `m`, `b`, `r`, those of the scene's real cavity, and the start `q1`, `der(q1)`, `q2`, `der(q2)` are set as far as the FMU has
/// them. A scene maps all names.
pub struct FmuRig {
    fmu: Fmu,
    /// `omega` and `E`.
    inputs: Option<[Named; 2]>,
    /// `e`, for held samples of the base displacement.
    held: Option<Named>,
    /// Phase of the base for an FMU without an oscillator, rad.
    phase: f64,
    response: Named,
    reference: Option<Named>,
    inside: Option<Inside>,
}

/// The variables of the ground truth.
#[derive(Clone, Copy)]
struct Inside {
    impacts: Reference,
    /// `impact_time`, `impact_velocity` and `der(q2)`.
    reals: [Named; 3],
    /// `sticks`, and `stuck_time` and `friction_loss`, for a plant with friction.
    friction: Option<(Reference, [Named; 2])>,
}

impl FmuRig {
    /// Loads the plant at `path` and initialises it with parameters and a start, under the names of `LoViNes.fmu` or those that `names`
    /// maps them to. It has the sensors of `definition`, for a plant with the parameters `plant`.
    pub fn load(
        path: &Path,
        values: &[(&str, Value)],
        definition: Definition,
        plant: &Parameters,
        names: &Names,
    ) -> Result<Measured<Self>, FmuError> {
        names_exist(names, NAMES)?;
        let mut fmu = Fmu::load(path, "plant")?;
        let [omega, amplitude] = ["omega", "E"].map(|ours| fmu.named(FmiType::Real, names, ours));
        let inputs = omega?.zip(amplitude?).map(|(omega, amplitude)| [omega, amplitude]);
        let held = match inputs {
            Some(_) => fmu.named(FmiType::Real, names, "e")?,
            None => Some(fmu.need(FmiType::Real, names, "e")?),
        };
        let ours = match definition.sensor {
            _ if names.mapped("response").is_some() => "response",
            Sensor::V => "v",
            Sensor::Q1 | Sensor::Acceleration => "q1",
        };
        let response = fmu.need(FmiType::Real, names, ours)?;
        let reference = match definition.reference {
            ReferenceSignal::Base => fmu.named(FmiType::Real, names, "base")?,
            ReferenceSignal::Force => Some(fmu.need(FmiType::Real, names, "base")?),
        };
        fmu.start(names, values)?;
        let inside = Inside::of(&fmu, names, has_friction(plant))?;
        let rig = Self { fmu, inputs, held, phase: 0.0, response, reference, inside };
        Ok(Measured::new(rig, definition, plant))
    }
}

impl Inside {
    fn of(fmu: &Fmu, names: &Names, has_friction: bool) -> Result<Option<Self>, FmuError> {
        let real = |ours| fmu.named(FmiType::Real, names, ours);
        let reals = [real("impact_time")?, real("impact_velocity")?, real("der(q2)")?];
        let (Some(impacts), [Some(a), Some(b), Some(c)]) = (fmu.switch(FmiType::Integer, names, "impacts")?, reals)
        else {
            return Ok(None);
        };
        let sticks = fmu.switch(FmiType::Integer, names, "sticks")?.filter(|_| has_friction);
        let losses = real("stuck_time")?.zip(real("friction_loss")?);
        let friction = sticks.zip(losses.map(|(time, loss)| [time, loss]));
        Ok(Some(Self { impacts, reals: [a, b, c], friction }))
    }
}

impl Rig for FmuRig {
    fn sense(&mut self) -> Result<Sensors, RigError> {
        let read = "read its sensors";
        let [response] = self.fmu.read(read, [self.response])?;
        let reference = self.reference.map(|reference| self.fmu.read(read, [reference]));
        let reference = reference.transpose()?.map(|[value]| value);
        Ok(Sensors { response, reference })
    }

    fn advance(&mut self, drive: Drive, step: f64) -> Result<(), RigError> {
        let Some(inputs) = self.inputs else {
            // The middle of the step: the mean of what is held is then in time.
            let displacement = drive.amplitude * (self.phase + 0.5 * drive.omega * step).sin();
            self.phase = (self.phase + drive.omega * step) % TAU;
            return self.hold(Drive { displacement, ..drive }, step);
        };
        self.fmu
            .write("take a drive", &inputs, &[drive.omega, drive.amplitude])?;
        Ok(self.fmu.step(step)?)
    }

    fn hold(&mut self, drive: Drive, step: f64) -> Result<(), RigError> {
        let mut inputs = vec![self.held.ok_or(RigError::NoHold)?];
        inputs.extend(self.inputs.map(|[_, amplitude]| amplitude));
        let values = [drive.displacement, 0.0];
        self.fmu.write("take a sample of the base", &inputs, &values)?;
        Ok(self.fmu.step(step)?)
    }

    fn ground_truth(&mut self) -> Result<Option<GroundTruth>, RigError> {
        let Some(inside) = self.inside else {
            return Ok(None);
        };
        let action = "report its impacts";
        let [impact_time, impact_velocity, particle_velocity] = self.fmu.read(action, inside.reals)?;
        let impacts = self.fmu.integer(action, inside.impacts)?;
        let friction = inside.friction.map(|(sticks, reals)| -> Result<_, FmuError> {
            let [stuck_time, loss] = self.fmu.read(action, reals)?;
            let sticks = self.fmu.integer(action, sticks)?.into();
            Ok(FrictionTotals { sticks, stuck_time, loss })
        });
        Ok(Some(GroundTruth {
            impacts: impacts.into(),
            impact_time,
            impact_velocity,
            particle_velocity,
            friction: friction.transpose()?,
        }))
    }
}
