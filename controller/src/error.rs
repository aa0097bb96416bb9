//! Error of a configuration.

use crate::range::Range;
use crate::real::Real;

use core::fmt;

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

/// A value to check.
pub(crate) struct Quantity {
    pub name: &'static str,
    pub value: Real,
    pub unit: &'static str,
}

impl Quantity {
    pub const fn new(name: &'static str, value: Real, unit: &'static str) -> Self {
        Self { name, value, unit }
    }

    /// Accepts a finite value that is `valid`.
    pub fn check(&self, valid: bool, allowed: &'static str) -> Result<(), ConfigError> {
        if self.value.is_finite() && valid {
            return Ok(());
        }
        Err(self.refuse(allowed))
    }

    /// The error for this value.
    pub fn refuse(&self, allowed: &'static str) -> ConfigError {
        ConfigError {
            name: self.name,
            value: Some(self.value),
            unit: self.unit,
            allowed,
        }
    }

    /// Accepts a value in the range.
    pub fn within(&self, range: Range) -> Result<(), ConfigError> {
        self.check(range.contains(self.value), range.allowed())
    }
}
