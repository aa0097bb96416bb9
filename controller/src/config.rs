//! The configuration in SI units: its fields, the table that lists them by name, unit and range, and the relations between them.
//!
//! Everything that lists parameters is derived from the table or checked against it: the checks of [`Config::build`], the FMU and its
//! `modelDescription.xml`, the structure of the C interface, and what the lab passes to a controller FMU and writes into an SSP file.

use core::fmt;

use crate::gains::Gains;
use crate::real::consts::{FRAC_PI_2, PI, TAU};
use crate::real::{self, LARGEST, Real};

/// Largest number of harmonics of the adaptive filter.
pub const MAX_HARMONICS: usize = 8;

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
    /// Largest phase error that counts as locked, mean over the dwell, rad.
    pub phase_tolerance: Real,
    /// Phase error, mean over a period, above which the lock is lost, rad; at least `phase_tolerance`.
    pub unlock_tolerance: Real,
    /// Largest relative drift of the frequency per period, beyond what the noise of the response explains.
    pub frequency_drift: Real,
    /// Largest relative drift of the response amplitude per period, beyond what its noise explains.
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

    /// Share of its error that a first-order filter of this bandwidth (rad/s) corrects per sample.
    pub(crate) fn step(&self, bandwidth: Real) -> Real {
        -real::expm1(-bandwidth * self.sample_time)
    }

    /// Change per sample at this rate; infinite without a limit.
    pub(crate) fn change(&self, rate: Option<Real>) -> Real {
        rate.map_or(Real::INFINITY, |rate| rate * self.sample_time)
    }

    /// Number of coefficients that the detector updates with a sample: the offset, and two per harmonic.
    fn coefficients(&self) -> Real {
        match self.detector {
            Detector::Adaptive => Real::from(2 * self.harmonics + 1),
            Detector::Demodulator => 1.0,
        }
    }

    /// Largest bandwidth of the detector, rad/s, for this sample time and number of harmonics.
    #[must_use]
    pub fn bandwidth_max(&self) -> Real {
        1.0 / (self.coefficients() * self.sample_time)
    }

    /// Order of the highest harmonic of the detector. The sampling must resolve it up to `omega_max`.
    #[must_use]
    pub fn highest_harmonic(&self) -> usize {
        match self.detector {
            Detector::Adaptive if self.odd_only => 2 * usize::from(self.harmonics) - 1,
            Detector::Adaptive => self.harmonics.into(),
            Detector::Demodulator => 2,
        }
    }

    /// Refuses the first parameter that is out of its range or contradicts another.
    pub(crate) fn check(&self) -> Result<(), ConfigError> {
        for parameter in &PARAMETERS {
            parameter
                .range
                .check(parameter.name, parameter.get(self).number(), parameter.unit)?;
        }
        let require = |valid: bool, name: &str, allowed: &'static str| {
            let parameter = Parameter::find(name).expect("a row of the table");
            if valid {
                Ok(())
            } else {
                Err(parameter.refuse(parameter.get(self), allowed))
            }
        };
        let within = (self.omega_min..=self.omega_max).contains(&self.omega_start);
        require(
            self.omega_max > self.omega_min,
            "omega_max",
            "a finite number above omega_min",
        )?;
        require(within, "omega_start", "between omega_min and omega_max")?;
        require(
            self.amplitude <= self.amplitude_limit(),
            "amplitude",
            "a finite number, 0 or above and at most amplitude_max",
        )?;
        require(
            self.base_bandwidth.is_none_or(|bandwidth| bandwidth <= self.bandwidth),
            "base_bandwidth",
            "above 0 and at most bandwidth, or none",
        )?;
        // Below a sum of the steps of 1 the adaptive filter converges without oscillation.
        require(
            self.coefficients() * self.step(self.bandwidth) <= 1.0,
            "bandwidth",
            "lower: (2 harmonics + 1) bandwidth sample_time must stay below 1",
        )?;
        require(
            self.omega_max * self.sample_time * (self.highest_harmonic() as Real) < PI,
            "sample_time",
            "more than two samples per period of the highest harmonic at omega_max",
        )?;
        let gains = self.gains();
        let largest = gains.proportional + gains.integral * self.sample_time + 1.0 / self.sample_time;
        require(
            (largest / self.response_gain).is_finite(),
            "damping_rate",
            "a lower value, or none: for this bandwidth, response_gain and sample_time the gains overflow",
        )?;
        // The phase of a longer delay is lost in rounding.
        require(
            self.omega_max * self.delay * Real::EPSILON < 1.0,
            "delay",
            "0 or above, and so short that the rounding error of omega_max delay is below 1 rad",
        )?;
        require(
            self.lock.unlock_tolerance >= self.lock.phase_tolerance,
            "lock.unlock_tolerance",
            "a finite number, lock.phase_tolerance or above",
        )
    }
}

