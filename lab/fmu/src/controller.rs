//! A controller that is an FMU: ours, or anybody's with the same variable names.

use std::path::Path;

use fmi::fmi2::instance::Common;
use phase_lock::{Config, PARAMETERS, Value};
use vines_testbench::rig::{Command, Controller, ControllerError, Drive, Fault, LoopState, Sensors};

use crate::instance::{Fmu, FmuError, Kind, Reference};

/// A controller FMU, stepped sample by sample.
///
/// It needs the inputs `response` and `active` and the outputs `omega`, `E` and `settled`; `reference`, `drive`, `phase_error`,
/// `state` and `fault` are used where it has them. Of the configuration it gets what it has a parameter for, by the names of
/// `PhaseLock.fmu`. At each sample its inputs are set, it is stepped by one sample time, and what it then puts out is
/// the drive of that very sample period.
pub struct FmuController {
    fmu: Fmu,
    sample_time: f64,
    /// `response`, and `reference` where there is one.
    sensors: Vec<Reference>,
    active: Reference,
    /// `omega` and `E`.
    drive: [Reference; 2],
    displacement: Option<Reference>,
    phase_error: Option<Reference>,
    settled: Reference,
    /// `state` and `fault`.
    states: [Option<Reference>; 2],
}

impl FmuController {
    /// Loads the controller at `path` and initialises it with a configuration.
    ///
    /// # Errors
    /// An FMU that cannot be loaded, lacks a variable, or refuses a value.
    pub fn load(path: &Path, config: &Config) -> Result<Self, FmuError> {
        let mut fmu = Fmu::load(path, "controller")?;
        let mut sensors = vec![fmu.need(Kind::Real, "response")?];
        sensors.extend(fmu.find(Kind::Real, "reference"));
        let active = fmu.need(Kind::Boolean, "active")?;
        let drive = [fmu.need(Kind::Real, "omega")?, fmu.need(Kind::Real, "E")?];
        let settled = fmu.need(Kind::Boolean, "settled")?;
        fmu.start(&parameters(config))?;
        Ok(Self {
            sample_time: config.sample_time,
            sensors,
            active,
            drive,
            displacement: fmu.find(Kind::Real, "drive"),
            phase_error: fmu.find(Kind::Real, "phase_error"),
            settled,
            states: ["state", "fault"].map(|name| fmu.find(Kind::Integer, name)),
            fmu,
        })
    }

    fn optional(&mut self, reference: Option<Reference>) -> Result<f64, FmuError> {
        reference.map_or(Ok(0.0), |one| self.fmu.reals("give its outputs", [one]).map(|[x]| x))
    }

    fn integer(&mut self, reference: Option<Reference>) -> Result<Option<i32>, FmuError> {
        let Some(reference) = reference else {
            return Ok(None);
        };
        let mut value = [0];
        self.fmu
            .ask("give its outputs", |i| i.get_integer(&[reference], &mut value))?;
        Ok(Some(value[0]))
    }

    fn exchange(&mut self, sensors: Sensors, active: bool) -> Result<Command, FmuError> {
        let readings = [sensors.response, sensors.reference.unwrap_or(0.0)];
        let (references, active_reference) = (&self.sensors, [self.active]);
        self.fmu.ask("take its inputs", |i| {
            i.set_real(references, &readings[..references.len()])?;
            i.set_boolean(&active_reference, &[active.into()])
        })?;
        self.fmu.step(self.sample_time)?;
        let [omega, amplitude] = self.fmu.reals("give its outputs", self.drive)?;
        let (reference, mut settled) = ([self.settled], [0]);
        self.fmu
            .ask("give its outputs", |i| i.get_boolean(&reference, &mut settled))?;
        Ok(Command {
            drive: Drive {
                omega,
                amplitude,
                displacement: self.optional(self.displacement)?,
            },
            phase_error: self.optional(self.phase_error)?,
            settled: settled != [0],
            state: self.integer(self.states[0])?.and_then(LoopState::of_number),
            fault: self.integer(self.states[1])?.and_then(Fault::of_number),
        })
    }
}

impl Controller for FmuController {
    fn sample(&mut self, sensors: Sensors, active: bool) -> Result<Command, ControllerError> {
        Ok(self.exchange(sensors, active)?)
    }
}

/// The configuration under the names of the FMU's parameters.
fn parameters(config: &Config) -> Vec<(&'static str, Value)> {
    PARAMETERS
        .iter()
        .map(|parameter| (parameter.name, parameter.get(config)))
        .collect()
}
