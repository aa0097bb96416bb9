//! The settings of the controller, in SI units: one table, the relations between its rows, and what follows from it.
//!
//! To add a setting, add a row to [`parameters!`](crate::parameters) and use the field that it makes. The row holds the description,
//! name, type, initial value, unit and range. From it follow the field of [`Config`] or [`LockCriterion`], the initial value, the check of the
//! range, the key of a scene in `[phase_lock]`, and what is generated from [`PARAMETERS`]: the variable in `modelDescription.xml`, and the row in
//! docs/controller-settings.md. The field of the C structure is in `capi/src/types.rs`, and the header follows from it. Tests compare all with
//! the table; `UPDATE=1 cargo test -p phase-lock -p phase-lock-fmu -p vines-testbench --test generated` writes what is generated. A row in
//! the middle of the table renumbers the variables of the FMU.

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

/// Invokes the macro `$with` with the table of the settings, one row each:
/// `/// description` and `name: type = initial value, unit, range;`. The initial value may depend on `omega`, a resonance in rad/s, and on
/// `amplitude`, of the base in m. The blocks `config` belong to [`Config`](crate::Config), and `lock` to
/// [`LockCriterion`](crate::LockCriterion). Other crates derive code from it that names the fields. In a description, "none" is the absent option.
#[macro_export]
macro_rules! parameters {
    ($with:ident) => {
        $with! {
            (omega, amplitude)
            config {
                /// Time from sample to sample; samples lie at 0, sample_time, 2 sample_time, … after the start.
                sample_time: Real = TAU / omega / 100.0, "s", Positive;
                /// Frequency while the loop is open, between omega_min and omega_max.
                omega_start: Real = omega, "rad/s", Positive;
                /// Lowest frequency.
                omega_min: Real = 0.8 * omega, "rad/s", Positive;
                /// Highest frequency.
                omega_max: Real = 1.2 * omega, "rad/s", Positive;
                /// Largest rate of change of the frequency; none: no limit.
                omega_rate: Option<Real> = Some(0.4 * omega * omega / TAU), "rad/s2", Optional;
                /// Setpoint of the drive amplitude, at most amplitude_max.
                amplitude: Real = amplitude, "m", NotNegative;
                /// Largest drive amplitude; none: no limit, and the response amplitude cannot be controlled.
                amplitude_max: Option<Real> = Some(4.0 * amplitude), "m", Optional;
                /// Largest rate of change of the drive amplitude in every ramp but the release: at the start, after a fault, to a new
                /// setpoint, and while the response amplitude is controlled; none: step changes.
                ramp_rate: Option<Real> = Some(4.0 * amplitude * omega), "m/s", Optional;
                /// Rate of the drive ramp to 0 after active becomes false; none: switched off at once, as a free decay requires.
                release_rate: Option<Real> = None, "m/s", Optional;
                /// Bandwidth of the control of the measured base amplitude; none: no control, for a shaker whose gain is known.
                base_bandwidth: Option<Real> = None, "rad/s", Optional;
                /// Setpoint of the phase of the response relative to the reference; -pi/2 is phase resonance.
                phase_target: Real = -FRAC_PI_2, "rad", Angle;
                /// Method of the phase detector: 1 adaptive harmonic filter, 2 synchronous demodulation.
                detector: Detector = Detector::Adaptive, "", Detector;
                /// Number of harmonics of the adaptive filter, 1 to 8, including the fundamental.
                harmonics: u8 = 3, "", Harmonics;
                /// Whether the adaptive filter uses harmonics 1, 3, 5, … instead of 1, 2, 3, …; a rig with impacts at two equal walls has
                /// only odd ones.
                odd_only: bool = true, "", Boolean;
                /// Bandwidth of the detector: the tuning parameter, from which the gains follow.
                bandwidth: Real = 0.1 * omega, "rad/s", Positive;
                /// Damping rate of the structure (damping ratio times natural frequency); none: unknown, and the gains suit an undamped structure.
                damping_rate: Option<Real> = None, "rad/s", Optional;
                /// Delay from the drive to the sample of the sensor; compensated if no reference is connected; half a sample for a rig that holds
                /// the samples of drive, 0 for a rig whose own oscillator receives omega.
                delay: Real = 0.0, "s", NotNegative;
            }
            lock {
                /// Largest phase error that counts as locked, mean over the dwell.
                phase_tolerance: Real = 5e-3, "rad", Positive;
                /// Phase error, mean over a period, above which the lock is lost; at least lock.phase_tolerance.
                unlock_tolerance: Real = 0.2, "rad", Positive;
                /// Largest relative drift of the frequency per period that counts as locked, beyond what the noise of the response explains.
                frequency_drift: Real = 1e-6, "", Positive;
                /// Largest relative drift of the response amplitude per period that counts as locked, beyond what its noise explains.
                amplitude_drift: Real = 1e-5, "", Positive;
                /// Time for which phase, frequency and amplitude must be stationary; rounded up to a multiple of 4.
                dwell: u32 = 20, "periods", Dwell;
                /// Smallest share of the fundamental in the power of a valid signal, between 0 and 1; noise has a small share.
                coherence_min: Real = 0.5, "", Share;
                /// Smallest valid response amplitude, as a multiple of amplitude; a zero response is never valid.
                response_min: Real = 0.1, "", NotNegative;
            }
            config {
                /// Reading of the response above which the drive is switched off; none: no limit.
                response_max: Option<Real> = None, "m", Optional;
                /// Longest time from the end of the ramp to the lock, without the time in which the response amplitude is controlled; none: no
                /// limit.
                acquire_timeout: Option<Real> = Some(2000.0 * TAU / omega), "s", Optional;
                /// Longest time in the closed loop without a valid measurement: with too small an amplitude or too much noise; none: no limit.
                signal_timeout: Option<Real> = Some(20.0 * TAU / omega), "s", Optional;
                /// Largest difference between a reading and its prediction, as a share of the amplitude, beyond twice the differences of the last
                /// periods; none: no limit, and the response is not checked against the drive.
                residual_max: Option<Real> = Some(0.3), "", Optional;
                /// Whether a sensor measures the base; false: the internal oscillator with the configured delay is the reference.
                reference_connected: bool = true, "", Boolean;
                /// Growth rate of the response amplitude at phase resonance, per drive amplitude; half of omega0 for excitation through the base.
                response_gain: Real = 0.5 * omega, "1/s", Positive;
            }
        }
    };
}