/// Invokes the macro `$with` with one row per parameter:
/// `group field: type, unit, range;`. The group is `config` for a field of [`Config`] and `lock` for one of
/// [`LockCriterion`](crate::LockCriterion). Other crates derive code from it that names the fields.
#[macro_export]
macro_rules! parameters {
    ($with:ident) => {
        $with! {
            config sample_time: real, "s", Positive;
            config omega_start: real, "rad/s", Positive;
            config omega_min: real, "rad/s", Positive;
            config omega_max: real, "rad/s", Positive;
            config omega_rate: optional, "rad/s2", Optional;
            config amplitude: real, "m", NotNegative;
            config amplitude_max: optional, "m", Optional;
            config ramp_rate: optional, "m/s", Optional;
            config release_rate: optional, "m/s", Optional;
            config base_bandwidth: optional, "rad/s", Optional;
            config phase_target: real, "rad", Angle;
            config detector: detector, "", Detector;
            config harmonics: integer, "", Harmonics;
            config odd_only: boolean, "", Boolean;
            config bandwidth: real, "rad/s", Positive;
            config damping_rate: optional, "rad/s", Optional;
            config delay: real, "s", NotNegative;
            lock phase_tolerance: real, "rad", Positive;
            lock unlock_tolerance: real, "rad", Positive;
            lock frequency_drift: real, "", Positive;
            lock amplitude_drift: real, "", Positive;
            lock dwell: integer, "periods", Dwell;
            lock coherence_min: real, "", Share;
            lock response_min: real, "", NotNegative;
            config response_max: optional, "m", Optional;
            config acquire_timeout: optional, "s", Optional;
            config signal_timeout: optional, "s", Optional;
            config residual_max: optional, "", Optional;
            config reference_connected: boolean, "", Boolean;
            config response_gain: real, "1/s", Positive;
        }
    };
}

/// A value of a parameter. The types are those of FMI.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Value {
    /// A real number.
    Real(Real),
    /// A whole number.
    Integer(i32),
    /// True or false.
    Boolean(bool),
}

impl Value {
    /// The value as a real number, with 1 for true and 0 for false.
    pub(crate) fn number(self) -> Real {
        match self {
            Self::Real(value) => value,
            Self::Integer(value) => value as Real,
            Self::Boolean(value) => u8::from(value).into(),
        }
    }
}

/// The number that means "none" for an optional parameter, where the interface knows only numbers.
pub const NONE: Real = -1.0;

/// The values that a parameter may have, whatever the values of the others are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Range {
    /// Above 0, and neither so small nor so large that products overflow.
    Positive,
    /// 0 or above, and not so large that products overflow.
    NotNegative,
    /// As [`Range::Positive`], or [`NONE`].
    Optional,
    /// Of either sign, and not so large that products overflow.
    Signed,
    /// From -pi to pi.
    Angle,
    /// Above 0 and below 1.
    Share,
    /// 1 (adaptive) or 2 (demodulator).
    Detector,
    /// From 1 to [`MAX_HARMONICS`].
    Harmonics,
    /// From 1 to 1,000,000.
    Dwell,
    /// True or false.
    Boolean,
}

impl Range {
    /// Whether the range contains the number.
    #[must_use]
    pub fn contains(self, number: Real) -> bool {
        let is_positive = number >= 1.0 / LARGEST;
        let is_whole = |highest: Real| number >= 1.0 && number <= highest;
        number.abs() <= LARGEST
            && match self {
                Self::Positive => is_positive,
                Self::NotNegative => number >= 0.0,
                Self::Optional => is_positive || number == NONE,
                Self::Signed | Self::Boolean => true,
                Self::Angle => number.abs() <= PI,
                Self::Share => number > 0.0 && number < 1.0,
                Self::Detector => number == 1.0 || number == 2.0,
                Self::Harmonics => is_whole(MAX_HARMONICS as Real),
                Self::Dwell => is_whole(1e6),
            }
    }

    /// Refuses a number that the range does not contain.
    pub(crate) fn check(self, name: &'static str, value: Real, unit: &'static str) -> Result<(), ConfigError> {
        if self.contains(value) {
            return Ok(());
        }
        Err(ConfigError { name, value: Some(value), unit, allowed: self.allowed() })
    }

    /// The range in words.
    #[must_use]
    pub fn allowed(self) -> &'static str {
        match self {
            Self::Positive => real::POSITIVE,
            Self::NotNegative => real::NOT_NEGATIVE,
            Self::Optional => real::OPTIONAL,
            Self::Signed => real::SIGNED,
            Self::Angle => "between -pi and pi",
            Self::Share => "above 0 and below 1",
            Self::Detector => "1 (adaptive) or 2 (demodulator)",
            Self::Harmonics => "1 to 8",
            Self::Dwell => "1 to 1000000",
            Self::Boolean => "true or false",
        }
    }
}

/// A parameter of the controller.
#[derive(Clone, Copy, Debug)]
pub struct Parameter {
    /// Name, as in the FMU; a parameter of the lock criterion begins with `lock.`.
    pub name: &'static str,
    /// Unit; empty for a pure number.
    pub unit: &'static str,
    /// Range.
    pub range: Range,
    field: Field,
}

