//! The types of the header, and their conversions from the core and to it. The units are m, s, rad, rad/s.

use core::mem::MaybeUninit;

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
    pub words: [MaybeUninit<u64>; 384],
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

/// Sensor readings of a sample, and the operator's request.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PhaseLockInput {
    /// Response of the structure, m.
    pub response: PhaseLockReal,
    /// Displacement of the base, m. If it is not present, the internal oscillator is the reference.
    pub reference: PhaseLockOptional,
    /// Whether the drive is requested. A change from false to true arms the controller, also after a fault.
    pub active: bool,
}

impl From<&PhaseLockInput> for Input {
    fn from(from: &PhaseLockInput) -> Self {
        Self {
            response: from.response,
            reference: from.reference.into(),
            active: from.active,
        }
    }
}

/// State of the loop. The numbers are those of the FMU's state.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PhaseLockStage {
    /// Not armed; the drive is off, or still ramps down after a fault. The oscillator runs at omega_start.
    Idle = 0,
    /// The drive ramps up at omega_start; the loop is open.
    Ramping = 1,
    /// The loop is closed, but not yet locked.
    Acquiring = 2,
    /// Locked at phase resonance.
    Locked = 3,
    /// The lock was lost. The drive ramps down; latched until active becomes false.
    LockLost = 4,
    /// A Fault other than a lost lock. The drive ramps down; latched until active becomes false.
    Tripped = 5,
    /// active became false: the drive is released, the frequency stays constant.
    ShutDown = 6,
}

impl From<LoopState> for PhaseLockStage {
    fn from(from: LoopState) -> Self {
        match from {
            LoopState::Idle => Self::Idle,
            LoopState::Ramping => Self::Ramping,
            LoopState::Acquiring => Self::Acquiring,
            LoopState::Locked => Self::Locked,
            LoopState::LockLost => Self::LockLost,
            LoopState::Tripped => Self::Tripped,
            LoopState::ShutDown => Self::ShutDown,
        }
    }
}

/// Reason why the drive was switched off. The numbers are those of the FMU's fault, where 0 means no
/// fault.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PhaseLockFault {
    /// No fault.
    None = 0,
    /// A sensor read NaN, infinity, or more than 1e100 m, or a reading did not change for a sixth of a
    /// period.
    Sensor = 1,
    /// The response exceeded response_max.
    ResponseTooLarge = 2,
    /// No lock within acquire_timeout.
    TimedOut = 3,
    /// The phase error exceeded unlock_tolerance, or the response was no longer valid, while locked.
    LockLost = 4,
    /// No valid measurement for signal_timeout, or none in the first periods of the drive: the amplitude of
    /// a channel is too small, or its noise too large.
    NoSignal = 5,
    /// A reading differed from its prediction by more than residual_max, or the response contradicts the
    /// power of its drive.
    Implausible = 6,
}

impl From<Option<Fault>> for PhaseLockFault {
    fn from(from: Option<Fault>) -> Self {
        match from {
            None => Self::None,
            Some(Fault::Sensor) => Self::Sensor,
            Some(Fault::ResponseTooLarge) => Self::ResponseTooLarge,
            Some(Fault::TimedOut) => Self::TimedOut,
            Some(Fault::LockLost) => Self::LockLost,
            Some(Fault::NoSignal) => Self::NoSignal,
            Some(Fault::Implausible) => Self::Implausible,
        }
    }
}

/// Drive until the next sample, and the controller's estimates.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PhaseLockOutput {
    /// Drive frequency, rad/s; always between omega_min and omega_max.
    pub omega: PhaseLockReal,
    /// Drive amplitude E, m; always between 0 and amplitude_max (where that is set).
    pub amplitude: PhaseLockReal,
    /// Setpoint of the base displacement at this sample, E sin(phase), m, for a rig that takes samples.
    pub drive: PhaseLockReal,
    /// Phase of the response relative to the reference, minus the target, rad, in [-pi, pi]. Not present
    /// while one of the two amplitudes is 0, or their product is below the smallest normal number.
    pub phase_error: PhaseLockOptional,
    /// Amplitude of the response's fundamental, m.
    pub response_amplitude: PhaseLockReal,
    /// Present setpoint of the response amplitude, m. Not present while the drive amplitude is controlled
    /// instead.
    pub response_target: PhaseLockOptional,
    /// Amplitude of the reference's fundamental, m: measured, or that of the drive.
    pub reference_amplitude: PhaseLockReal,
    /// Power of the response's fundamental over the sum of itself and the detector's residual power, 0 to
    /// 1.
    pub coherence: PhaseLockReal,
    /// Mean frequency, rad/s, over the complete blocks of the running dwell; omega before the first one.
    pub frequency: PhaseLockReal,
    /// Mean of response_amplitude, m, over the same blocks; response_amplitude before the first one.
    pub response_mean: PhaseLockReal,
    /// Whether the loop is locked: the lock criterion has been met, and the lock has not been lost since.
    pub locked: bool,
    /// Whether the lock criterion is met now: phase, frequency and amplitude have been stationary for the
    /// whole dwell. A retuned controller is not settled until the new operating point is stationary.
    pub settled: bool,
    /// State of the loop.
    pub state: PhaseLockStage,
    /// Reason why the drive was switched off; kept until the controller is armed again.
    pub fault: PhaseLockFault,
}

impl From<Output> for PhaseLockOutput {
    fn from(from: Output) -> Self {
        Self {
            omega: from.omega,
            amplitude: from.amplitude,
            drive: from.drive,
            phase_error: from.phase_error.into(),
            response_amplitude: from.response_amplitude,
            response_target: from.response_target.into(),
            reference_amplitude: from.reference_amplitude,
            coherence: from.coherence,
            frequency: from.frequency,
            response_mean: from.response_mean,
            locked: from.locked,
            settled: from.settled,
            state: from.state.into(),
            fault: from.fault.into(),
        }
    }
}

