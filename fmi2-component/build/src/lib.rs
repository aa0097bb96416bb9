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
//! They write `$OUT_DIR/variables.rs`, which the component includes:
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

mod source;
mod table;

use std::fmt::Write;
use std::path::{Path, PathBuf};

use fmi2_description::Description;
use table::Table;
use thiserror::Error;
use uuid::Uuid;

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
    read(xml).map(|table| guid(&table))
}

/// The description with its attribute `guid` set to [`guid_of`], and otherwise untouched.
///
/// # Errors
/// A description that FMI 2.0 does not allow.
pub fn describe(xml: &str) -> Result<String, Error> {
    let before = format!(" guid=\"{}\"", Description::parse(xml)?.guid);
    if xml.matches(&before).count() != 1 {
        let fault =
            "fmiModelDescription needs an attribute guid=\"…\", in this spelling, and no other element the same";
        return Err(Error::Fault(fault.into()));
    }
    Ok(xml.replacen(&before, &format!(" guid=\"{}\"", guid_of(xml)?), 1))
}

fn read(xml: &str) -> Result<Table, Error> {
    Table::new(&Description::parse(xml)?).map_err(Error::Fault)
}

/// The namespace of these GUIDs: any fixed one will do.
const NAMESPACE: Uuid = Uuid::from_u128(0x5c1d_1f8e_2f0a_4d5b_9a67_3e1b_7c90_42d1);

/// The GUID of a table. Descriptions have no effect on it: other words do not make another model.
fn guid(table: &Table) -> String {
    let mut text = format!(
        "{}\n{}\n{:?}\n{:?} {}\n",
        table.name, table.identifier, table.categories, table.states, table.event_indicators
    );
    for v in &table.variables {
        let _ = writeln!(
            text,
            "{:?} {} {:?} {:?} {:?} {:?} {:?} {:?} {:?} {:?} {:?}",
            v.name,
            v.value_reference,
            v.kind,
            v.causality,
            v.variability,
            v.initial,
            v.unit,
            v.start,
            v.min,
            v.max,
            v.nominal,
        );
    }
    Uuid::new_v5(&NAMESPACE, text.as_bytes()).to_string()
}

/// Reason why a description is refused.
#[derive(Debug, Error)]
pub enum Error {
    /// The file cannot be read or written.
    #[error("{} cannot be read or written", path.display())]
    File {
        /// Which file.
        path: PathBuf,
        /// Reason.
        source: std::io::Error,
    },
    /// The text is not a model description.
    #[error("the text is not a model description of FMI 2.0")]
    Description(#[from] fmi2_description::Error),
    /// No table can be made of the description.
    #[error("{0}")]
    Fault(String),
}
