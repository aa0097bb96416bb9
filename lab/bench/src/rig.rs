//! The two sides of the bench: a *rig* takes a drive and returns sensor samples, a *controller* turns sensor samples into a
//! drive. An experiment uses only these two traits, so an FMU, a network peer or hardware can replace either side.

mod chain;
mod error;
mod faulty;
mod measured;
mod phase_lock;
mod sensors_only;
mod simulated;
mod stoppable;

pub use ::phase_lock::{Fault, LoopState, Move};
pub use chain::Chain;
pub use error::{ControllerError, RigError};
pub use faulty::{RigFault, SensorFault, faulty};
pub use measured::Measured;
pub use phase_lock::BuiltIn;
pub use sensors_only::SensorsOnly;
pub use simulated::Simulated;
pub use stoppable::{Interrupted, Stoppable};

/// What the controller asks of the rig for the coming sample period.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Drive {
    /// Frequency of the base motion, rad/s.
    pub omega: f64,
    /// Amplitude of the base motion, m.
    pub amplitude: f64,
    /// Present base displacement, m, for a rig that is driven by samples.
    pub displacement: f64,
}

/// What the sensors of the rig read.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Sensors {
    /// Response, m.
    pub response: f64,
    /// Base displacement, m, where a sensor reads it.
    pub reference: Option<f64>,
}

/// What only a simulated rig knows, in addition to its sensors.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct GroundTruth {
    /// Impacts since the start.
    pub impacts: i64,
    /// Time of the last one, s.
    pub impact_time: f64,
    /// Relative velocity just before the last one, m/s: its sign identifies the wall.
    pub impact_velocity: f64,
    /// Velocity of the particle, m/s.
    pub particle_velocity: f64,
}

/// A rig: anything that can be driven and measured.
pub trait Rig {
    /// What the sensors read now.
    ///
    /// # Errors
    /// Errors of the implementation: a refused call, a lost connection.
    fn sense(&mut self) -> Result<Sensors, RigError>;

    /// Drives the rig for one sample period of `step` seconds.
    ///
    /// # Errors
    /// As [`Rig::sense`].
    fn advance(&mut self, drive: Drive, step: f64) -> Result<(), RigError>;

    /// Holds the base at the displacement of the drive for one sample period of `step` seconds.
    ///
    /// # Errors
    /// As [`Rig::sense`], and a rig whose base follows its own oscillator only.
    fn hold(&mut self, _drive: Drive, _step: f64) -> Result<(), RigError> {
        Err(RigError::NoHold)
    }

    /// The ground truth, if the rig is a simulation.
    ///
    /// # Errors
    /// As [`Rig::sense`].
    fn ground_truth(&mut self) -> Result<Option<GroundTruth>, RigError> {
        Ok(None)
    }
}

/// Output of a controller at a sample.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Command {
    /// The drive for the coming sample period.
    pub drive: Drive,
    /// Phase of the response relative to the base, less the target, rad; absent if it cannot be measured.
    pub phase_error: Option<f64>,
    /// Phase, frequency and amplitude have been stationary for the controller's dwell time.
    pub settled: bool,
    /// State of the loop; absent if the controller does not report it.
    pub state: Option<LoopState>,
    /// Why the controller switched the drive off.
    pub fault: Option<Fault>,
}

/// A controller: anything that can hold a rig at phase resonance.
pub trait Controller {
    /// Processes one sample; `active` switches the drive on. Returns the drive.
    ///
    /// # Errors
    /// Errors of the implementation: a refused call, a lost connection.
    fn sample(&mut self, sensors: Sensors, active: bool) -> Result<Command, ControllerError>;

    /// Whether the controller reports its phase error wherever it can be measured.
    fn reports_phase_error(&self) -> bool {
        true
    }

    /// Controls the amplitude of the response from now on, moves it as stated, and holds the phase `phase_target`, rad.
    ///
    /// # Errors
    /// A controller that cannot control the response, or cannot do so now.
    fn hold_response(&mut self, _to: Move, _phase_target: f64) -> Result<(), ControllerError> {
        Err(ControllerError::NoResponseLoop)
    }

    /// Controls the amplitude of the drive again, at its setpoint.
    ///
    /// # Errors
    /// As [`Controller::hold_response`].
    fn hold_drive(&mut self) -> Result<(), ControllerError> {
        Err(ControllerError::NoResponseLoop)
    }
}
