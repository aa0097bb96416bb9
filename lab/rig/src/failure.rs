//! Why one side of the bench cannot go on.

use std::error::Error;

use lovines::{InvalidValue, Refused};
use phase_lock::ConfigError;
use thiserror::Error;

/// The error of an implementation: of an FMU, or of a link to a peer.
type Cause = Box<dyn Error + Send + Sync>;

/// Why a rig cannot go on.
#[derive(Debug, Error)]
#[expect(missing_docs, reason = "the messages explain the variants")]
pub enum RigError {
    #[error("the rig: {0}")]
    Failed(#[from] Cause),
    #[error("the rig: {0}")]
    Refused(#[from] InvalidValue),
    #[error("the rig: {0}")]
    Structure(#[from] Refused),
    #[error(
        "the shaker reached its limit: the {name} is {value:.3e} {unit}, and shaker.{key} allows {limit} {unit}; its amplifier has switched off"
    )]
    ShakerLimit {
        name: &'static str,
        key: &'static str,
        value: f64,
        limit: f64,
        unit: &'static str,
    },
    #[error(
        "the {} contradicts command and response: by the path that the check has measured, these give {expected:.3e} {unit}, and {read:.3e} {unit} is \
         read, for {periods:.1} periods",
        reference_of(unit)
    )]
    PathContradicted {
        expected: f64,
        read: f64,
        periods: f64,
        unit: &'static str,
    },
    #[error(
        "the amplifier is at its limit: the drive asked for needs {times:.2} times the command that voltage_max or current_max of [shaker] allows; lower \
         the drive, or the responses of the backbone"
    )]
    AmplifierLimit { times: f64 },
    #[error(
        "the rig accepts frequency and amplitude only, not samples of the base displacement: chain.hold = true and \
         helic devices need a rig that does"
    )]
    NoHold,
}

/// What the control of a shaker reads, by its unit.
fn reference_of(unit: &str) -> &'static str {
    if unit == "N" { "force" } else { "table" }
}

/// Why a controller cannot go on.
#[derive(Debug, Error)]
#[expect(missing_docs, reason = "the messages explain the variants")]
pub enum ControllerError {
    #[error("the controller: {0}")]
    Failed(#[source] Cause),
    /// With the names of what it lacks, where these are known.
    #[error(
        "the controller cannot hold the amplitude of the response{}; use the built-in controller or PhaseLock.fmu, here or across the network",
        lacking(.0)
    )]
    NoResponseLoop(Vec<String>),
    #[error("the controller: {0}")]
    Refused(#[from] ConfigError),
}

fn lacking(names: &[String]) -> String {
    match names {
        [] => String::new(),
        names => format!(": it lacks {}", names.join(", ")),
    }
}
