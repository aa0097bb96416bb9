//! What is wrong with a configuration.

use core::fmt;

/// A value of a [`Config`](crate::Config) that makes no sense: which, its unit, and what is allowed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ConfigError {
    /// Name of the field.
    pub name: &'static str,
    /// The value refused.
    pub value: f64,
    /// Its unit; empty for a pure number.
    pub unit: &'static str,
    /// What would have been accepted.
    pub allowed: &'static str,
}

impl fmt::Display for ConfigError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} = {}", self.name, self.value)?;
        if !self.unit.is_empty() {
            write!(f, " {}", self.unit)?;
        }
        write!(f, " is refused; allowed is {}", self.allowed)
    }
}

impl core::error::Error for ConfigError {}

/// A value under test.
pub(crate) struct Quantity {
    pub name: &'static str,
    pub value: f64,
    pub unit: &'static str,
}

impl Quantity {
    pub const fn new(name: &'static str, value: f64, unit: &'static str) -> Self {
        Self { name, value, unit }
    }

    /// Passes a finite value for which `holds`.
    pub fn check(&self, holds: bool, allowed: &'static str) -> Result<(), ConfigError> {
        if self.value.is_finite() && holds {
            return Ok(());
        }
        Err(ConfigError {
            name: self.name,
            value: self.value,
            unit: self.unit,
            allowed,
        })
    }

    pub fn positive(&self) -> Result<(), ConfigError> {
        self.check(self.value > 0.0, "a finite number above 0")
    }

    pub fn not_negative(&self) -> Result<(), ConfigError> {
        self.check(self.value >= 0.0, "a finite number, 0 or above")
    }
}
