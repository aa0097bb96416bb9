//! Why one side of the bench cannot go on.

use phase_lock::ConfigError;
use thiserror::Error;

use super::FmuError;
use crate::net::LinkError;

/// Why a rig cannot go on.
#[derive(Debug, Error)]
pub enum RigError {
    /// The rig is an FMU, and it failed.
    #[error("the rig: {0}")]
    Fmu(#[from] FmuError),
    /// The rig is at a network address, and the link failed.
    #[error("the rig: {0}")]
    Link(#[from] LinkError),
    /// The rig cannot be driven by held samples.
    #[error(
        "the rig takes frequency and amplitude only, not samples of the base displacement as chain.hold asks"
    )]
    NoHold,
}

/// Why a controller cannot go on.
#[derive(Debug, Error)]
pub enum ControllerError {
    /// The controller is an FMU, and it failed.
    #[error("the controller: {0}")]
    Fmu(#[from] FmuError),
    /// The controller is at a network address, and the link failed.
    #[error("the controller: {0}")]
    Link(#[from] LinkError),
    /// The controller holds the drive only.
    #[error("the controller cannot hold the amplitude of the response; the built-in one can")]
    NoResponseLoop,
    /// The controller refused a value.
    #[error("the controller: {0}")]
    Refused(#[from] ConfigError),
}