/// A change of the response amplitude's setpoint.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PhaseLockMove {
    /// New setpoint of the response amplitude, m; above 0.
    pub response: PhaseLockReal,
    /// Duration, s; 0: step change.
    pub duration: PhaseLockReal,
    /// Expected change of the drive amplitude, m; 0 if unknown.
    pub amplitude: PhaseLockReal,
    /// Expected change of the frequency, rad/s; 0 if unknown.
    pub omega: PhaseLockReal,
    /// Growth rate of the setpoint at the end of the move and after it, m/s; 0 to hold it.
    pub growth: PhaseLockReal,
}

impl From<&PhaseLockMove> for Move {
    fn from(from: &PhaseLockMove) -> Self {
        Self {
            response: from.response,
            duration: from.duration,
            amplitude: from.amplitude,
            omega: from.omega,
            growth: from.growth,
        }
    }
}

/// All settings; phase_lock_config_for_resonance gives initial values.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PhaseLockConfig {
    /// Time from sample to sample, s; samples lie at 0, sample_time, 2 sample_time, … after the start.
    pub sample_time: PhaseLockReal,
    /// Frequency while the loop is open, between omega_min and omega_max, rad/s.
    pub omega_start: PhaseLockReal,
    /// Lowest frequency, rad/s.
    pub omega_min: PhaseLockReal,
    /// Highest frequency, rad/s.
    pub omega_max: PhaseLockReal,
    /// Largest rate of change of the frequency, rad/s2; none: no limit.
    pub omega_rate: PhaseLockOptional,
    /// Setpoint of the drive amplitude, at most amplitude_max, m.
    pub amplitude: PhaseLockReal,
    /// Largest drive amplitude, m; none: no limit, and the response amplitude cannot be controlled.
    pub amplitude_max: PhaseLockOptional,
    /// Largest rate of change of the drive amplitude in every ramp but the release, m/s: at the start,
    /// after a fault, to a new setpoint, and while the response amplitude is controlled; none: step
    /// changes.
    pub ramp_rate: PhaseLockOptional,
    /// Rate of the drive ramp to 0 after active becomes false, m/s; none: switched off at once, as a free
    /// decay requires.
    pub release_rate: PhaseLockOptional,
    /// Bandwidth of the control of the measured base amplitude, rad/s; none: no control, for a shaker whose
    /// gain is known.
    pub base_bandwidth: PhaseLockOptional,
    /// Setpoint of the phase of the response relative to the reference, rad; -pi/2 is phase resonance.
    pub phase_target: PhaseLockReal,
    /// Method of the phase detector: 1 adaptive harmonic filter, 2 synchronous demodulation.
    pub detector: i32,
    /// Number of harmonics of the adaptive filter, 1 to 8, including the fundamental.
    pub harmonics: i32,
    /// Whether the adaptive filter uses harmonics 1, 3, 5, … instead of 1, 2, 3, …; a rig with impacts at
    /// two equal walls has only odd ones.
    pub odd_only: bool,
    /// Bandwidth of the detector, rad/s: the tuning parameter, from which the gains follow.
    pub bandwidth: PhaseLockReal,
    /// Damping rate of the structure (damping ratio times natural frequency), rad/s; none: unknown, and the
    /// gains suit an undamped structure.
    pub damping_rate: PhaseLockOptional,
    /// Delay from the drive to the sample of the sensor, s; compensated if no reference is connected; half
    /// a sample for a rig that holds the samples of drive, 0 for a rig whose own oscillator receives omega.
    pub delay: PhaseLockReal,
    /// Largest phase error that counts as locked, mean over the dwell, rad.
    pub phase_tolerance: PhaseLockReal,
    /// Phase error, mean over a period, above which the lock is lost, rad; at least lock.phase_tolerance.
    pub unlock_tolerance: PhaseLockReal,
    /// Largest relative drift of the frequency per period that counts as locked, beyond what the noise of
    /// the response explains.
    pub frequency_drift: PhaseLockReal,
    /// Largest relative drift of the response amplitude per period that counts as locked, beyond what its
    /// noise explains.
    pub amplitude_drift: PhaseLockReal,
    /// Time for which phase, frequency and amplitude must be stationary, periods; rounded up to a multiple
    /// of 4.
    pub dwell: i32,
    /// Smallest share of the fundamental in the power of a valid signal, between 0 and 1; noise has a small
    /// share.
    pub coherence_min: PhaseLockReal,
    /// Smallest valid response amplitude, as a multiple of amplitude; a zero response is never valid.
    pub response_min: PhaseLockReal,
    /// Reading of the response above which the drive is switched off, m; none: no limit.
    pub response_max: PhaseLockOptional,
    /// Longest time from the end of the ramp to the lock, without the time in which the response amplitude
    /// is controlled, s; none: no limit.
    pub acquire_timeout: PhaseLockOptional,
    /// Longest time in the closed loop without a valid measurement, s: with too small an amplitude or too
    /// much noise; none: no limit.
    pub signal_timeout: PhaseLockOptional,
    /// Largest difference between a reading and its prediction, as a share of the amplitude, beyond twice
    /// the differences of the last periods; none: no limit, and the response is not checked against the
    /// drive.
    pub residual_max: PhaseLockOptional,
    /// Whether a sensor measures the base; false: the internal oscillator with the configured delay is the
    /// reference.
    pub reference_connected: bool,
    /// Growth rate of the response amplitude at phase resonance, per drive amplitude, 1/s; half of omega0
    /// for excitation through the base.
    pub response_gain: PhaseLockReal,
}
