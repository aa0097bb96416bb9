//! A controller that is an FMU: ours, or anybody's with the same variable names.

use std::f64::consts::TAU;
use std::path::Path;

use fmi::fmi2::instance::Common;
use phase_lock::{Config, MOVE, PARAMETERS};
use vines_testbench::rig::{Command, Controller, ControllerError, Drive, Fault, LoopState, Move, Sensors};
use vines_testbench::scene::Names;

use crate::instance::{Fmu, FmuError, Kind, Named, Reference, names_are_known};

/// The names of this bench that a scene may map, beside those of the parameters.
const NAMES: &str = "response, reference, active, omega, E, drive, phase_error, phase_measured, hold_response, \
                     settled, locked, state, fault";

/// How it is known that the lock has settled.
enum Settled {
    /// The controller says so: `settled`.
    Told(Reference),
    /// The lab judges, while `locked` is true where the controller has it.
    Judged(Option<Reference>, Judge),
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
        let reals = reals.map(|ours| fmu.named(Kind::Real, names, &ours));
        let reals: Option<Vec<Named>> = reals.collect::<Result<_, _>>()?;
        let hold = fmu.switch(Kind::Boolean, names, "hold_response")?;
        Ok(reals.zip(hold).map(|(reals, hold)| Self { reals, hold }))
    }
}

impl FmuController {
    /// Loads the controller at `path` and initialises it with a configuration.
    pub fn load(path: &Path, config: &Config, names: &Names) -> Result<Self, FmuError> {
        let parameters = PARAMETERS.iter().map(|one| one.name.to_owned());
        let known: Vec<String> = std::iter::once(NAMES.to_owned())
            .chain(parameters)
            .chain(moves())
            .collect();
        names_are_known(names, &known.join(", "))?;
        let mut fmu = Fmu::load(path, "controller")?;
        let mut sensors = vec![fmu.need_named(Kind::Real, names, "response")?];
        sensors.extend(fmu.named(Kind::Real, names, "reference")?);
        let (active, _) = fmu.need_named(Kind::Boolean, names, "active")?;
        let drive = [
            fmu.need_named(Kind::Real, names, "omega")?,
            fmu.need_named(Kind::Real, names, "E")?,
        ];
        let phase_error = fmu.named(Kind::Real, names, "phase_error")?;
        let switch = |ours| fmu.switch(Kind::Boolean, names, ours);
        let settled = match (switch("settled")?, switch("locked")?) {
            (Some(settled), _) => Settled::Told(settled),
            (None, locked) => {
                if locked.is_none() && phase_error.is_none() {
                    log::warn!(
                        "{} has none of `settled`, `locked` and `phase_error`: its lock is judged by its frequency alone",
                        path.display()
                    );
                }
                Settled::Judged(locked, Judge::new(config))
            }
        };
        let integer = |ours| fmu.switch(Kind::Integer, names, ours);
        let states = [integer("state")?, integer("fault")?];
        let displacement = fmu.named(Kind::Real, names, "drive")?;
        let phase_measured = switch("phase_measured")?;
        let response_loop = ResponseLoop::of(&fmu, names)?;
        let values: Vec<_> = PARAMETERS.iter().map(|one| (one.name, one.get(config))).collect();
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
        let value = variable.map(|one| self.fmu.read("give its outputs", [one]).map(|[x]| x));
        value.transpose()
    }

    fn boolean(&mut self, reference: Reference) -> Result<bool, FmuError> {
        let (reference, mut value) = ([reference], [0]);
        self.fmu
            .ask("give its outputs", |i| i.get_boolean(&reference, &mut value))?;
        Ok(value != [0])
    }

    fn integer(&mut self, reference: Option<Reference>) -> Result<Option<i32>, FmuError> {
        let value = reference.map(|one| self.fmu.integer("give its outputs", one));
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
        let told = match self.settled {
            Settled::Told(told) => Some(told),
            Settled::Judged(locked, _) => locked,
        };
        let told = told.map(|told| self.boolean(told)).transpose()?;
        let measured = self.phase_measured.map_or(Ok(true), |one| self.boolean(one))?;
        let phase_error = self.optional(self.phase_error.filter(|_| measured))?;
        let settled = match &mut self.settled {
            Settled::Told(_) => told == Some(true),
            Settled::Judged(..) if !active => false,
            Settled::Judged(_, judge) => {
                // A phase that cannot be measured now is none to judge by.
                let locked = told.unwrap_or(true) && measured;
                judge.sample(omega, phase_error.unwrap_or(0.0), locked)
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

    fn reports_phase_error(&self) -> bool {
        self.phase_error.is_some()
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

/// Frequency and phase error must stay within the criterion of the configuration for its dwell.
pub(super) struct Judge {
    /// Largest phase error, rad.
    phase: f64,
    /// Largest relative change of the frequency during the dwell.
    drift: f64,
    /// Periods.
    dwell: f64,
    sample_time: f64,
    /// Periods for which the conditions have held, and the range of the frequency in them, rad/s.
    held: f64,
    range: [f64; 2],
}

impl Judge {
    /// By the lock criterion of `config`.
    pub fn new(config: &Config) -> Self {
        let dwell = f64::from(config.lock.dwell);
        Self {
            phase: config.lock.phase_tolerance,
            drift: config.lock.frequency_drift * dwell,
            dwell,
            sample_time: config.sample_time,
            held: 0.0,
            range: [0.0; 2],
        }
    }

    /// One sample; `locked` as the controller says, `phase_error` in rad.
    pub fn sample(&mut self, omega: f64, phase_error: f64, locked: bool) -> bool {
        let [low, high] = [self.range[0].min(omega), self.range[1].max(omega)];
        let steady = high - low <= self.drift * omega && phase_error.abs() <= self.phase;
        if locked && steady && self.held > 0.0 {
            self.range = [low, high];
            self.held += omega * self.sample_time / TAU;
        } else {
            self.range = [omega; 2];
            self.held = if locked && phase_error.abs() <= self.phase {
                f64::MIN_POSITIVE
            } else {
                0.0
            };
        }
        self.held >= self.dwell
    }
}

#[cfg(test)]
#[path = "../tests/unit/controller.rs"]
mod tests;
