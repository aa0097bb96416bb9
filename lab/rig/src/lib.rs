//! What a rig and a controller are for the bench, and what they say to each other.
//!
//! A *rig* takes a drive and returns sensor samples, a *controller* turns sensor samples into a drive. An experiment uses only these two
//! traits, so an FMU, a network peer or hardware can replace either side. Here are the traits, their messages and errors, and the names and
//! units of channels; a new kind of rig needs nothing else of the lab.

#![forbid(unsafe_code)]

mod clock;
mod failure;
mod names;
pub mod unit;

pub use clock::Clock;
pub use failure::{ControllerError, RigError};
pub use names::{Name, Names};
pub use phase_lock::{Fault, LoopState, Move};
pub use vines_model::{Definition, Measurand, Reference, Sensor};

/// What the controller asks of the rig for the coming sample period: the motion of the base, m; of a rig with another drive its force, N, or the
/// command of its shaker, V.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Drive {
    /// Frequency, rad/s.
    pub omega: f64,
    /// Amplitude.
    pub amplitude: f64,
    /// Present value, for a rig that is driven by samples.
    pub displacement: f64,
    /// Whether the rig holds this value for the sample period, instead of a sine of its own oscillator.
    pub is_held: bool,
}

impl Drive {
    /// Whether it moves nothing: neither a rig that takes its amplitude nor one that takes its samples.
    pub fn is_off(self) -> bool {
        (self.amplitude, self.displacement) == (0.0, 0.0)
    }

    /// This drive in another unit.
    #[must_use]
    pub fn map(self, convert: impl Fn(f64) -> f64) -> Self {
        let [amplitude, displacement] = [self.amplitude, self.displacement].map(convert);
        Self { amplitude, displacement, ..self }
    }
}

/// What the sensors of the rig read.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Sensors {
    /// Response, m, m/s or m/s², as the definition of resonance says.
    pub response: f64,
    /// Motion of the base, m, m/s or m/s², or the force on a structure, N, where a sensor reads it.
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
    /// What friction has done, where there is friction and the rig reports it.
    pub friction: Option<FrictionTotals>,
}

/// What friction in the cavity has done since the start.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct FrictionTotals {
    /// How often the particle stuck to the floor inside the cavity.
    pub sticks: i64,
    /// How long it stuck there, s.
    pub stuck_time: f64,
    /// Energy lost to friction, J.
    pub loss: f64,
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
    /// Errors of the implementation; [`RigError::NoHold`] of a rig that holds no samples.
    fn advance(&mut self, drive: Drive, step: f64) -> Result<(), RigError>;

    /// Displacement of the force cell, m, from which the acceleration of the mass before it follows; 0 of a rig without one.
    fn cell_displacement(&mut self) -> Result<f64, RigError> {
        Ok(0.0)
    }

    /// The ground truth, if the rig is a simulation.
    fn ground_truth(&mut self) -> Result<Option<GroundTruth>, RigError> {
        Ok(None)
    }
}

/// A stage of the pipeline around a rig: it changes what is read or how the rig is driven, and passes everything else on.
pub trait RigStage {
    /// The rig that this stage surrounds, with the stages nearer to it.
    fn inner(&mut self) -> &mut dyn Rig;

    /// What the next stage or the controller reads: [`Rig::sense`].
    fn sense(&mut self) -> Result<Sensors, RigError> {
        self.inner().sense()
    }

    /// [`Rig::advance`].
    fn advance(&mut self, drive: Drive, step: f64) -> Result<(), RigError> {
        self.inner().advance(drive, step)
    }

    /// [`Rig::ground_truth`].
    fn ground_truth(&mut self) -> Result<Option<GroundTruth>, RigError> {
        self.inner().ground_truth()
    }
}

impl<S: RigStage> Rig for S {
    fn sense(&mut self) -> Result<Sensors, RigError> {
        RigStage::sense(self)
    }

    fn advance(&mut self, drive: Drive, step: f64) -> Result<(), RigError> {
        RigStage::advance(self, drive, step)
    }

    fn cell_displacement(&mut self) -> Result<f64, RigError> {
        self.inner().cell_displacement()
    }

    fn ground_truth(&mut self) -> Result<Option<GroundTruth>, RigError> {
        RigStage::ground_truth(self)
    }
}

/// Output of a controller at a sample.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Command {
    /// The drive for the coming sample period.
    pub drive: Drive,
    /// Phase of the response relative to the base, less the target, rad; absent if it cannot be measured.
    pub phase_error: Option<f64>,
    /// Whether phase, frequency and amplitude have been stationary for the controller's dwell time; absent if it does not say so, and the
    /// bench judges.
    pub settled: Option<bool>,
    /// State of the loop; absent if the controller does not report it.
    pub state: Option<LoopState>,
    /// Why the controller switched the drive off.
    pub fault: Option<Fault>,
}

impl From<phase_lock::Output> for Command {
    fn from(output: phase_lock::Output) -> Self {
        let phase_lock::Output { omega, amplitude, drive: displacement, .. } = output;
        Self {
            drive: Drive { omega, amplitude, displacement, is_held: false },
            phase_error: output.phase_error,
            settled: Some(output.settled),
            state: Some(output.state),
            fault: output.fault,
        }
    }
}

/// A controller: anything that can hold a rig at phase resonance.
pub trait Controller {
    /// Processes one sample; `active` switches the drive on. Returns the drive.
    ///
    /// # Errors
    /// Errors of the implementation: a refused call, a lost connection.
    fn sample(&mut self, sensors: Sensors, active: bool) -> Result<Command, ControllerError>;

    /// Controls the amplitude of the response from now on, moves it as stated, and holds the phase `phase_target`, rad.
    ///
    /// # Errors
    /// A controller that cannot control the response, or cannot do so now.
    fn hold_response(&mut self, _to: Move, _phase_target: f64) -> Result<(), ControllerError> {
        Err(ControllerError::NoResponseLoop(Vec::new()))
    }

    /// Controls the amplitude of the drive again, at its setpoint.
    fn hold_drive(&mut self) -> Result<(), ControllerError> {
        Err(ControllerError::NoResponseLoop(Vec::new()))
    }
}
