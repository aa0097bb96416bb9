//! Reasons why an FMU cannot be loaded, and why it did not perform a call.

use std::io;

use fmi2_component::Status;
use thiserror::Error;

use crate::functions::Answer;

/// Reason why a file cannot be loaded as an FMU.
#[derive(Debug, Error)]
#[expect(missing_docs, reason = "the messages explain the variants")]
pub enum LoadError {
    #[error(transparent)]
    File(#[from] io::Error),
    #[error("the file is not an FMU, which is a zip archive: {0}")]
    Archive(String),
    #[error("modelDescription.xml: {0}")]
    Description(#[from] fmi2_description::Error),
    #[error("the FMU has FMI version {0}; version 2.0 is needed")]
    Version(String),
    #[error("the FMU does not support co-simulation")]
    NoCoSimulation,
    #[error("the FMU has no library for this platform ({0})")]
    NoLibrary(String),
    #[error("the FMU cannot be instantiated; its own message has been logged")]
    Instantiate,
    #[error("the library of the FMU cannot be loaded: {0}")]
    Library(String),
}

/// Status of a call that was not done (FMI 2.0, clause 2.1.3).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[expect(missing_docs, reason = "the messages explain the variants")]
pub enum CallError {
    #[error("the FMU discarded the call (fmi2Discard)")]
    Discard,
    #[error("the FMU reported an error (fmi2Error)")]
    Error,
    #[error("the FMU reported a fatal error (fmi2Fatal)")]
    Fatal,
    #[error("the FMU continues in the background (fmi2Pending), which the bench does not support")]
    Pending,
}

/// The reason why a call was not done.
pub(crate) fn done(answer: Answer) -> Result<(), CallError> {
    match answer.into() {
        Status::Ok | Status::Warning => Ok(()),
        Status::Discard => Err(CallError::Discard),
        Status::Error => Err(CallError::Error),
        Status::Fatal => Err(CallError::Fatal),
        Status::Pending => Err(CallError::Pending),
    }
}
