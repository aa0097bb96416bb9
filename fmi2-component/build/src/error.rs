//! What can be wrong with a description.

use std::fmt;

/// Why a description is refused.
#[derive(Debug)]
pub enum Error {
    /// The file cannot be read or written.
    File {
        /// Which file.
        path: std::path::PathBuf,
        /// Why not.
        source: std::io::Error,
    },
    /// It is not XML of the shape that FMI 2.0 asks for.
    Xml(serde_xml_rs::Error),
    /// It is, but says what FMI 2.0 forbids; one line for each fault.
    Faults(Vec<String>),
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::File { path, .. } => write!(f, "{} cannot be read or written", path.display()),
            Self::Xml(_) => f.write_str("this is not a model description of FMI 2.0"),
            Self::Faults(faults) => f.write_str(&faults.join("\n")),
        }
    }
}

impl std::error::Error for Error {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            Self::File { source, .. } => Some(source),
            Self::Xml(source) => Some(source),
            Self::Faults(_) => None,
        }
    }
}

impl From<serde_xml_rs::Error> for Error {
    fn from(error: serde_xml_rs::Error) -> Self {
        Self::Xml(error)
    }
}
