//! The two sides of the bench: a *rig* takes a drive and yields sensor samples, a *controller* turns sensor samples into a
//! drive. An experiment knows these two traits and nothing else, so that an FMU, a network peer or hardware can stand on
//! either side.

mod chain;
mod error;
mod phase_lock;
mod simulated;

pub use ::phase_lock::Move;
pub use chain::Chain;
pub(crate) use chain::NormalDistribution;
pub use error::{ControllerError, RigError};
pub use phase_lock::BuiltIn;
pub use simulated::Simulated;

/// What the controller asks of the rig for the coming sample period.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Drive {
    /// Frequency of the base motion, rad/s.
    pub omega: f64,
    /// Amplitude of the base motion, m.
    pub amplitude: f64,
    /// The base displacement wanted now, m, for a rig that takes samples instead.
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

/// What only a simulated rig can tell, beside its sensors.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct GroundTruth {
    /// Impacts since the start.
    pub impacts: i64,
    /// Time of the last one, s.
    pub impact_time: f64,
    /// Relative velocity just before the last one, m/s: its sign tells the wall.
    pub impact_velocity: f64,
    /// Velocity of the particle, m/s.
    pub particle_velocity: f64,
}

/// Anything that can be shaken.
pub trait Rig {
    /// What the sensors read now.
    ///
    /// # Errors
    /// The rig's own: a refused call, a lost connection.
    fn sense(&mut self) -> Result<Sensors, RigError>;

    /// Drives the rig for one sample period of `step` seconds.
    ///
    /// # Errors
    /// As [`Rig::sense`].
    fn advance(&mut self, drive: Drive, step: f64) -> Result<(), RigError>;

    /// Holds the base at `displacement` (m) for one sample period of `step` seconds.
    ///
    /// # Errors
    /// As [`Rig::sense`], and a rig whose base follows its own oscillator only.
    fn hold(&mut self, _displacement: f64, _step: f64) -> Result<(), RigError> {
        Err(RigError::NoHold)
    }

    /// What happens inside, where the rig is a simulation.
    ///
    /// # Errors
    /// As [`Rig::sense`].
    fn ground_truth(&mut self) -> Result<Option<GroundTruth>, RigError> {
        Ok(None)
    }
}

/// What a controller puts out at a sample.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Command {
    /// The drive for the coming sample period.
    pub drive: Drive,
    /// Phase of the response relative to the base, less the target, rad.
    pub phase_error: f64,
    /// Phase, frequency and amplitude have been stationary for the controller's dwell.
    pub settled: bool,
}

/// Anything that can hold a rig at phase resonance.
pub trait Controller {
    /// Takes the sensors of one sample, and whether the drive is wanted; returns the drive.
    ///
    /// # Errors
    /// The controller's own: a refused call, a lost connection.
    fn sample(&mut self, sensors: Sensors, active: bool) -> Result<Command, ControllerError>;

    /// Holds the amplitude of the response from now on, and moves it as stated.
    ///
    /// # Errors
    /// A controller that cannot do that, or not now.
    fn hold_response(&mut self, _to: Move) -> Result<(), ControllerError> {
        Err(ControllerError::NoResponseLoop)
    }
}
