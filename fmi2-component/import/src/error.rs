//! Errors of loading and of calls.

use std::path::PathBuf;

use thiserror::Error;

/// Reason why a file cannot be loaded as an FMU.
#[derive(Debug, Error)]
pub enum LoadError {
    /// The file cannot be read.
    #[error(transparent)]
    File(#[from] std::io::Error),
    /// The file is not a zip archive, or cannot be unpacked.
    #[error("the file is not an FMU, which is a zip archive: {0}")]
    Archive(#[from] zip::result::ZipError),
    /// The description is not valid.
    #[error("modelDescription.xml: {0}")]
    Description(#[from] fmi2_description::Error),
    /// The FMU has another version of FMI.
    #[error("the FMU has FMI version {0}; version 2.0 is needed")]
    Version(String),
    /// The FMU does not support co-simulation.
    #[error("the FMU does not support co-simulation")]
    NoCoSimulation,
    /// FMI 2.0 has no folder for libraries of this platform.
    #[error("FMI 2.0 defines no FMUs for {os} on {architecture}")]
    Platform {
        /// The operating system.
        os: &'static str,
        /// The processor.
        architecture: &'static str,
    },
    /// The FMU has no library for this platform.
    #[error("the FMU has no library for this platform ({})", .0.display())]
    NoLibrary(PathBuf),
    /// The library cannot be loaded, or lacks a function.
    #[error("the library of the FMU cannot be loaded: {0}")]
    Library(#[from] libloading::Error),
    /// `fmi2Instantiate` returned NULL.
    #[error("the FMU cannot be instantiated; its own message has been logged")]
    Instantiate,
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
    /// `fmi2Fatal`, `fmi2Pending` or a number that is not a status.
    #[error("the FMU reported a fatal error (status {0})")]
    Fatal(i32),
}
