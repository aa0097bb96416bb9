//! Messages for the page: texts with `{}` for every number, which the page writes. Code that formats numbers is large, and a browser
//! has it.

use lovines::InvalidValue;
use phase_lock::ConfigError;
use vines_bench::experiment::ExperimentError;
use vines_bench::rig::{ControllerError, RigError};

/// A text and the numbers in it.
#[derive(Debug, Clone, PartialEq)]
pub struct Message {
    /// The text, with `{}` for every number.
    pub text: String,
    /// The numbers, in order.
    pub numbers: Vec<f64>,
}

impl Message {
    fn refused(name: &str, value: Option<f64>, unit: &str, allowed: &str) -> Self {
        let number = if value.is_some() { "{}" } else { "none" };
        let space = if unit.is_empty() { "" } else { " " };
        let text = [name, " = ", number, space, unit, " is refused; allowed is ", allowed];
        Self { text: text.concat(), numbers: Vec::from_iter(value) }
    }
}

impl From<&str> for Message {
    fn from(text: &str) -> Self {
        Self { text: text.into(), numbers: Vec::new() }
    }
}

impl From<InvalidValue> for Message {
    fn from(error: InvalidValue) -> Self {
        Self::refused(error.name, Some(error.value), error.unit, error.allowed)
    }
}

impl From<ConfigError> for Message {
    fn from(error: ConfigError) -> Self {
        Self::refused(error.name, error.value, error.unit, error.allowed)
    }
}

impl From<ExperimentError> for Message {
    fn from(error: ExperimentError) -> Self {
        match error {
            ExperimentError::Rig(RigError::Refused(error)) => error.into(),
            ExperimentError::Controller(ControllerError::Refused(error)) => error.into(),
            ExperimentError::NoLock { periods, phase_error: Some(error), omega, .. } => Self {
                text: "no lock within {} periods of the drive: the phase error is {}° at {} rad/s".into(),
                numbers: vec![periods, error, omega],
            },
            ExperimentError::Tripped { periods, fault, .. } => Self {
                text: ["the controller switched the drive off after {} periods: ", fault.text()].concat(),
                numbers: vec![periods],
            },
            _ => "no lock: the phase of the response cannot be measured".into(),
        }
    }
}
