//! A controller that is an FMU: ours, or anybody's with the same variable names.

use std::path::Path;

use fmi::fmi2::instance::Common;
use phase_lock::{Config, MOVE, PARAMETERS};
use vines_testbench::rig::{Command, Controller, ControllerError, Drive, Fault, LoopState, Move, Sensors, Settling};
use vines_testbench::scene::Names;

use crate::instance::{FmiType, Fmu, FmuError, Named, Reference, names_exist};

/// The names of this bench that a scene may map, beside those of the parameters.
const NAMES: &str = "response, reference, active, omega, E, drive, phase_error, phase_measured, hold_response, \
                     settled, locked, state, fault";

/// How it is known that the lock has settled.
enum Settled {
    /// The controller reports it: `settled`.
    Reported(Reference),
    /// The bench judges, while `locked` is true where the controller has it.
    Judged(Option<Reference>, Settling),
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
    /// `response`, and `reference` where there is one.
    sensors: Vec<Named>,
    active: Reference,
    /// `omega` and `E`.
    drive: [Named; 2],
    displacement: Option<Named>,
    phase_error: Option<Named>,
    phase_measured: Option<Reference>,
    settled: Settled,
    /// `state` and `fault`.
    states: [Option<Reference>; 2],
    response_loop: Option<ResponseLoop>,
}

/// Variables of a controller that can control the response.
struct ResponseLoop {
    /// `phase_target` and the fields of the move, in the order of the core's table.
    reals: Vec<Named>,
    hold: Reference,
}

impl ResponseLoop {
    fn of(fmu: &Fmu, names: &Names) -> Result<Option<Self>, FmuError> {
        let reals = std::iter::once("phase_target".to_owned()).chain(moves());
        let reals = reals.map(|ours| fmu.named(FmiType::Real, names, &ours));
        let reals: Option<Vec<Named>> = reals.collect::<Result<_, _>>()?;
        let hold = fmu.switch(FmiType::Boolean, names, "hold_response")?;
        Ok(reals.zip(hold).map(|(reals, hold)| Self { reals, hold }))
    }
}

impl FmuController {
    /// Loads the controller at `path` and initialises it with a configuration.
    pub fn load(path: &Path, config: &Config, names: &Names) -> Result<Self, FmuError> {
        let parameters = PARAMETERS.iter().map(|parameter| parameter.name.to_owned());
        let all: Vec<String> = std::iter::once(NAMES.to_owned())
            .chain(parameters)
            .chain(moves())
            .collect();
        names_exist(names, &all.join(", "))?;
        let mut fmu = Fmu::load(path, "controller")?;
        let mut sensors = vec![fmu.need(FmiType::Real, names, "response")?];
        sensors.extend(fmu.named(FmiType::Real, names, "reference")?);
        let (active, _) = fmu.need(FmiType::Boolean, names, "active")?;
        let drive = [
            fmu.need(FmiType::Real, names, "omega")?,
            fmu.need(FmiType::Real, names, "E")?,
        ];
        let phase_error = fmu.named(FmiType::Real, names, "phase_error")?;
        let switch = |ours| fmu.switch(FmiType::Boolean, names, ours);
        let settled = match (switch("settled")?, switch("locked")?) {
            (Some(settled), _) => Settled::Reported(settled),
            (None, locked) => {
                if locked.is_none() && phase_error.is_none() {
                    log::warn!(
                        "{} has none of `settled`, `locked` and `phase_error`: its lock is judged by its frequency alone",
                        path.display()
                    );
                }
                Settled::Judged(locked, Settling::new(config))
            }
        };
        let integer = |ours| fmu.switch(FmiType::Integer, names, ours);
        let states = [integer("state")?, integer("fault")?];
        let displacement = fmu.named(FmiType::Real, names, "drive")?;
        let phase_measured = switch("phase_measured")?;
        let response_loop = ResponseLoop::of(&fmu, names)?;
        let values: Vec<_> = PARAMETERS
            .iter()
            .map(|parameter| (parameter.name, parameter.get(config)))
            .collect();
        fmu.start(names, &values)?;
        Ok(Self {
            sample_time: config.sample_time,
            sensors,
            active,
            drive,
            displacement,
            phase_error,
            phase_measured,
            response_loop,
            settled,
            states,
            fmu,
        })
    }

    fn optional(&mut self, variable: Option<Named>) -> Result<Option<f64>, FmuError> {
        let value = variable.map(|variable| self.fmu.read("give its outputs", [variable]).map(|[x]| x));
        value.transpose()
    }

    fn boolean(&mut self, reference: Reference) -> Result<bool, FmuError> {
        let (reference, mut value) = ([reference], [0]);
        self.fmu
            .ask("give its outputs", |i| i.get_boolean(&reference, &mut value))?;
        Ok(value != [0])
    }

    fn integer(&mut self, reference: Option<Reference>) -> Result<Option<i32>, FmuError> {
        let value = reference.map(|variable| self.fmu.integer("give its outputs", variable));
        value.transpose()
    }

    fn exchange(&mut self, sensors: Sensors, active: bool) -> Result<Command, FmuError> {
        let readings = [sensors.response, sensors.reference.unwrap_or(0.0)];
        self.fmu.write("take its inputs", &self.sensors, &readings)?;
        let reference = [self.active];
        self.fmu
            .ask("take its inputs", |i| i.set_boolean(&reference, &[active.into()]))?;
        self.fmu.step(self.sample_time)?;
        let [omega, amplitude] = self.fmu.read("give its outputs", self.drive)?;
        let flag = match self.settled {
            Settled::Reported(settled) => Some(settled),
            Settled::Judged(locked, _) => locked,
        };
        let flag = flag.map(|flag| self.boolean(flag)).transpose()?;
        let measured = self.phase_measured.map_or(Ok(true), |flag| self.boolean(flag))?;
        let phase_error = self.optional(self.phase_error.filter(|_| measured))?;
        let settled = match &mut self.settled {
            Settled::Reported(_) => flag == Some(true),
            Settled::Judged(..) if !active => false,
            // A phase that cannot be measured now is none to judge by.
            Settled::Judged(_, settling) => {
                settling.sample(omega, phase_error.unwrap_or(0.0), flag.unwrap_or(true) && measured)
            }
        };
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
        let Move { response, duration, amplitude, omega, growth } = to;
        let values = [phase_target, response, duration, amplitude, omega, growth];
        self.fmu.write("take its inputs", &inputs.reals, &values)?;
        let hold = [inputs.hold];
        self.fmu
            .ask("take its inputs", |i| i.set_boolean(&hold, &[true.into()]))?;
        Ok(())
    }

    fn hold_drive(&mut self) -> Result<(), ControllerError> {
        let inputs = self.response_loop.as_ref().ok_or(ControllerError::NoResponseLoop)?;
        let hold = [inputs.hold];
        self.fmu
            .ask("take its inputs", |i| i.set_boolean(&hold, &[false.into()]))?;
        Ok(())
    }
}

/// The inputs of a move.
fn moves() -> impl Iterator<Item = String> {
    MOVE.iter().map(|(name, _)| format!("move.{name}"))
}
