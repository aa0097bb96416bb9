//! The types of the header. Units are those of the core: m, s, rad, rad/s.

use phase_lock::{PhaseLock, State};

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

/// An optional value; all zeros: not present.
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

/// All parameters; phase_lock_config_for_resonance gives initial values.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PhaseLockConfig {
    /// Sample time, s.
    pub sample_time: PhaseLockReal,
    /// Frequency while the loop is open, rad/s.
    pub omega_start: PhaseLockReal,
    /// Lowest frequency, rad/s.
    pub omega_min: PhaseLockReal,
    /// Highest frequency, rad/s.
    pub omega_max: PhaseLockReal,
    /// Largest rate of change of the frequency, rad/s^2.
    pub omega_rate: PhaseLockOptional,
    /// Setpoint of the drive amplitude, m.
    pub amplitude: PhaseLockReal,
    /// Largest drive amplitude, m.
    pub amplitude_max: PhaseLockOptional,
    /// Largest rate of change of the drive amplitude in a ramp, m/s; not present: step changes.
    pub ramp_rate: PhaseLockOptional,
    /// Rate of the drive ramp to 0 after active becomes false, m/s; not present: switched off at once.
    pub release_rate: PhaseLockOptional,
    /// Bandwidth of the control of the measured base amplitude, rad/s; not present: no control.
    pub base_bandwidth: PhaseLockOptional,
    /// Setpoint of the phase of the response relative to the reference, rad.
    pub phase_target: PhaseLockReal,
    /// Method of the phase detector, a PhaseLockDetector; an integer, because any other value must be refused.
    pub detector: i32,
    /// Bandwidth of the detector, rad/s: the tuning parameter.
    pub bandwidth: PhaseLockReal,
    /// Damping rate of the structure, rad/s; not present: unknown.
    pub damping_rate: PhaseLockOptional,
    /// Delay from the drive to the sample of the sensor, s; used if no reference is connected.
    pub delay: PhaseLockReal,
    /// Growth rate of the response amplitude at phase resonance, per drive amplitude, 1/s.
    pub response_gain: PhaseLockReal,
    /// Largest phase error that counts as locked, mean over the dwell, rad.
    pub phase_tolerance: PhaseLockReal,
    /// Phase error above which the lock is lost, mean over a period, rad.
    pub unlock_tolerance: PhaseLockReal,
    /// Largest relative drift of the frequency per period in a lock.
    pub frequency_drift: PhaseLockReal,
    /// Largest relative drift of the response amplitude per period in a lock.
    pub amplitude_drift: PhaseLockReal,
    /// Smallest share of the fundamental in the power of a valid signal, 0 to 1.
    pub coherence_min: PhaseLockReal,
    /// Smallest valid response amplitude, as a multiple of amplitude.
    pub response_min: PhaseLockReal,
    /// Reading of the response sensor above which the drive is switched off, m.
    pub response_max: PhaseLockOptional,
    /// Longest time from the end of the ramp to the lock, s.
    pub acquire_timeout: PhaseLockOptional,
    /// Longest time in the closed loop without a valid measurement, s.
    pub signal_timeout: PhaseLockOptional,
    /// Largest difference between a reading and its prediction, as a share of the amplitude, beyond twice those of the last periods.
    pub residual_max: PhaseLockOptional,
    /// Whether a sensor measures the base.
    pub reference_connected: bool,
    /// Time for which the lock criterion must hold, periods.
    pub dwell: u32,
    /// Number of harmonics of the adaptive filter, 1 to 8.
    pub harmonics: u8,
    /// Harmonics 1, 3, 5, ... instead of 1, 2, 3, ...
    pub odd_only: bool,
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
