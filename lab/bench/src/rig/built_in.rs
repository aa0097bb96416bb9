//! The built-in phase-locked loop as a controller of the bench.

use phase_lock::{Config, ConfigError, Input, Output, PhaseLock};

use super::{Command, Controller, ControllerError, Move, Sensors};

/// The built-in controller.
#[derive(Clone)]
pub struct BuiltIn {
    /// Its coefficients.
    pub lock: PhaseLock,
    /// Its state.
    pub state: phase_lock::State,
    /// Its output at the last sample.
    pub output: Output,
}

impl BuiltIn {
    /// The controller of a configuration, at its start.
    pub fn new(config: &Config) -> Result<Self, ConfigError> {
        let lock = config.build()?;
        Ok(Self { state: lock.start(), output: lock.idle(), lock })
    }
}

impl Controller for BuiltIn {
    fn sample(&mut self, sensors: Sensors, active: bool) -> Result<Command, ControllerError> {
        let Sensors { response, reference } = sensors;
        let input = Input { response, reference, active };
        self.output = self.lock.process(&mut self.state, input);
        Ok(self.output.into())
    }

    fn hold_response(&mut self, to: Move, phase_target: f64) -> Result<(), ControllerError> {
        self.lock.retune(self.lock.config().amplitude, phase_target)?;
        Ok(self.lock.hold_response(&mut self.state, to)?)
    }

    fn hold_drive(&mut self) -> Result<(), ControllerError> {
        self.lock.hold_drive(&mut self.state);
        Ok(())
    }
}
