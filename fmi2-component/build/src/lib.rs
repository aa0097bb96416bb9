//! Build-time reader of `modelDescription.xml`, so that the facts of a model are written once, in its description.
//!
//! `build.rs` of a component has two lines:
//!
//! ```text
//! fn main() {
//!     fmi2_component_build::generate("modelDescription.xml");
//! }
//! ```
//!
//! They check what the variable table needs and write `$OUT_DIR/variables.rs`, which the component includes:
//!
//! ```ignore
//! mod variables {
//!     include!(concat!(env!("OUT_DIR"), "/variables.rs"));
//! }
//! ```
//!
//! In it are `MODEL_NAME`, `MODEL_IDENTIFIER`, `GUID`, the type `Model`, the log categories as constants in `category`,
//! and the enums `Real`, `Integer`, `Boolean` and `String`, with a variant for each variable. A variant is named as its
//! variable is; `der(q1)` becomes `der_q1`.
//!
//! The attribute `guid` of a description under version control holds a placeholder, such as `derived`. [`describe`]
//! gives it the GUID that follows from the variables; whoever packs the FMU puts that text into it.
#![forbid(unsafe_code)]

mod check;
mod guid;
mod source;
mod table;

use std::fmt;
use std::path::{Path, PathBuf};

use fmi2_description::Description;
use table::Table;

/// Reads the description at `path`, relative to the package, and writes `$OUT_DIR/variables.rs`. For `build.rs`.
///
/// # Panics
/// If the description is refused, or a file cannot be read or written: build scripts report errors by a panic.
pub fn generate(path: impl AsRef<Path>) {
    let path = path.as_ref();
    println!("cargo:rerun-if-changed={}", path.display());
    if let Err(error) = try_generate(path) {
        let reason = std::error::Error::source(&error).map(|source| format!(": {source}"));
        panic!("{} is refused\n{error}{}\n", path.display(), reason.unwrap_or_default());
    }
}

fn try_generate(path: &Path) -> Result<(), Error> {
    let failure = |path: &Path| {
        let path = path.to_owned();
        |source| Error::File { path, source }
    };
    let xml = std::fs::read_to_string(path).map_err(failure(path))?;
    let folder = std::env::var_os("OUT_DIR").unwrap_or_default();
    let target = PathBuf::from(folder).join("variables.rs");
    std::fs::write(&target, source_of(&xml)?).map_err(failure(&target))
}

/// The Rust source that [`generate`] writes.
///
/// # Errors
/// A description that FMI 2.0 does not allow.
pub fn source_of(xml: &str) -> Result<String, Error> {
    read(xml).map(|table| source::source(&table))
}

/// The GUID that follows from the variables, the log categories and the model's names. Descriptions, order of
/// attributes and the like do not change it.
///
/// # Errors
/// A description that FMI 2.0 does not allow.
pub fn guid_of(xml: &str) -> Result<String, Error> {
    read(xml).map(|table| guid::guid(&table))
}

/// The description with its attribute `guid` set to [`guid_of`], and otherwise untouched.
///
/// # Errors
/// A description that FMI 2.0 does not allow.
pub fn describe(xml: &str) -> Result<String, Error> {
    guid::replace(xml, &Description::parse(xml)?.guid, &guid_of(xml)?)
}

fn read(xml: &str) -> Result<Table, Error> {
    let description = Description::parse(xml)?;
    let mut faults = Vec::new();
    let table = Table::new(&description, &mut faults);
    check::check(&description, &table, &mut faults);
    if faults.is_empty() {
        Ok(table)
    } else {
        Err(Error::Faults(faults))
    }
}

/// Reason why a description is refused.
#[derive(Debug)]
pub enum Error {
    /// The file cannot be read or written.
    File {
        /// Which file.
        path: PathBuf,
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
