//! The configuration, in SI units.

use crate::real::consts::{FRAC_PI_2, TAU};

use crate::gains::Gains;
use crate::real::{LARGEST, Real};

/// Method by which amplitude and phase of the fundamental are estimated. The numbers are those of the FMU's `detector`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Detector {
    /// An adaptive (least mean squares) filter. It estimates the offset and several harmonics together, so that none of
    /// them causes ripple in the others.
    Adaptive = 1,
    /// Synchronous demodulation with a first-order low-pass filter, for comparison. Its estimate ripples at twice the
    /// frequency.
    Demodulator = 2,
}

/// Conditions under which the loop counts as locked, and under which the lock counts as lost.
///
/// The phase locks long before the amplitude has settled. If the slowest mode relaxes with a time constant of `T`
/// periods, a drift of `x` per period means that the distance to the steady state is still `T x`. The values of
/// [`LockCriterion::default`] leave 0.03 % of the amplitude and 3.3e-5 of the frequency for `T = 33`, and 0.3 % of the
/// amplitude for `T = 270`.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct LockCriterion {
    /// Largest phase error that counts as locked, mean over a quarter of the dwell, rad.
    pub phase_tolerance: Real,
    /// Phase error, mean over a period, above which the lock is lost, rad; at least `phase_tolerance`.
    pub unlock_tolerance: Real,
    /// Largest relative drift of the frequency per period; where noise is larger than such a drift, the noise is accepted.
    pub frequency_drift: Real,
    /// Largest relative drift of the response amplitude per period.
    pub amplitude_drift: Real,
    /// Time for which all conditions must hold, periods; rounded up to a multiple of 4.
    pub dwell: u32,
    /// Smallest share of the fundamental in the power of a valid signal, between 0 and 1. Noise has a small share.
    pub coherence_min: Real,
    /// Smallest valid response amplitude, as a multiple of the drive amplitude setpoint. A zero response is never valid.
    pub response_min: Real,
}

impl Default for LockCriterion {
    fn default() -> Self {
        Self {
            phase_tolerance: 5e-3,
            unlock_tolerance: 0.2,
            frequency_drift: 1e-6,
            amplitude_drift: 1e-5,
            dwell: 20,
            coherence_min: 0.5,
            response_min: 0.1,
        }
    }
}

