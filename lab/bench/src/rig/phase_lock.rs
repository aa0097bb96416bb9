//! The built-in phase-locked loop as a controller of the bench.

use phase_lock::{Config, ConfigError, Input, Move, Output, PhaseLock, State};

use super::{Command, Controller, ControllerError, Drive, Sensors};

/// The built-in controller: coefficients and state.
#[derive(Clone)]
pub struct BuiltIn {
    lock: PhaseLock,
    state: State,
}

impl BuiltIn {
    /// The controller of a configuration, at its start.
    pub fn new(config: &Config) -> Result<Self, ConfigError> {
        let lock = config.build()?;
        Ok(Self { state: lock.start(), lock })
    }
}

impl From<Output> for Command {
    fn from(output: Output) -> Self {
        Self {
            drive: Drive {
                omega: output.omega,
                amplitude: output.amplitude,
                displacement: output.drive,
            },
            phase_error: output.phase_error,
            settled: output.settled,
            state: Some(output.state),
            fault: output.fault,
        }
    }
}

impl Controller for BuiltIn {
    fn sample(&mut self, sensors: Sensors, active: bool) -> Result<Command, ControllerError> {
        let output = self.lock.process(
            &mut self.state,
            Input {
                response: sensors.response,
                reference: sensors.reference,
                active,
            },
        );
        Ok(output.into())
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
