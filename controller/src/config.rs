//! The configuration, in SI units.

use core::f64::consts::{FRAC_PI_2, PI, TAU};

use crate::controller::PhaseLock;
use crate::error::{ConfigError, Quantity};
use crate::harmonics::MAX_HARMONICS;

/// How amplitude and phase of the fundamental are found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Detector {
    /// An adaptive (least mean squares) filter: follows an offset and several harmonics together, so that none ripples
    /// through the others.
    Adaptive {
        /// How many harmonics, the fundamental included; 1 to [`MAX_HARMONICS`].
        harmonics: u8,
        /// 1, 3, 5, … instead of 1, 2, 3, …; an impacting rig with equal walls has odd ones only.
        odd_only: bool,
    },
    /// Synchronous demodulation with a first order low pass: ripples at twice the frequency. To compare.
    Demodulator,
}

/// When the loop counts as locked, and when no more.
///
/// The phase locks long before the amplitude has settled. Where the slowest mode relaxes with a time constant of `T`
/// periods, a drift of `x` per period leaves `T x` to go. The defaults of [`LockCriterion::default`]
/// leave 0.03 % of the amplitude and 3.3e-5 of the frequency where `T` is 33, and 0.3 % of the amplitude where it is 270.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct LockCriterion {
    /// Largest phase error that counts as locked, mean over a period, rad.
    pub phase_tolerance: f64,
    /// Phase error, mean over a period, at which a lock is lost, rad; not below `phase_tolerance`.
    pub unlock_tolerance: f64,
    /// Largest relative drift of the frequency per period.
    pub frequency_drift: f64,
    /// Largest relative drift of the response amplitude per period.
    pub amplitude_drift: f64,
    /// How long all of this must hold, periods; rounded up to a multiple of 4.
    pub dwell: u32,
    /// Smallest share of the fundamental in the power of the signal, 0 to 1: noise has none.
    pub coherence_min: f64,
    /// Smallest response amplitude that is believed, as a multiple of the drive amplitude wanted. Silence never is.
    pub response_min: f64,
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

/// Everything that can be chosen, in SI units. [`Config::build`] checks it.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Config {
    /// Time from sample to sample, s.
    pub sample_time: f64,
    /// Frequency before the loop closes, rad/s.
    pub omega_start: f64,
    /// Lowest frequency allowed, rad/s.
    pub omega_min: f64,
    /// Highest frequency allowed, rad/s.
    pub omega_max: f64,
    /// Largest rate of change of the frequency, rad/s²; 0 for none.
    pub omega_rate: f64,
    /// Drive amplitude wanted, m; tunable.
    pub amplitude: f64,
    /// Largest drive amplitude allowed, m; 0 for none.
    pub amplitude_max: f64,
    /// Time of a ramp of the drive from 0 to `amplitude`, s, also down after a fault; 0 to jump. While the response is held
    /// the drive changes no faster either.
    pub ramp_time: f64,
    /// Time of a ramp of the drive from `amplitude` to 0 where `active` is taken away, s; 0 to switch off at once, which
    /// is what a free decay wants.
    pub release_time: f64,
    /// Bandwidth, rad/s, of the control that makes the *measured* amplitude of the base the wanted one; 0 where the
    /// shaker's gain can be trusted.
    pub base_bandwidth: f64,
    /// Phase of the response relative to the reference that is sought, rad; tunable.
    pub phase_target: f64,
    /// How phases and amplitudes are found.
    pub detector: Detector,
    /// Bandwidth of the detector, rad/s: the tuning knob, from which the gains follow.
    pub bandwidth: f64,
    /// Damping rate of the structure, rad/s (damping ratio times natural frequency); 0 where unknown.
    pub damping_rate: f64,
    /// Delay from the drive to the sample of the sensor, s. Used where no reference is connected. An oscillator in the
    /// rig that is handed `omega` from the first sample on keeps step by itself and has none; held samples of `drive` are
    /// late by half a sample.
    pub delay: f64,
    /// By how much a drive amplitude of 1 m makes the response amplitude grow in 1 s at phase resonance, 1/s: half the
    /// natural frequency (rad/s) for an oscillator shaken through its base. Only [`PhaseLock::hold_response`] uses it.
    pub response_gain: f64,
    /// When the loop counts as locked.
    pub lock: LockCriterion,
    /// Reading of the response sensor above which the drive is taken away, m; 0 for none.
    pub response_max: f64,
    /// Time allowed from the end of the ramp to the lock, s; 0 for ever.
    pub acquire_timeout: f64,
}

impl Config {
    /// A sensible start for a structure that resonates near `omega` (rad/s) and a base of the given amplitude (m):
    /// 100 samples per period, ±20 % of frequency, a bandwidth of a tenth of `omega`, no ramps, no limits and no time-out.
    #[must_use]
    pub fn for_resonance(omega: f64, amplitude: f64) -> Self {
        Self {
            sample_time: TAU / omega / 100.0,
            omega_start: omega,
            omega_min: 0.8 * omega,
            omega_max: 1.2 * omega,
            omega_rate: 0.0,
            amplitude,
            amplitude_max: 0.0,
            ramp_time: 0.0,
            release_time: 0.0,
            base_bandwidth: 0.0,
            phase_target: -FRAC_PI_2,
            detector: Detector::Adaptive {
                harmonics: 3,
                odd_only: true,
            },
            bandwidth: 0.1 * omega,
            damping_rate: 0.0,
            delay: 0.0,
            response_gain: 0.5 * omega,
            lock: LockCriterion::default(),
            response_max: 0.0,
            acquire_timeout: 0.0,
        }
    }

