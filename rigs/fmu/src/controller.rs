//! A controller that is an FMU: ours, or anybody's with the same variable names.

use std::path::Path;

use phase_lock::{Config, MOVE, PARAMETERS};
use vines_rig::Names;
use vines_rig::{Command, Controller, ControllerError, Drive, Fault, LoopState, Move, Sensors};

use crate::instance::{Connection, Fmu, FmuError, Use, Variable, connections};

/// What the bench uses beside the parameters and the fields of a move, with SI units.
const CONTROLLER_VARIABLES: [(&str, &str); 13] = [
    ("response", "m"),
    ("reference", "m"),
    ("active", ""),
    ("omega", "rad/s"),
    ("E", "m"),
    ("drive", "m"),
    ("phase_error", "rad"),
    ("phase_measured", ""),
    ("hold_response", ""),
    ("settled", ""),
    ("locked", ""),
    ("state", ""),
    ("fault", ""),
];

/// All that the bench uses, with SI units.
fn used() -> Vec<(String, &'static str)> {
    let parameters = PARAMETERS.iter().map(|parameter| (parameter.name, parameter.unit));
    let named = CONTROLLER_VARIABLES.into_iter().chain(parameters);
    let moves = MOVE.map(|(name, unit)| (format!("move.{name}"), unit));
    named.map(|(name, unit)| (name.to_owned(), unit)).chain(moves).collect()
}

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
    /// `hold_response`, `phase_target` and the fields of the move, in the order of the core's table; or the names of those that are missing.
    response_loop: Result<Vec<Variable>, Vec<String>>,
}

impl FmuController {
    /// Loads the controller at `path` and initialises it with a configuration.
    pub fn load(path: &Path, config: &Config, names: &Names) -> Result<Self, FmuError> {
        let fmu = Fmu::load(path, "controller", names, &used(), config.sample_time)?;
        let read = |name: &str| fmu.find(name, Use::Get);
        let (settled, locked, phase_error) = (read("settled"), read("locked"), read("phase_error"));
        if settled.is_none() && locked.is_none() && phase_error.is_none() {
            log::warn!(
                "{} has none of `settled`, `locked` and `phase_error`: its lock is judged by its frequency alone",
                path.display()
            );
        }
        let moves = MOVE.map(|(name, _)| format!("move.{name}"));
        let inputs = ["hold_response", "phase_target"]
            .into_iter()
            .map(str::to_owned)
            .chain(moves);
        let inputs: Vec<_> = inputs
            .map(|name| fmu.find(&name, Use::Set).ok_or(format!("`{name}`")))
            .collect();
        let missing = inputs.iter().filter_map(|input| input.clone().err()).collect();
        let inputs: Result<Vec<Variable>, String> = inputs.into_iter().collect();
        let values = PARAMETERS
            .iter()
            .map(|parameter| (parameter.name, parameter.get(config)));
        let mut controller = Self {
            sample_time: config.sample_time,
            response: fmu.need("response", Use::Set)?,
            reference: fmu.find("reference", Use::Set),
            active: fmu.need("active", Use::Set)?,
            omega: fmu.need("omega", Use::Get)?,
            amplitude: fmu.need("E", Use::Get)?,
            displacement: read("drive"),
            phase_error,
            phase_measured: read("phase_measured"),
            settled,
            locked,
            state: read("state"),
            fault: read("fault"),
            response_loop: inputs.map_err(|_| missing),
            fmu,
        };
        controller.fmu.start(&values.collect::<Vec<_>>())?;
        Ok(controller)
    }

    /// What the bench uses, and what of it the FMU at `path` has.
    pub fn connections(path: &Path, names: &Names) -> Result<Vec<Connection>, FmuError> {
        let starts: Vec<&str> = PARAMETERS.iter().map(|parameter| parameter.name).collect();
        connections(path, names, &used(), &starts)
    }

    fn response_loop(&self) -> Result<Vec<Variable>, ControllerError> {
        self.response_loop.clone().map_err(ControllerError::NoResponseLoop)
    }
}

impl Controller for FmuController {
    fn sample(&mut self, sensors: Sensors, active: bool) -> Result<Command, ControllerError> {
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
            is_held: false,
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

    fn hold_response(&mut self, to: Move, phase_target: f64) -> Result<(), ControllerError> {
        let inputs = self.response_loop()?;
        let Move { response, duration, amplitude, omega, growth } = to;
        let values = [phase_target, response, duration, amplitude, omega, growth];
        for (input, value) in inputs[1..].iter().zip(values) {
            self.fmu.set(*input, value)?;
        }
        Ok(self.fmu.set(inputs[0], 1.0)?)
    }

    fn hold_drive(&mut self) -> Result<(), ControllerError> {
        let inputs = self.response_loop()?;
        Ok(self.fmu.set(inputs[0], 0.0)?)
    }
}
