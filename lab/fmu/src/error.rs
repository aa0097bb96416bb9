//! Reasons why an FMU cannot be loaded, and why it did not perform a call.

use std::path::PathBuf;

use fmi::fmi2::Fmi2Error;
use thiserror::Error;

/// Reason why a file cannot be loaded as an FMU.
#[derive(Debug, Error)]
#[expect(missing_docs, reason = "the messages explain the variants")]
pub enum LoadError {
    #[error("the file is not an FMU, which is a zip archive: {0}")]
    Archive(String),
    #[error("modelDescription.xml: {0}")]
    Description(fmi::schema::Error),
    #[error("the FMU has FMI version {0}; version 2.0 is needed")]
    Version(String),
    #[error("the FMU does not support co-simulation")]
    NoCoSimulation,
    #[error("FMUs of FMI 2.0 cannot be loaded on {os} with the processor {architecture}")]
    Platform { os: String, architecture: String },
    #[error("the FMU has no library for this platform ({})", .0.display())]
    NoLibrary(PathBuf),
    #[error("the FMU cannot be instantiated; its own message has been logged")]
    Instantiate,
    #[error("the library of the FMU cannot be loaded: {0}")]
    Library(fmi::Error),
    #[error(transparent)]
    Fmi(fmi::Error),
}

impl From<fmi::Error> for LoadError {
    fn from(error: fmi::Error) -> Self {
        use fmi::Error;
        match error {
            Error::Zip(source) => Self::Archive(source.to_string()),
            Error::ArchiveStructure(text) => Self::Archive(text),
            Error::Schema(source) => Self::Description(source),
            Error::UnsupportedFmuType(_) => Self::NoCoSimulation,
            Error::UnsupportedPlatform { os, arch } => Self::Platform { os, architecture: arch },
            Error::Instantiation => Self::Instantiate,
            Error::LibLoading { .. } => Self::Library(error),
            _ => Self::Fmi(error),
        }
    }
}

/// Status of a call that failed (FMI 2.0, clause 2.1.3).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[expect(missing_docs, reason = "the messages explain the variants")]
pub enum CallError {
    #[error("the FMU discarded the call (fmi2Discard)")]
    Discard,
    #[error("the FMU reported an error (fmi2Error)")]
    Error,
    #[error("the FMU reported a fatal error (fmi2Fatal)")]
    Fatal,
}

impl From<Fmi2Error> for CallError {
    fn from(error: Fmi2Error) -> Self {
        match error {
            Fmi2Error::Discard => Self::Discard,
            Fmi2Error::Error => Self::Error,
            // The other one, a wrong `fmi2GetTypesPlatform`, is not a status: the bench does not call that function.
            Fmi2Error::Fatal | Fmi2Error::TypesPlatformMismatch(_) => Self::Fatal,
        }
    }
}
