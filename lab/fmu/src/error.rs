//! Reasons why an FMU cannot be loaded, and why it did not perform a call.

use std::path::PathBuf;

use fmi::fmi2::Fmi2Error;
use thiserror::Error;

/// Reason why a file cannot be loaded as an FMU.
#[derive(Debug, Error)]
pub enum LoadError {
    /// The file is not a zip archive, or cannot be unpacked.
    #[error("the file is not an FMU, which is a zip archive: {0}")]
    Archive(String),
    /// The description is not valid.
    #[error("modelDescription.xml: {0}")]
    Description(fmi::schema::Error),
    /// The FMU has another version of FMI.
    #[error("the FMU has FMI version {0}; version 2.0 is needed")]
    Version(String),
    /// The FMU does not support co-simulation.
    #[error("the FMU does not support co-simulation")]
    NoCoSimulation,
    /// The `fmi` crate knows no folder for libraries of this platform.
    #[error("FMUs of FMI 2.0 cannot be loaded on {os} with the processor {architecture}")]
    Platform {
        /// The operating system.
        os: String,
        /// The processor.
        architecture: String,
    },
    /// The FMU has no library for this platform.
    #[error("the FMU has no library for this platform ({})", .0.display())]
    NoLibrary(PathBuf),
    /// The FMU cannot be instantiated.
    #[error("the FMU cannot be instantiated; its own message has been logged")]
    Instantiate,
    /// The library cannot be loaded, or lacks a function.
    #[error("the library of the FMU cannot be loaded: {0}")]
    Library(fmi::Error),
    /// The file cannot be read.
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
pub enum CallError {
    /// `fmi2Discard`.
    #[error("the FMU discarded the call (fmi2Discard)")]
    Discard,
    /// `fmi2Error`.
    #[error("the FMU reported an error (fmi2Error)")]
    Error,
    /// `fmi2Fatal`.
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
