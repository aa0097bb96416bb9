//! The types of the header but the configuration, and their conversions to and from the types of the core. The units are m, s, rad, rad/s.

use phase_lock::{Fault, Input, LoopState, Move, Output, PhaseLock, State, Value};

/// The floating-point type: float if PHASE_LOCK_F32 is defined, for the library with the feature f32; otherwise double.
#[cfg(feature = "f32")]
pub type PhaseLockReal = f32;
/// The floating-point type: float if PHASE_LOCK_F32 is defined, for the library with the feature f32; otherwise double.
#[cfg(not(feature = "f32"))]
pub type PhaseLockReal = f64;

/// Storage of a controller and its state, initialised by phase_lock_init. May be copied; its content is private.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct PhaseLockController {
    /// Opaque.
    pub words: [u64; 384],
}

/// Content of the storage.
#[derive(Clone, Copy)]
pub(crate) struct Stored {
    pub lock: PhaseLock,
    pub state: State,
}

const _: () = assert!(size_of::<Stored>() <= size_of::<PhaseLockController>());
const _: () = assert!(align_of::<Stored>() <= align_of::<PhaseLockController>());

/// An optional value; all zeros: none.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PhaseLockOptional {
    /// Whether there is a value.
    pub present: bool,
    /// The value.
    pub value: PhaseLockReal,
}

/// Method of the phase detector.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PhaseLockDetector {
    /// Adaptive harmonic filter.
    #[default]
    Adaptive = 1,
    /// Synchronous demodulation.
    Demodulator = 2,
}

/// Sensor readings of a sample, and the operator's request.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PhaseLockInput {
    /// Response of the structure, m.
    pub response: PhaseLockReal,
    /// Displacement of the base, m; not present: no sensor measures it.
    pub reference: PhaseLockOptional,
    /// Whether the drive is requested. A change from false to true arms the controller, also after a fault.
    pub active: bool,
}

/// State of the loop.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PhaseLockStage {
    /// Not armed.
    Idle = 0,
    /// The drive ramps up; the loop is open.
    Ramping = 1,
    /// The loop is closed, but not yet locked.
    Acquiring = 2,
    /// Locked at phase resonance.
    Locked = 3,
    /// The lock was lost; latched, the drive ramps down.
    LockLost = 4,
    /// Another fault; latched, the drive ramps down.
    Tripped = 5,
    /// active became false: the drive is released.
    ShutDown = 6,
}

/// Reason why the drive was switched off.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PhaseLockFault {
    /// No fault.
    None = 0,
    /// A sensor read NaN, infinity, or more than 1e100 m, or the response did not change for a sixth of a period.
    Sensor = 1,
    /// The response exceeded response_max.
    ResponseTooLarge = 2,
    /// No lock within acquire_timeout.
    TimedOut = 3,
    /// The phase error exceeded unlock_tolerance, or the response was no longer valid.
    LockLost = 4,
    /// No valid measurement for signal_timeout.
    NoSignal = 5,
    /// A reading differed from its prediction by more than residual_max, or the response contradicts the power of its drive.
    Implausible = 6,
}

/// Drive until the next sample, and the controller's estimates.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PhaseLockOutput {
    /// Drive frequency, rad/s.
    pub omega: PhaseLockReal,
    /// Drive amplitude, m.
    pub amplitude: PhaseLockReal,
    /// Setpoint of the base displacement at this sample, m.
    pub drive: PhaseLockReal,
    /// Phase of the response relative to the reference, minus the target, rad; not present while an amplitude is 0.
    pub phase_error: PhaseLockOptional,
    /// Amplitude of the response's fundamental, m.
    pub response_amplitude: PhaseLockReal,
    /// Setpoint of the response amplitude, m; not present while the drive amplitude is controlled instead.
    pub response_target: PhaseLockOptional,
    /// Amplitude of the reference's fundamental, m.
    pub reference_amplitude: PhaseLockReal,
    /// Share of the fundamental in the power of the response, 0 to 1.
    pub coherence: PhaseLockReal,
    /// Mean frequency over the running dwell, rad/s.
    pub frequency: PhaseLockReal,
    /// Mean response amplitude over the running dwell, m.
    pub response_mean: PhaseLockReal,
    /// State of the loop.
    pub state: PhaseLockStage,
    /// Reason why the drive was switched off.
    pub fault: PhaseLockFault,
    /// Whether the loop is locked.
    pub locked: bool,
    /// Whether phase, frequency and amplitude have been stationary for the whole dwell.
    pub settled: bool,
}

