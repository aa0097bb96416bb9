//! The table of the parameters: for each its name, unit, range, and how to get and set it.
//!
//! Everything that lists parameters is derived from this table or checked against it: the checks of
//! [`Config::build`], the FMU and its `modelDescription.xml`, the structure of the C interface, the parameters that the
//! lab passes to a controller FMU and writes into an SSP file.

use crate::config::{Config, Detector};
use crate::error::{ConfigError, Quantity};
use crate::range::{NONE, Range, Value};
use crate::real::Real;

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
            return Err(self.refuse(value.number()));
        }
        self.field.set(config, value);
        Ok(())
    }

    /// Refuses a value out of range.
    pub(crate) fn check(&self, config: &Config) -> Result<(), ConfigError> {
        Quantity::new(self.name, self.get(config).number(), self.unit).within(self.range)
    }

    fn refuse(&self, value: Real) -> ConfigError {
        Quantity::new(self.name, value, self.unit).refuse(self.range.allowed())
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

#[cfg(all(test, not(feature = "f32")))]
mod tests {
    use super::*;

    #[test]
    fn a_value_that_was_set_is_the_value_that_is_got() {
        for parameter in &PARAMETERS {
            let mut config = Config::for_resonance(55.0, 1e-4);
            let before = config;
            let value = match parameter.get(&config) {
                Value::Real(value) => Value::Real(0.5 * value + 0.125),
                Value::Integer(1) => Value::Integer(2),
                Value::Integer(_) => Value::Integer(1),
                Value::Boolean(value) => Value::Boolean(!value),
            };
            parameter.set(&mut config, value).expect(parameter.name);
            assert_eq!(parameter.get(&config), value, "{}", parameter.name);
            let changed = PARAMETERS
                .iter()
                .filter(|other| other.get(&config) != other.get(&before));
            assert_eq!(changed.count(), 1, "{}", parameter.name);
        }
    }

    #[test]
    fn an_option_is_absent_only_at_the_number_for_none() {
        let parameter = Parameter::find("response_max").expect("a parameter");
        let mut config = Config::for_resonance(55.0, 1e-4);
        for (value, expected) in [(NONE, None), (0.1, Some(0.1)), (0.0, Some(0.0)), (-2.0, Some(-2.0))] {
            parameter.set(&mut config, Value::Real(value)).expect("a real number");
            assert_eq!(config.response_max, expected);
            assert_eq!(config.build().is_ok(), value == NONE || value > 0.0, "{value}");
        }
        config.response_max = Some(NONE);
        assert!(config.build().is_err());
    }

    #[test]
    fn a_value_of_another_type_is_refused_by_name_and_unit() {
        let mut config = Config::for_resonance(55.0, 1e-4);
        let refused = Parameter::find("delay")
            .expect("a parameter")
            .set(&mut config, Value::Integer(-3))
            .expect_err("an integer is refused");
        assert_eq!((refused.name, refused.value, refused.unit), ("delay", Some(-3.0), "s"));
    }

    #[test]
    fn a_whole_number_out_of_range_is_refused_at_once() {
        let mut config = Config::for_resonance(55.0, 1e-4);
        for (name, value) in [("harmonics", 9), ("harmonics", -1), ("lock.dwell", 0), ("detector", 3)] {
            let refused = Parameter::find(name)
                .expect("a parameter")
                .set(&mut config, Value::Integer(value));
            assert_eq!(refused.expect_err(name).value, Some(f64::from(value)));
        }
    }
}