    /// Checks every value and computes the coefficients.
    ///
    /// # Errors
    /// The first value that makes no sense, with its unit and what is allowed.
    pub fn build(self) -> Result<PhaseLock, ConfigError> {
        self.check_frequencies()?;
        self.check_drive()?;
        self.check_detector()?;
        self.check_lock()?;
        Ok(PhaseLock::new(self))
    }

    /// Largest drive amplitude, m: infinite where none is set.
    pub(crate) fn amplitude_limit(&self) -> f64 {
        if self.amplitude_max > 0.0 {
            self.amplitude_max
        } else {
            f64::INFINITY
        }
    }

    fn check_frequencies(&self) -> Result<(), ConfigError> {
        Quantity::new("sample_time", self.sample_time, "s").positive()?;
        Quantity::new("omega_min", self.omega_min, "rad/s").positive()?;
        Quantity::new("omega_max", self.omega_max, "rad/s").check(
            self.omega_max > self.omega_min,
            "a finite number above omega_min",
        )?;
        Quantity::new("omega_start", self.omega_start, "rad/s").check(
            (self.omega_min..=self.omega_max).contains(&self.omega_start),
            "between omega_min and omega_max",
        )?;
        Quantity::new("omega_rate", self.omega_rate, "rad/s2").not_negative()
    }

    fn check_drive(&self) -> Result<(), ConfigError> {
        Quantity::new("amplitude_max", self.amplitude_max, "m").not_negative()?;
        Quantity::new("amplitude", self.amplitude, "m").check(
            (0.0..=self.amplitude_limit()).contains(&self.amplitude),
            "a finite number, 0 or above and at most amplitude_max",
        )?;
        Quantity::new("phase_target", self.phase_target, "rad")
            .check(self.phase_target.abs() <= PI, "between -pi and pi")?;
        Quantity::new("ramp_time", self.ramp_time, "s").not_negative()?;
        Quantity::new("release_time", self.release_time, "s").not_negative()?;
        Quantity::new("base_bandwidth", self.base_bandwidth, "rad/s").check(
            (0.0..=self.bandwidth).contains(&self.base_bandwidth),
            "between 0 and bandwidth",
        )
    }

    fn check_detector(&self) -> Result<(), ConfigError> {
        Quantity::new("bandwidth", self.bandwidth, "rad/s").positive()?;
        Quantity::new("damping_rate", self.damping_rate, "rad/s").not_negative()?;
        Quantity::new("delay", self.delay, "s").not_negative()?;
        Quantity::new("response_gain", self.response_gain, "1/s").positive()?;
        if let Detector::Adaptive { harmonics, .. } = self.detector {
            Quantity::new("harmonics", harmonics.into(), "")
                .check((1..=MAX_HARMONICS).contains(&harmonics.into()), "1 to 8")?;
        }
        let detector =
            crate::detector::Detector::new(self.detector, self.bandwidth, self.sample_time);
        Quantity::new("bandwidth", self.bandwidth, "rad/s").check(
            detector.total_step() <= 1.0,
            "lower: (2 harmonics + 1) bandwidth sample_time must stay below 1",
        )?;
        let highest = detector.highest_harmonic() as f64;
        Quantity::new("sample_time", self.sample_time, "s").check(
            self.omega_max * self.sample_time * highest < PI,
            "more than two samples per period of the highest harmonic at omega_max",
        )
    }

    fn check_lock(&self) -> Result<(), ConfigError> {
        let lock = &self.lock;
        Quantity::new("lock.phase_tolerance", lock.phase_tolerance, "rad").positive()?;
        Quantity::new("lock.unlock_tolerance", lock.unlock_tolerance, "rad").check(
            lock.unlock_tolerance >= lock.phase_tolerance,
            "a finite number, lock.phase_tolerance or above",
        )?;
        Quantity::new("lock.frequency_drift", lock.frequency_drift, "").positive()?;
        Quantity::new("lock.amplitude_drift", lock.amplitude_drift, "").positive()?;
        Quantity::new("lock.dwell", lock.dwell.into(), "periods")
            .check((1..=1_000_000).contains(&lock.dwell), "1 to 1000000")?;
        Quantity::new("lock.coherence_min", lock.coherence_min, "").check(
            lock.coherence_min > 0.0 && lock.coherence_min < 1.0,
            "above 0 and below 1",
        )?;
        Quantity::new("lock.response_min", lock.response_min, "").not_negative()?;
        Quantity::new("response_max", self.response_max, "m").not_negative()?;
        Quantity::new("acquire_timeout", self.acquire_timeout, "s").not_negative()
    }
}