/// A change of the response amplitude's setpoint.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PhaseLockMove {
    /// New setpoint of the response amplitude, m.
    pub response: PhaseLockReal,
    /// Duration, s.
    pub duration: PhaseLockReal,
    /// Expected change of the drive amplitude, m; 0: none.
    pub amplitude: PhaseLockReal,
    /// Expected change of the frequency, rad/s; 0: none.
    pub omega: PhaseLockReal,
    /// Growth rate of the setpoint at the end of the move and after it, m/s; 0 to hold it.
    pub growth: PhaseLockReal,
}

impl From<PhaseLockOptional> for Option<PhaseLockReal> {
    fn from(c: PhaseLockOptional) -> Self {
        c.present.then_some(c.value)
    }
}

impl From<Option<PhaseLockReal>> for PhaseLockOptional {
    fn from(value: Option<PhaseLockReal>) -> Self {
        Self { present: value.is_some(), value: value.unwrap_or_default() }
    }
}

impl From<PhaseLockOptional> for Value {
    fn from(c: PhaseLockOptional) -> Self {
        Option::from(c).into()
    }
}

impl From<Value> for PhaseLockOptional {
    fn from(value: Value) -> Self {
        Option::from(value).into()
    }
}

impl From<&PhaseLockInput> for Input {
    fn from(input: &PhaseLockInput) -> Self {
        Self {
            response: input.response,
            reference: input.reference.into(),
            active: input.active,
        }
    }
}

impl From<&PhaseLockMove> for Move {
    fn from(to: &PhaseLockMove) -> Self {
        Self {
            response: to.response,
            duration: to.duration,
            amplitude: to.amplitude,
            omega: to.omega,
            growth: to.growth,
        }
    }
}

impl From<Output> for PhaseLockOutput {
    fn from(output: Output) -> Self {
        // Every field: a new one of the core does not compile until it is here.
        let Output {
            omega,
            amplitude,
            drive,
            phase_error,
            response_amplitude,
            response_target,
            reference_amplitude,
            coherence,
            frequency,
            response_mean,
            state,
            fault,
            locked,
            settled,
        } = output;
        Self {
            omega,
            amplitude,
            drive,
            phase_error: phase_error.into(),
            response_amplitude,
            response_target: response_target.into(),
            reference_amplitude,
            coherence,
            frequency,
            response_mean,
            state: match state {
                LoopState::Idle => PhaseLockStage::Idle,
                LoopState::Ramping => PhaseLockStage::Ramping,
                LoopState::Acquiring => PhaseLockStage::Acquiring,
                LoopState::Locked => PhaseLockStage::Locked,
                LoopState::LockLost => PhaseLockStage::LockLost,
                LoopState::Tripped => PhaseLockStage::Tripped,
                LoopState::ShutDown => PhaseLockStage::ShutDown,
            },
            fault: match fault {
                None => PhaseLockFault::None,
                Some(Fault::Sensor) => PhaseLockFault::Sensor,
                Some(Fault::ResponseTooLarge) => PhaseLockFault::ResponseTooLarge,
                Some(Fault::TimedOut) => PhaseLockFault::TimedOut,
                Some(Fault::LockLost) => PhaseLockFault::LockLost,
                Some(Fault::NoSignal) => PhaseLockFault::NoSignal,
                Some(Fault::Implausible) => PhaseLockFault::Implausible,
            },
            locked,
            settled,
        }
    }
}
