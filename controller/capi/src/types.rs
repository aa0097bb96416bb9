//! The structures of the header. Units are those of the core: m, s, rad, rad/s.

use phase_lock::{
    Config, Detector, Fault, Input, LockCriterion, Move, Output, Phase, PhaseLock, State,
};

/// Storage of a controller and its state, set up by phase_lock_init. To be copied, not looked into.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct PhaseLockController {
    /// Opaque.
    pub words: [u64; 256],
}

/// What is stored.
#[derive(Clone, Copy)]
pub(crate) struct Stored {
    pub lock: PhaseLock,
    pub state: State,
}

const _: () = assert!(size_of::<Stored>() <= size_of::<PhaseLockController>());
const _: () = assert!(align_of::<Stored>() <= align_of::<PhaseLockController>());

/// Everything that can be chosen; begin with phase_lock_config_for_resonance.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PhaseLockConfig {
    /// Time from sample to sample, s.
    pub sample_time: f64,
    /// Frequency before the loop closes, rad/s.
    pub omega_start: f64,
    /// Lowest frequency allowed, rad/s.
    pub omega_min: f64,
    /// Highest frequency allowed, rad/s.
    pub omega_max: f64,
    /// Largest rate of change of the frequency, rad/s^2; 0 for none.
    pub omega_rate: f64,
    /// Drive amplitude wanted, m.
    pub amplitude: f64,
    /// Largest drive amplitude allowed, m; 0 for none.
    pub amplitude_max: f64,
    /// Time of a ramp of the drive from 0 to amplitude, s, also down after a fault; 0 to jump.
    pub ramp_time: f64,
    /// Time of a ramp of the drive to 0 where active is taken away, s; 0 to switch off at once.
    pub release_time: f64,
    /// Bandwidth of the control of the measured base amplitude, rad/s; 0 for none.
    pub base_bandwidth: f64,
    /// Phase of the response relative to the reference that is sought, rad.
    pub phase_target: f64,
    /// Bandwidth of the detector, rad/s: the tuning knob.
    pub bandwidth: f64,
    /// Damping rate of the structure, rad/s; 0 where unknown.
    pub damping_rate: f64,
    /// Delay from the drive to the sample of the sensor, s; used where no reference is connected.
    pub delay: f64,
    /// By how much a drive of 1 m makes the response grow in 1 s at phase resonance, 1/s.
    pub response_gain: f64,
    /// Largest phase error that counts as locked, mean over a period, rad.
    pub phase_tolerance: f64,
    /// Phase error at which a lock is lost, mean over a period, rad.
    pub unlock_tolerance: f64,
    /// Largest relative drift of the frequency per period in a lock.
    pub frequency_drift: f64,
    /// Largest relative drift of the response amplitude per period in a lock.
    pub amplitude_drift: f64,
    /// Smallest share of the fundamental in the power of a signal that is believed, 0 to 1.
    pub coherence_min: f64,
    /// Smallest response amplitude that is believed, as a multiple of amplitude.
    pub response_min: f64,
    /// Reading of the response sensor above which the drive is taken away, m; 0 for none.
    pub response_max: f64,
    /// Time allowed from the end of the ramp to the lock, s; 0 for ever.
    pub acquire_timeout: f64,
    /// How long a lock must hold before it counts, periods.
    pub dwell: u32,
    /// Harmonics of the adaptive filter, 1 to 8; 0 for a synchronous demodulator instead.
    pub harmonics: u8,
    /// Harmonics 1, 3, 5, ... instead of 1, 2, 3, ...
    pub odd_only: bool,
}

/// What the sensors read at a sample, and what the operator wants.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PhaseLockInput {
    /// Response of the structure, m.
    pub response: f64,
    /// Displacement of the base, m.
    pub reference: f64,
    /// Whether a sensor reads the base at all.
    pub has_reference: bool,
    /// Whether the drive is wanted. Going from false to true arms the controller, also after a fault.
    pub active: bool,
}

/// State of the sequence.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PhaseLockStage {
    /// Not armed.
    Idle = 0,
    /// The drive rises, the loop is open.
    Ramping = 1,
    /// The loop is closed, and not yet locked.
    Acquiring = 2,
    /// Phase resonance is held.
    Locked = 3,
    /// The phase escaped; latched, the drive ramps down.
    LockLost = 4,
    /// Another fault; latched, the drive ramps down.
    Tripped = 5,
    /// Taken out of service: the drive is released.
    ShutDown = 6,
}

/// Why the drive was taken away.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PhaseLockFault {
    /// It was not.
    None = 0,
    /// A sensor read no number, or one beyond all reason.
    Sensor = 1,
    /// The response exceeded response_max.
    ResponseTooLarge = 2,
    /// No lock within acquire_timeout.
    TimedOut = 3,
    /// The phase escaped, or the response was lost in noise.
    LockLost = 4,
}

