//! Why one side of the bench cannot go on.

use std::error::Error;

use lovines::InvalidValue;
use phase_lock::ConfigError;
use thiserror::Error;

/// An error of what stands behind a rig or a controller: an FMU, a link to a peer.
type Cause = Box<dyn Error + Send + Sync>;

/// Why a rig cannot go on.
#[derive(Debug, Error)]
pub enum RigError {
    /// What stands behind the rig failed.
    #[error("the rig: {0}")]
    Failed(#[source] Cause),
    /// The built-in plant refused a drive.
    #[error("the rig: {0}")]
    Refused(#[from] InvalidValue),
    /// The rig cannot be driven by held samples.
    #[error(
        "the rig takes frequency and amplitude only, not samples of the base displacement as chain.hold asks"
    )]
    NoHold,
}

/// Why a controller cannot go on.
#[derive(Debug, Error)]
pub enum ControllerError {
    /// What stands behind the controller failed.
    #[error("the controller: {0}")]
    Failed(#[source] Cause),
    /// The controller holds the drive only.
    #[error("the controller cannot hold the amplitude of the response; the built-in one can")]
    NoResponseLoop,
    /// The controller refused a value.
    #[error("the controller: {0}")]
    Refused(#[from] ConfigError),
}

impl RigError {
    /// The error of what stands behind the rig, if it is an `E`.
    #[must_use]
    pub fn cause<E: Error + 'static>(&self) -> Option<&E> {
        match self {
            Self::Failed(cause) => cause.downcast_ref(),
            Self::Refused(_) | Self::NoHold => None,
        }
    }
}

impl ControllerError {
    /// The error of what stands behind the controller, if it is an `E`.
    #[must_use]
    pub fn cause<E: Error + 'static>(&self) -> Option<&E> {
        match self {
            Self::Failed(cause) => cause.downcast_ref(),
            Self::NoResponseLoop | Self::Refused(_) => None,
        }
    }
}