macro_rules! structures {
    (
        ($omega:ident, $amplitude:ident)
        config { $($(#[doc = $doc:literal])+ $field:ident: $type:ty = $initial:expr, $unit:literal, $range:ident;)* }
        lock { $($(#[doc = $lock_doc:literal])+ $lock:ident: $lock_type:ty = $lock_initial:expr, $lock_unit:literal, $lock_range:ident;)* }
        config { $($(#[doc = $last_doc:literal])+ $last:ident: $last_type:ty = $last_initial:expr, $last_unit:literal, $last_range:ident;)* }
    ) => {
        /// Conditions under which the loop counts as locked, and under which the lock counts as lost.
        ///
        /// The phase locks long before the amplitude has settled. If the slowest mode relaxes with a time constant of `T`
        /// periods, a drift of `x` per period means that the distance to the steady state is still `T x`. The initial values
        /// leave 0.03 % of the amplitude and 3.3e-5 of the frequency for `T = 33`, and 0.3 % of the amplitude for `T = 270`.
        #[derive(Clone, Copy, Debug, PartialEq)]
        #[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
        pub struct LockCriterion {
            $($(#[doc = $lock_doc])+ #[doc = concat!("\n\n[`Range::", stringify!($lock_range), "`] `", $lock_unit, " `")] pub $lock: $lock_type,)*
        }

        impl Default for LockCriterion {
            fn default() -> Self {
                Self { $($lock: $lock_initial,)* }
            }
        }

        /// All settings of the controller, in SI units. [`Config::build`] checks them; [`PARAMETERS`](crate::PARAMETERS) lists them by name.
        #[derive(Clone, Copy, Debug, PartialEq)]
        #[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
        pub struct Config {
            $($(#[doc = $doc])+ #[doc = concat!("\n\n[`Range::", stringify!($range), "`] `", $unit, " `")] pub $field: $type,)*
            /// Lock criterion.
            pub lock: LockCriterion,
            $($(#[doc = $last_doc])+ #[doc = concat!("\n\n[`Range::", stringify!($last_range), "`] `", $last_unit, " `")] pub $last: $last_type,)*
        }

        impl Config {
            /// Suitable initial values for a structure with a resonance near `omega` (rad/s) and a base amplitude in m:
            /// 100 samples per period, ±20 % of frequency, a bandwidth of a tenth of `omega`, at most four times the base
            /// amplitude, changed no faster than a base with this amplitude moves, the range of the frequency in no less than a period, and
            /// 2000 periods for the lock. Only the limit of the response must be set. The release is a step.
            #[must_use]
            pub fn for_resonance($omega: Real, $amplitude: Real) -> Self {
                Self {
                    $($field: $initial,)*
                    lock: LockCriterion::default(),
                    $($last: $last_initial,)*
                }
            }
        }
    };
}

parameters!(structures);

impl Config {
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
        require(
            self.delay * self.bandwidth <= 1.0,
            "delay",
            "0 or above, and at most 1/bandwidth, the lag of the detector for which the gains are made",
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

// From a field to its value, and back. `Parameter::set` has checked the type, and the range of a whole number.
macro_rules! conversions {
    ($($type:ty: $field:ident => $to:expr, $value:ident => $from:expr;)*) => {$(
        impl From<$type> for Value {
            fn from($field: $type) -> Self {
                $to
            }
        }

        impl From<Value> for $type {
            fn from($value: Value) -> Self {
                $from
            }
        }
    )*};
}

conversions! {
    Real: number => Self::Real(number), value => value.number();
    // A value equal to the number for "none" is invalid; it must not read as "none", so that the check refuses it.
    Option<Real>: option => Self::Real(option.map_or(NONE, |number| if number == NONE { 0.0 } else { number })),
        value => Some(value.number()).filter(|number| *number != NONE);
    bool: flag => Self::Boolean(flag), value => value == Value::Boolean(true);
    Detector: method => Self::Integer(method as i32),
        value => if value == Value::Integer(Self::Demodulator as i32) { Self::Demodulator } else { Self::Adaptive };
    u8: number => Self::Integer(number.into()), value => value.number() as Self;
    u32: number => Self::Integer(number.try_into().unwrap_or(i32::MAX)), value => value.number() as Self;
    i32: number => Self::Integer(number), value => value.number() as Self;
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

    /// What the parameter is.
    #[must_use]
    pub fn description(&self) -> &'static str {
        TEXTS[self.field as usize].0.trim()
    }

    /// Initial value, as a formula in `omega` and `amplitude`; see [`Config::for_resonance`].
    #[must_use]
    pub fn initial(&self) -> &'static str {
        TEXTS[self.field as usize].1
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

macro_rules! table {
    (
        ($omega:ident, $amplitude:ident)
        $($group:ident { $($(#[doc = $doc:literal])+ $field:ident: $type:ty = $initial:expr, $unit:literal, $range:ident;)* })*
    ) => {
        /// The field of a parameter. (One function for all fields is smaller than one for each.)
        #[allow(non_camel_case_types)]
        #[derive(Clone, Copy, Debug)]
        enum Field { $($($field,)*)* }

        impl Field {
            fn get(self, config: &Config) -> Value {
                match self { $($(Self::$field => place!(config, $group, $field).into(),)*)* }
            }

            fn set(self, config: &mut Config, value: Value) {
                match self { $($(Self::$field => place!(config, $group, $field) = value.into(),)*)* }
            }
        }

        /// All parameters.
        pub static PARAMETERS: [Parameter; [$($(stringify!($field)),*),*].len()] = [$($(
            Parameter {
                name: name!($group, $field),
                unit: $unit,
                range: Range::$range,
                field: Field::$field,
            },
        )*)*];

        /// Description and initial value of every parameter. (Apart from `PARAMETERS`, so that firmware does not contain them.)
        static TEXTS: [(&str, &str); PARAMETERS.len()] = [$($((concat!($($doc),+), stringify!($initial)),)*)*];
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

#[cfg(test)]
#[cfg(not(feature = "f32"))]
mod tests {
    use super::*;

    #[test]
    fn a_value_of_another_type_or_out_of_range_is_refused_by_name_and_unit() {
        let mut config = Config::for_resonance(55.0, 1e-4);
        for (name, value, unit) in [
            ("delay", -3, "s"),
            ("harmonics", 9, ""),
            ("harmonics", -1, ""),
            ("lock.dwell", 0, "periods"),
            ("detector", 3, ""),
        ] {
            let refused = Parameter::find(name)
                .expect("a parameter")
                .set(&mut config, Value::Integer(value));
            let refused = refused.expect_err(name);
            assert_eq!(
                (refused.name, refused.value, refused.unit),
                (name, Some(f64::from(value)), unit)
            );
        }
    }
}