/// All parameters of the controller, in SI units. [`Config::build`] checks them;
/// [`PARAMETERS`](crate::PARAMETERS) lists them by name.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Config {
    /// Sample time, s.
    pub sample_time: Real,
    /// Frequency while the loop is open, rad/s.
    pub omega_start: Real,
    /// Lowest frequency, rad/s.
    pub omega_min: Real,
    /// Highest frequency, rad/s.
    pub omega_max: Real,
    /// Largest rate of change of the frequency, rad/s².
    pub omega_rate: Option<Real>,
    /// Setpoint of the drive amplitude, m; tunable.
    pub amplitude: Real,
    /// Largest drive amplitude, m.
    pub amplitude_max: Option<Real>,
    /// Largest rate of change of the drive amplitude, m/s, in every ramp but the release: at the start, after a fault, to a new
    /// setpoint, and while the response amplitude is controlled. `None`: step changes.
    pub ramp_rate: Option<Real>,
    /// Rate of the drive ramp to 0 after `active` becomes false, m/s. `None`: switched off at once, as a free decay requires.
    pub release_rate: Option<Real>,
    /// Bandwidth of the control of the *measured* base amplitude, rad/s. `None`: no control, for a shaker whose gain is known.
    pub base_bandwidth: Option<Real>,
    /// Setpoint of the phase of the response relative to the reference, rad; tunable.
    pub phase_target: Real,
    /// Method of the phase detector.
    pub detector: Detector,
    /// Number of harmonics of the adaptive filter, including the fundamental; 1 to [`MAX_HARMONICS`](crate::MAX_HARMONICS).
    pub harmonics: u8,
    /// Whether the adaptive filter uses harmonics 1, 3, 5, … instead of 1, 2, 3, …. A rig with impacts at two equal walls
    /// has only odd ones.
    pub odd_only: bool,
    /// Bandwidth of the detector, rad/s: the tuning parameter, from which the gains follow.
    pub bandwidth: Real,
    /// Damping rate of the structure, rad/s (damping ratio times natural frequency). `None`: unknown; the gains are those of an
    /// undamped structure.
    pub damping_rate: Option<Real>,
    /// Delay from the drive to the sample of the sensor, s. Used if no reference is connected. A rig with an oscillator
    /// of its own that receives `omega` from the first sample on has no delay; a rig that holds the samples of `drive`
    /// has a delay of half a sample.
    pub delay: Real,
    /// Growth rate of the response amplitude at phase resonance, per drive amplitude, 1/s. For an oscillator excited
    /// through its base: half the natural frequency in rad/s. Used by
    /// [`PhaseLock::hold_response`](crate::PhaseLock::hold_response), and by the check of the response against the drive.
    pub response_gain: Real,
    /// Lock criterion.
    pub lock: LockCriterion,
    /// Reading of the response sensor above which the drive is switched off, m.
    pub response_max: Option<Real>,
    /// Longest time from the end of the ramp to the lock, s. The time in which [`PhaseLock::hold_response`](crate::PhaseLock::hold_response)
    /// controls the response does not count.
    pub acquire_timeout: Option<Real>,
    /// Longest time in the closed loop without a valid measurement, s: with too small an amplitude or too much noise.
    pub signal_timeout: Option<Real>,
    /// Largest difference between a reading and its prediction by the detector, as a share of the amplitude of the channel, beyond twice
    /// the differences of the last periods. `None`: any, and the response is not checked against the drive either.
    pub residual_max: Option<Real>,
    /// Whether a sensor measures the base. Without it the internal oscillator with the configured `delay` is the reference.
    pub reference_connected: bool,
}

impl Config {
    /// Suitable initial values for a structure with a resonance near `omega` (rad/s) and a base amplitude in m:
    /// 100 samples per period, ±20 % of frequency, a bandwidth of a tenth of `omega`, at most four times the base
    /// amplitude, changed no faster than a base with this amplitude moves, the range of the frequency in no less than a period, and
    /// 2000 periods for the lock. Only the limit of the
    /// response must be set. The release is a step.
    #[must_use]
    pub fn for_resonance(omega: Real, amplitude: Real) -> Self {
        Self {
            sample_time: TAU / omega / 100.0,
            omega_start: omega,
            omega_min: 0.8 * omega,
            omega_max: 1.2 * omega,
            omega_rate: Some(0.4 * omega * omega / TAU),
            amplitude,
            amplitude_max: Some(4.0 * amplitude),
            ramp_rate: Some(4.0 * amplitude * omega),
            release_rate: None,
            base_bandwidth: None,
            phase_target: -FRAC_PI_2,
            detector: Detector::Adaptive,
            harmonics: 3,
            odd_only: true,
            bandwidth: 0.1 * omega,
            damping_rate: None,
            delay: 0.0,
            response_gain: 0.5 * omega,
            lock: LockCriterion::default(),
            response_max: None,
            acquire_timeout: Some(2000.0 * TAU / omega),
            signal_timeout: Some(20.0 * TAU / omega),
            residual_max: Some(0.3),
            reference_connected: true,
        }
    }

    /// Largest drive amplitude, m; without a limit the largest that a parameter may have, so that no sum is infinite.
    pub(crate) fn amplitude_limit(&self) -> Real {
        self.amplitude_max.unwrap_or(LARGEST)
    }

    /// The gains of both loops.
    pub(crate) fn gains(&self) -> Gains {
        Gains::from_bandwidth(self.bandwidth, self.damping_rate.unwrap_or(0.0))
    }
}