impl Parameter {
    /// The parameter of that name.
    #[must_use]
    pub fn find(name: &str) -> Option<&'static Self> {
        PARAMETERS.iter().find(|parameter| parameter.name == name)
    }

    /// The value in a configuration.
    #[must_use]
    pub fn get(&self, config: &Config) -> Value {
        self.field.get(config)
    }

    /// Sets the value. A real number out of range is stored, because ranges may depend on values that are set later;
    /// [`Config::build`] refuses it.
    ///
    /// # Errors
    /// A value of another type, or a whole number out of range.
    pub fn set(&self, config: &mut Config, value: Value) -> Result<(), ConfigError> {
        let same_type = match (self.get(config), value) {
            (Value::Real(_), Value::Real(_)) => true,
            (Value::Integer(_), Value::Integer(_)) | (Value::Boolean(_), Value::Boolean(_)) => {
                self.range.contains(value.number())
            }
            _ => false,
        };
        if !same_type {
            return Err(self.refuse(value, self.range.allowed()));
        }
        self.field.set(config, value);
        Ok(())
    }

    fn refuse(&self, value: Value, allowed: &'static str) -> ConfigError {
        ConfigError {
            name: self.name,
            value: Some(value.number()),
            unit: self.unit,
            allowed,
        }
    }
}

macro_rules! name {
    (config, $field:ident) => {
        stringify!($field)
    };
    (lock, $field:ident) => {
        concat!("lock.", stringify!($field))
    };
}

macro_rules! place {
    ($config:ident, config, $field:ident) => {
        $config.$field
    };
    ($config:ident, lock, $field:ident) => {
        $config.lock.$field
    };
}

// A setter receives a value of its type and, if it is a whole number, in its range: `Parameter::set` checks both.
macro_rules! getter {
    (real, $place:expr) => {
        Value::Real($place)
    };
    (optional, $place:expr) => {
        // A value equal to the number for "none" is invalid; it must not read as "none", so that the check refuses it.
        Value::Real($place.map_or(NONE, |value| if value == NONE { 0.0 } else { value }))
    };
    (integer, $place:expr) => {
        Value::Integer(i32::try_from($place).unwrap_or(i32::MAX))
    };
    (boolean, $place:expr) => {
        Value::Boolean($place)
    };
    (detector, $place:expr) => {
        Value::Integer($place as i32)
    };
}

macro_rules! setter {
    (real, $place:expr, $value:ident) => {
        $place = $value.number()
    };
    (optional, $place:expr, $value:ident) => {
        $place = Some($value.number()).filter(|number| *number != NONE)
    };
    (integer, $place:expr, $value:ident) => {
        $place = $value.number() as _
    };
    (boolean, $place:expr, $value:ident) => {
        $place = $value == Value::Boolean(true)
    };
    (detector, $place:expr, $value:ident) => {
        $place = if $value == Value::Integer(Detector::Demodulator as i32) {
            Detector::Demodulator
        } else {
            Detector::Adaptive
        }
    };
}

macro_rules! table {
    ($($group:ident $field:ident: $type:ident, $unit:literal, $range:ident;)*) => {
        /// The field of a parameter. (One function for all fields is smaller than one for each.)
        #[allow(non_camel_case_types)]
        #[derive(Clone, Copy, Debug)]
        enum Field { $($field),* }

        impl Field {
            fn get(self, config: &Config) -> Value {
                match self { $(Self::$field => getter!($type, place!(config, $group, $field)),)* }
            }

            fn set(self, config: &mut Config, value: Value) {
                match self { $(Self::$field => setter!($type, place!(config, $group, $field), value),)* }
            }
        }

        /// All parameters.
        pub static PARAMETERS: [Parameter; [$(stringify!($field)),*].len()] = [$(
            Parameter {
                name: name!($group, $field),
                unit: $unit,
                range: Range::$range,
                field: Field::$field,
            },
        )*];
    };
}

parameters!(table);

/// An invalid value of a [`Config`](crate::Config) or of a call: its name, value and unit, and the allowed values.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ConfigError {
    /// Name of the field.
    pub name: &'static str,
    /// The invalid value; `None`: an option that is needed is absent.
    pub value: Option<Real>,
    /// Unit; empty for a pure number.
    pub unit: &'static str,
    /// The allowed values.
    pub allowed: &'static str,
}

/// A number in a message. In full, 1e300 would fill a line.
#[derive(Clone, Copy, Debug)]
pub struct Number(pub Real);

impl fmt::Display for Number {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.0 == 0.0 || (1e-4..1e7).contains(&self.0.abs()) {
            write!(f, "{}", self.0)
        } else {
            write!(f, "{:e}", self.0)
        }
    }
}

impl fmt::Display for ConfigError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} = ", self.name)?;
        match self.value {
            None => f.write_str("none")?,
            Some(value) => write!(f, "{}", Number(value))?,
        }
        if self.value.is_some() && !self.unit.is_empty() {
            write!(f, " {}", self.unit)?;
        }
        write!(f, " is refused; allowed is {}", self.allowed)
    }
}

impl core::error::Error for ConfigError {}

#[cfg(all(test, not(feature = "f32")))]
mod tests;
