//! A rig that is an FMU: ours, or anybody's with the same variable names.

use std::f64::consts::TAU;
use std::path::Path;

use phase_lock::Value;
use vines_testbench::rig::{Drive, GroundTruth, Measured, Rig, RigError, Sensors};
use vines_testbench::scene::{Definition, Names, Parameters, Reference as ReferenceSignal, Sensor};

use crate::instance::{Fmu, FmuError, Kind, Named, Reference, names_exist};

/// The names of this bench that a scene may map.
const NAMES: &str =
    "omega, E, e, response, base, impacts, impact_time, impact_velocity, M, k, c, m, b, r, q1, der(q1), q2, der(q2)";

/// A plant FMU, stepped sample by sample.
///
/// It needs the output that the sensor reads, `v` or `q1` (or what the scene maps `response` to), from which an acceleration follows, and
/// the inputs `omega` and `E`, or the input `e` for held samples of the base displacement, or both. Where it has `base`, that is the
/// reference sensor; where it has `impacts`, `impact_time`, `impact_velocity` and `der(q2)`, it reports its impacts. The parameters `M`,
/// `k`, `c`, `m`, `b`, `r` and the start `q1`, `der(q1)`, `q2`, `der(q2)` are set as far as the FMU has them. A scene maps all names.
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
}

impl FmuRig {
    /// Loads the plant at `path` and initialises it with parameters and a start, under the names of `LoViNes.fmu` or those that `names`
    /// maps them to. It has the sensors of `definition`, for a plant with the parameters `plant`.
    pub fn load(
        path: &Path,
        values: &[(&str, f64)],
        definition: Definition,
        plant: &Parameters,
        names: &Names,
    ) -> Result<Measured<Self>, FmuError> {
        names_exist(names, NAMES)?;
        let mut fmu = Fmu::load(path, "plant")?;
        let [omega, amplitude] = ["omega", "E"].map(|ours| fmu.named(Kind::Real, names, ours));
        let inputs = omega?.zip(amplitude?).map(|(omega, amplitude)| [omega, amplitude]);
        let held = match inputs {
            Some(_) => fmu.named(Kind::Real, names, "e")?,
            None => Some(fmu.need_named(Kind::Real, names, "e")?),
        };
        let ours = match definition.sensor {
            _ if names.mapped("response").is_some() => "response",
            Sensor::V => "v",
            Sensor::Q1 | Sensor::Acceleration => "q1",
        };
        let response = fmu.need_named(Kind::Real, names, ours)?;
        let reference = match definition.reference {
            ReferenceSignal::Base => fmu.named(Kind::Real, names, "base")?,
            ReferenceSignal::Force => Some(fmu.need_named(Kind::Real, names, "base")?),
        };
        let values = values.iter().map(|(name, value)| (*name, Value::Real(*value)));
        fmu.start(names, &values.collect::<Vec<_>>())?;
        let inside = Inside::of(&fmu, names)?;
        let rig = Self { fmu, inputs, held, phase: 0.0, response, reference, inside };
        Ok(Measured::new(rig, definition, plant))
    }
}

impl Inside {
    fn of(fmu: &Fmu, names: &Names) -> Result<Option<Self>, FmuError> {
        let real = |ours| fmu.named(Kind::Real, names, ours);
        let reals = [real("impact_time")?, real("impact_velocity")?, real("der(q2)")?];
        let (Some(impacts), [Some(a), Some(b), Some(c)]) = (fmu.switch(Kind::Integer, names, "impacts")?, reals) else {
            return Ok(None);
        };
        Ok(Some(Self { impacts, reals: [a, b, c] }))
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
        Ok(Some(GroundTruth {
            impacts: impacts.into(),
            impact_time,
            impact_velocity,
            particle_velocity,
        }))
    }
}
