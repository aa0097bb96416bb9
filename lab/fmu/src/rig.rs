//! A rig that is an FMU: ours, or anybody's with the same variable names.

use std::path::Path;

use fmi::fmi2::instance::Common;
use phase_lock::Value;
use vines_testbench::rig::{Drive, GroundTruth, Measured, Rig, RigError, Sensors};
use vines_testbench::scene::{Definition, Parameters, Reference as ReferenceSignal, Sensor};

use crate::instance::{Fmu, FmuError, Kind, Reference};

/// A plant FMU, stepped sample by sample.
///
/// It needs the inputs `omega` and `E` and the output that the sensor reads, `v` or `q1`, from which an acceleration follows; with the input `e` it can be driven by held samples, too. Where it has `base`, that is the reference sensor; where it has
/// `impacts`, `impact_time`, `impact_velocity` and `der(q2)`, it reports its impacts. The parameters `M`, `k`, `c`, `m`, `b`, `r`
/// and the start `q1`, `der(q1)`, `q2`, `der(q2)` are set as far as the FMU has them.
pub struct FmuRig {
    fmu: Fmu,
    inputs: [Reference; 2],
    /// `e`, for held samples of the base displacement.
    held: Option<Reference>,
    response: Reference,
    reference: Option<Reference>,
    inside: Option<Inside>,
}

/// The variables of the ground truth.
#[derive(Clone, Copy)]
struct Inside {
    impacts: Reference,
    /// `impact_time`, `impact_velocity` and `der(q2)`.
    reals: [Reference; 3],
}

impl FmuRig {
    /// Loads the plant at `path` and initialises it with parameters and a start, under the names of `LoViNes.fmu`. It has the sensors of
    /// `definition`, for a plant with the parameters `plant`.
    ///
    /// # Errors
    /// An FMU that cannot be loaded, lacks a variable, or refuses a value.
    pub fn load(
        path: &Path,
        values: &[(&str, f64)],
        definition: Definition,
        plant: &Parameters,
    ) -> Result<Measured<Self>, FmuError> {
        let mut fmu = Fmu::load(path, "plant")?;
        let inputs = [fmu.need(Kind::Real, "omega")?, fmu.need(Kind::Real, "E")?];
        let response = match definition.sensor {
            Sensor::V => fmu.need(Kind::Real, "v")?,
            Sensor::Q1 | Sensor::Acceleration => fmu.need(Kind::Real, "q1")?,
        };
        let reference = match definition.reference {
            ReferenceSignal::Base => fmu.find(Kind::Real, "base"),
            ReferenceSignal::Force => Some(fmu.need(Kind::Real, "base")?),
        };
        let values = values.iter().map(|(name, value)| (*name, Value::Real(*value)));
        fmu.start(&values.collect::<Vec<_>>())?;
        let rig = Self {
            inputs,
            held: fmu.find(Kind::Real, "e"),
            response,
            reference,
            inside: Inside::of(&fmu),
            fmu,
        };
        Ok(Measured::new(rig, definition, plant))
    }
}

impl Inside {
    fn of(fmu: &Fmu) -> Option<Self> {
        let real = |name| fmu.find(Kind::Real, name);
        Some(Self {
            impacts: fmu.find(Kind::Integer, "impacts")?,
            reals: [real("impact_time")?, real("impact_velocity")?, real("der(q2)")?],
        })
    }
}

impl Rig for FmuRig {
    fn sense(&mut self) -> Result<Sensors, RigError> {
        let read = "read its sensors";
        let (response, reference) = match self.reference {
            Some(reference) => {
                let [v, base] = self.fmu.reals(read, [self.response, reference])?;
                (v, Some(base))
            }
            None => (self.fmu.reals(read, [self.response])?[0], None),
        };
        Ok(Sensors { response, reference })
    }

    fn advance(&mut self, drive: Drive, step: f64) -> Result<(), RigError> {
        let references = self.inputs;
        self.fmu.ask("take a drive", |i| {
            i.set_real(&references, &[drive.omega, drive.amplitude])
        })?;
        Ok(self.fmu.step(step)?)
    }

    fn hold(&mut self, displacement: f64, step: f64) -> Result<(), RigError> {
        let held = self.held.ok_or(RigError::NoHold)?;
        let [_, amplitude] = self.inputs;
        self.fmu.ask("take a sample of the base", |i| {
            i.set_real(&[held, amplitude], &[displacement, 0.0])
        })?;
        Ok(self.fmu.step(step)?)
    }

    fn ground_truth(&mut self) -> Result<Option<GroundTruth>, RigError> {
        let Some(inside) = self.inside else {
            return Ok(None);
        };
        let action = "report its impacts";
        let [impact_time, impact_velocity, particle_velocity] = self.fmu.reals(action, inside.reals)?;
        let mut impacts = [0];
        self.fmu
            .ask(action, |i| i.get_integer(&[inside.impacts], &mut impacts))?;
        Ok(Some(GroundTruth {
            impacts: i64::from(impacts[0]),
            impact_time,
            impact_velocity,
            particle_velocity,
        }))
    }
}
