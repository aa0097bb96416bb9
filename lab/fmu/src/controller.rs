//! A controller that is an FMU: ours, or anybody's with the same variable names.

use std::path::Path;

use phase_lock::{Config, MOVE, PARAMETERS};
use vines_testbench::rig::{Command, Controller, ControllerError, Drive, Fault, LoopState, Move, Sensors};
use vines_testbench::scene::Names;

use crate::instance::{FmiType, Fmu, FmuError, Variable};

/// The names of this bench that a scene may map, beside those of the parameters.
const NAMES: &str = "response, reference, active, omega, E, drive, phase_error, phase_measured, hold_response, \
                     settled, locked, state, fault";

/// A controller FMU, stepped sample by sample.
///
/// It needs the inputs `response` and `active` and the outputs `omega` and `E`. Without the output `settled`, the lab judges whether the
/// lock has settled, by `locked`, the phase error and the frequency. `reference`, `drive`, `phase_error`,
/// `phase_measured`, `state` and `fault` are used where it has them, and for the control of the response the parameter `phase_target`
/// and the inputs `hold_response` and `move.*`. A scene maps all names. Of the configuration it gets what it has a parameter for, by the names of
/// `PhaseLock.fmu`. At each sample its inputs are set, it is stepped by one sample time, and what it then puts out is
/// the drive of that very sample period.
pub struct FmuController {
    fmu: Fmu,
    sample_time: f64,
    response: Variable,
    reference: Option<Variable>,
    active: Variable,
    omega: Variable,
    amplitude: Variable,
    displacement: Option<Variable>,
    phase_error: Option<Variable>,
    phase_measured: Option<Variable>,
    /// Whether the lock has settled, as the controller reports it; otherwise the bench judges, while `locked` is true where the controller has it.
    settled: Option<Variable>,
    locked: Option<Variable>,
    state: Option<Variable>,
    fault: Option<Variable>,
    /// `phase_target` and the fields of the move, in the order of the core's table, and `hold_response`.
    response_loop: Option<(Vec<Variable>, Variable)>,
}

impl FmuController {
    /// Loads the controller at `path` and initialises it with a configuration.
    pub fn load(path: &Path, config: &Config, names: &Names) -> Result<Self, FmuError> {
        let moves = MOVE.iter().map(|(name, _)| format!("move.{name}"));
        let moves: Vec<String> = moves.collect();
        let parameters = PARAMETERS.iter().map(|parameter| parameter.name);
        let known = std::iter::once(NAMES)
            .chain(parameters)
            .chain(moves.iter().map(String::as_str));
        let fmu = Fmu::load(path, "controller", names, &known.collect::<Vec<_>>().join(", "))?;
        let (real, boolean) = (
            |ours| fmu.find(FmiType::Real, ours),
            |ours| fmu.find(FmiType::Boolean, ours),
        );
        let (settled, locked, phase_error) = (boolean("settled")?, boolean("locked")?, real("phase_error")?);
        if settled.is_none() && locked.is_none() && phase_error.is_none() {
            log::warn!(
                "{} has none of `settled`, `locked` and `phase_error`: its lock is judged by its frequency alone",
                path.display()
            );
        }
        let targets = std::iter::once("phase_target").chain(moves.iter().map(String::as_str));
        let targets: Option<Vec<Variable>> = targets.map(real).collect::<Result<_, _>>()?;
        let values = PARAMETERS
            .iter()
            .map(|parameter| (parameter.name, parameter.get(config)));
        let mut controller = Self {
            sample_time: config.sample_time,
            response: fmu.need(FmiType::Real, "response")?,
            reference: real("reference")?,
            active: fmu.need(FmiType::Boolean, "active")?,
            omega: fmu.need(FmiType::Real, "omega")?,
            amplitude: fmu.need(FmiType::Real, "E")?,
            displacement: real("drive")?,
            phase_error,
            phase_measured: boolean("phase_measured")?,
            settled,
            locked,
            state: fmu.find(FmiType::Integer, "state")?,
            fault: fmu.find(FmiType::Integer, "fault")?,
            response_loop: targets.zip(boolean("hold_response")?),
            fmu,
        };
        controller.fmu.start(&values.collect::<Vec<_>>())?;
        Ok(controller)
    }

    fn exchange(&mut self, sensors: Sensors, active: bool) -> Result<Command, FmuError> {
        let fmu = &mut self.fmu;
        fmu.set(self.response, sensors.response)?;
        if let Some(reference) = self.reference {
            fmu.set(reference, sensors.reference.unwrap_or(0.0))?;
        }
        fmu.set(self.active, f64::from(u8::from(active)))?;
        fmu.step(self.sample_time)?;
        let drive = Drive {
            omega: fmu.get(self.omega)?,
            amplitude: fmu.get(self.amplitude)?,
            displacement: fmu.get_if(self.displacement)?.unwrap_or(0.0),
        };
        // A phase that cannot be measured now is none to judge by.
        let measured = fmu.get_if(self.phase_measured)? != Some(0.0);
        let phase_error = fmu.get_if(self.phase_error.filter(|_| measured))?;
        let settled = match fmu.get_if(self.settled)? {
            Some(settled) => Some(settled != 0.0),
            // The bench judges a lock that the controller may have.
            None => (!measured || fmu.get_if(self.locked)? == Some(0.0)).then_some(false),
        };
        let [state, fault] = [self.state, self.fault].map(|variable| fmu.get_if(variable));
        Ok(Command {
            drive,
            phase_error,
            settled,
            state: state?.and_then(|number| LoopState::of_number(number as i32)),
            fault: fault?.and_then(|number| Fault::of_number(number as i32)),
        })
    }
}

impl Controller for FmuController {
    fn sample(&mut self, sensors: Sensors, active: bool) -> Result<Command, ControllerError> {
        Ok(self.exchange(sensors, active)?)
    }

    fn hold_response(&mut self, to: Move, phase_target: f64) -> Result<(), ControllerError> {
        let (inputs, hold) = self.response_loop.as_ref().ok_or(ControllerError::NoResponseLoop)?;
        let Move { response, duration, amplitude, omega, growth } = to;
        let values = [phase_target, response, duration, amplitude, omega, growth];
        for (input, value) in inputs.iter().zip(values) {
            self.fmu.set(*input, value)?;
        }
        Ok(self.fmu.set(*hold, 1.0)?)
    }

    fn hold_drive(&mut self) -> Result<(), ControllerError> {
        let (_, hold) = self.response_loop.as_ref().ok_or(ControllerError::NoResponseLoop)?;
        Ok(self.fmu.set(*hold, 0.0)?)
    }
}