/// What the controller wants until the next sample, and what it knows.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PhaseLockOutput {
    /// Drive frequency, rad/s.
    pub omega: f64,
    /// Drive amplitude, m.
    pub amplitude: f64,
    /// Base displacement wanted at this sample, m.
    pub drive: f64,
    /// Phase of the response relative to the reference less the target, rad.
    pub phase_error: f64,
    /// Amplitude of the response's fundamental, m.
    pub response_amplitude: f64,
    /// Response amplitude that is held, m; 0 where the drive is.
    pub response_target: f64,
    /// Amplitude of the reference's fundamental, m.
    pub reference_amplitude: f64,
    /// Share of the fundamental in the power of the response, 0 to 1.
    pub coherence: f64,
    /// Mean frequency over the running dwell, rad/s.
    pub frequency: f64,
    /// Mean response amplitude over the running dwell, m.
    pub response_mean: f64,
    /// State of the sequence.
    pub stage: PhaseLockStage,
    /// Why the drive was taken away.
    pub fault: PhaseLockFault,
    /// Phase resonance is held.
    pub locked: bool,
    /// Phase, frequency and amplitude have been stationary for the whole dwell.
    pub settled: bool,
}

/// A change of the amplitude at which the response is held.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PhaseLockMove {
    /// Response amplitude to go to, m.
    pub response: f64,
    /// How long the way there takes, s.
    pub duration: f64,
    /// Change of the drive amplitude that is expected, m; 0 where unknown.
    pub amplitude: f64,
    /// Change of the frequency that is expected, rad/s; 0 where unknown.
    pub omega: f64,
}

impl From<&PhaseLockConfig> for Config {
    fn from(c: &PhaseLockConfig) -> Self {
        let detector = match c.harmonics {
            0 => Detector::Demodulator,
            harmonics => Detector::Adaptive {
                harmonics,
                odd_only: c.odd_only,
            },
        };
        Self {
            sample_time: c.sample_time,
            omega_start: c.omega_start,
            omega_min: c.omega_min,
            omega_max: c.omega_max,
            omega_rate: c.omega_rate,
            amplitude: c.amplitude,
            amplitude_max: c.amplitude_max,
            ramp_time: c.ramp_time,
            release_time: c.release_time,
            base_bandwidth: c.base_bandwidth,
            phase_target: c.phase_target,
            detector,
            bandwidth: c.bandwidth,
            damping_rate: c.damping_rate,
            delay: c.delay,
            response_gain: c.response_gain,
            lock: LockCriterion {
                phase_tolerance: c.phase_tolerance,
                unlock_tolerance: c.unlock_tolerance,
                frequency_drift: c.frequency_drift,
                amplitude_drift: c.amplitude_drift,
                dwell: c.dwell,
                coherence_min: c.coherence_min,
                response_min: c.response_min,
            },
            response_max: c.response_max,
            acquire_timeout: c.acquire_timeout,
        }
    }
}

impl From<&Config> for PhaseLockConfig {
    fn from(c: &Config) -> Self {
        let (harmonics, odd_only) = match c.detector {
            Detector::Demodulator => (0, false),
            Detector::Adaptive {
                harmonics,
                odd_only,
            } => (harmonics, odd_only),
        };
        Self {
            sample_time: c.sample_time,
            omega_start: c.omega_start,
            omega_min: c.omega_min,
            omega_max: c.omega_max,
            omega_rate: c.omega_rate,
            amplitude: c.amplitude,
            amplitude_max: c.amplitude_max,
            ramp_time: c.ramp_time,
            release_time: c.release_time,
            base_bandwidth: c.base_bandwidth,
            phase_target: c.phase_target,
            bandwidth: c.bandwidth,
            damping_rate: c.damping_rate,
            delay: c.delay,
            response_gain: c.response_gain,
            phase_tolerance: c.lock.phase_tolerance,
            unlock_tolerance: c.lock.unlock_tolerance,
            frequency_drift: c.lock.frequency_drift,
            amplitude_drift: c.lock.amplitude_drift,
            coherence_min: c.lock.coherence_min,
            response_min: c.lock.response_min,
            response_max: c.response_max,
            acquire_timeout: c.acquire_timeout,
            dwell: c.lock.dwell,
            harmonics,
            odd_only,
        }
    }
}

impl From<&PhaseLockInput> for Input {
    fn from(input: &PhaseLockInput) -> Self {
        Self {
            response: input.response,
            reference: input.has_reference.then_some(input.reference),
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
        }
    }
}

impl From<Output> for PhaseLockOutput {
    fn from(o: Output) -> Self {
        Self {
            omega: o.omega,
            amplitude: o.amplitude,
            drive: o.drive,
            phase_error: o.phase_error,
            response_amplitude: o.response_amplitude,
            response_target: o.response_target,
            reference_amplitude: o.reference_amplitude,
            coherence: o.coherence,
            frequency: o.frequency,
            response_mean: o.response_mean,
            stage: match o.state {
                Phase::Idle => PhaseLockStage::Idle,
                Phase::Ramping => PhaseLockStage::Ramping,
                Phase::Acquiring => PhaseLockStage::Acquiring,
                Phase::Locked => PhaseLockStage::Locked,
                Phase::LockLost => PhaseLockStage::LockLost,
                Phase::Tripped => PhaseLockStage::Tripped,
                Phase::ShutDown => PhaseLockStage::ShutDown,
            },
            fault: match o.fault {
                None => PhaseLockFault::None,
                Some(Fault::Sensor) => PhaseLockFault::Sensor,
                Some(Fault::ResponseTooLarge) => PhaseLockFault::ResponseTooLarge,
                Some(Fault::TimedOut) => PhaseLockFault::TimedOut,
                Some(Fault::LockLost) => PhaseLockFault::LockLost,
            },
            locked: o.locked,
            settled: o.settled,
        }
    }
}
