//! A controller that is an FMU: ours, or anybody's with the same variable names.

use std::path::Path;

use fmi::fmi2::instance::Common;
use phase_lock::{Config, MOVE, PARAMETERS, Value};
use vines_testbench::rig::{Command, Controller, ControllerError, Drive, Fault, LoopState, Move, Sensors};

use crate::instance::{Fmu, FmuError, Kind, Reference};

/// A controller FMU, stepped sample by sample.
///
/// It needs the inputs `response` and `active` and the outputs `omega`, `E` and `settled`; `reference`, `drive`, `phase_error`,
/// `phase_measured`, `state` and `fault` are used where it has them, and for the control of the response the parameter `phase_target`
/// and the inputs `hold_response` and `move.*`. Of the configuration it gets what it has a parameter for, by the names of
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
    phase_measured: Option<Reference>,
    settled: Reference,
    /// `state` and `fault`.
    states: [Option<Reference>; 2],
    response_loop: Option<ResponseLoop>,
}

/// Variables of a controller that can control the response.
struct ResponseLoop {
    /// `phase_target` and the fields of the move, in the order of the core's table.
    reals: Vec<Reference>,
    hold: Reference,
}

impl ResponseLoop {
    fn of(fmu: &Fmu) -> Option<Self> {
        let names = MOVE.iter().map(|(name, _)| format!("move.{name}"));
        let mut reals = std::iter::once("phase_target".to_owned()).chain(names);
        Some(Self {
            reals: reals.try_fold(Vec::new(), |mut found, name| {
                found.push(fmu.find(Kind::Real, &name)?);
                Some(found)
            })?,
            hold: fmu.find(Kind::Boolean, "hold_response")?,
        })
    }
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
            phase_measured: fmu.find(Kind::Boolean, "phase_measured"),
            response_loop: ResponseLoop::of(&fmu),
            settled,
            states: ["state", "fault"].map(|name| fmu.find(Kind::Integer, name)),
            fmu,
        })
    }

    fn optional(&mut self, reference: Option<Reference>) -> Result<Option<f64>, FmuError> {
        let value = reference.map(|one| self.fmu.reals("give its outputs", [one]).map(|[x]| x));
        value.transpose()
    }

    fn boolean(&mut self, reference: Reference) -> Result<bool, FmuError> {
        let (reference, mut value) = ([reference], [0]);
        self.fmu
            .ask("give its outputs", |i| i.get_boolean(&reference, &mut value))?;
        Ok(value != [0])
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
        let settled = self.boolean(self.settled)?;
        let measured = self.phase_measured.map_or(Ok(true), |one| self.boolean(one))?;
        let phase_error = self.optional(self.phase_error.filter(|_| measured))?;
        Ok(Command {
            drive: Drive {
                omega,
                amplitude,
                displacement: self.optional(self.displacement)?.unwrap_or(0.0),
            },
            phase_error,
            settled,
            state: self.integer(self.states[0])?.and_then(LoopState::of_number),
            fault: self.integer(self.states[1])?.and_then(Fault::of_number),
        })
    }
}

impl Controller for FmuController {
    fn sample(&mut self, sensors: Sensors, active: bool) -> Result<Command, ControllerError> {
        Ok(self.exchange(sensors, active)?)
    }

    fn hold_response(&mut self, to: Move, phase_target: f64) -> Result<(), ControllerError> {
        let inputs = self.response_loop.as_ref().ok_or(ControllerError::NoResponseLoop)?;
        let Move { response, duration, amplitude, omega } = to;
        let values = [phase_target, response, duration, amplitude, omega];
        self.fmu.ask("take its inputs", |i| {
            i.set_real(&inputs.reals, &values)?;
            i.set_boolean(&[inputs.hold], &[true.into()])
        })?;
        Ok(())
    }
}

/// The configuration under the names of the FMU's parameters.
fn parameters(config: &Config) -> Vec<(&'static str, Value)> {
    PARAMETERS
        .iter()
        .map(|parameter| (parameter.name, parameter.get(config)))
        .collect()
}
