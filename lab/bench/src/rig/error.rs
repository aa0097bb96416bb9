//! Why one side of the bench cannot go on.

use std::error::Error;

use lovines::InvalidValue;
use phase_lock::ConfigError;
use thiserror::Error;

/// The error of an implementation: of an FMU, or of a link to a peer.
type Cause = Box<dyn Error + Send + Sync>;

/// Why a rig cannot go on.
#[derive(Debug, Error)]
#[expect(missing_docs, reason = "the messages explain the variants")]
pub enum RigError {
    #[error("the rig: {0}")]
    Failed(#[source] Cause),
    #[error("the rig: {0}")]
    Refused(#[from] InvalidValue),
    #[error(
        "the rig accepts frequency and amplitude only, not samples of the base displacement: chain.hold = true needs a rig that does, and so \
         does `vines rig --protocol helic`"
    )]
    NoHold,
}

/// Why a controller cannot go on.
#[derive(Debug, Error)]
#[expect(missing_docs, reason = "the messages explain the variants")]
pub enum ControllerError {
    #[error("the controller: {0}")]
    Failed(#[source] Cause),
    #[error(
        "the controller cannot hold the amplitude of the response; use the built-in controller, PhaseLock.fmu or `vines controller`"
    )]
    NoResponseLoop,
    #[error("the controller: {0}")]
    Refused(#[from] ConfigError),
}

impl RigError {
    /// The error of the implementation, if it is an `E`.
    pub fn cause<E: Error + 'static>(&self) -> Option<&E> {
        match self {
            Self::Failed(cause) => cause.downcast_ref(),
            Self::Refused(_) | Self::NoHold => None,
        }
    }
}

impl ControllerError {
    /// The error of the implementation, if it is an `E`.
    pub fn cause<E: Error + 'static>(&self) -> Option<&E> {
        match self {
            Self::Failed(cause) => cause.downcast_ref(),
            Self::NoResponseLoop | Self::Refused(_) => None,
        }
    }
}
