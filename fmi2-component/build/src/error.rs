//! Errors of the build step.

use std::fmt;

/// Reason why a description is refused.
#[derive(Debug)]
pub enum Error {
    /// The file cannot be read or written.
    File {
        /// Which file.
        path: std::path::PathBuf,
        /// Reason.
        source: std::io::Error,
    },
    /// The text is not a model description.
    Description(fmi2_description::Error),
    /// The description violates FMI 2.0; one line per fault.
    Faults(Vec<String>),
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::File { path, .. } => write!(f, "{} cannot be read or written", path.display()),
            Self::Description(_) => f.write_str("the text is not a model description of FMI 2.0"),
            Self::Faults(faults) => f.write_str(&faults.join("\n")),
        }
    }
}

impl std::error::Error for Error {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            Self::File { source, .. } => Some(source),
            Self::Description(source) => Some(source),
            Self::Faults(_) => None,
        }
    }
}

impl From<fmi2_description::Error> for Error {
    fn from(error: fmi2_description::Error) -> Self {
        Self::Description(error)
    }
}
