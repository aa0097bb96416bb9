//! Errors of a scene.

use std::path::PathBuf;

use lovines::InvalidValue;
use phase_lock::{ConfigError, Number};

use super::refusal;

/// Why a scene cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum SceneError {
    /// The file could not be read.
    #[error("cannot read the scene {}: {source}", path.display())]
    Read {
        /// The file asked for.
        path: PathBuf,
        /// Error of the system.
        source: std::io::Error,
    },
    /// Not TOML, an unknown key or a value of the wrong type; the message shows the line.
    #[error("{origin}: {message}")]
    Syntax {
        /// The file.
        origin: String,
        /// The reader's message, with line and column.
        message: String,
    },
    /// An argument of `--set` that is not section.key=value.
    #[error("--set: {0}")]
    Argument(#[from] SyntaxError),
    /// A `--set` argument that does not fit.
    #[error("--set {argument}: {message}")]
    Override {
        /// The argument as given.
        argument: String,
        /// What is wrong with it.
        message: String,
    },
    /// A number outside its range.
    #[error("{key} = {} {unit}: {allowed}", Number(*value))]
    Value {
        /// Dotted key.
        key: &'static str,
        /// The value given.
        value: f64,
        /// Its unit, in brackets.
        unit: &'static str,
        /// What is allowed.
        allowed: String,
    },
    /// The plant refuses a parameter or the start.
    #[error("[plant] or [start]: {0}")]
    Plant(#[from] InvalidValue),
    /// A drive that the plant does not take.
    #[error("[excitation] or [controller]: {0}")]
    Drive(InvalidValue),
    /// The controller refuses its configuration.
    #[error("{}", refusal(.0))]
    Controller(#[from] ConfigError),
    /// Keys that are missing or do not go together.
    #[error("{origin}: {message}")]
    Keys {
        /// The file.
        origin: String,
        /// Which keys, and what to do.
        message: String,
    },
}

/// An argument that is not `section.key=value`.
#[derive(Debug, thiserror::Error)]
pub enum SyntaxError {
    /// Not TOML.
    #[error("{}; expected section.key=value, for instance plant.r=0.7 or resonance.sensor=q1", .0.message())]
    Toml(#[from] toml::de::Error),
    /// TOML, but not one key of one section.
    #[error("expected one section.key=value, for instance plant.r=0.7")]
    NotOneKey,
}

/// A message of the TOML reader, without types of Rust.
pub(super) fn plain(message: &str) -> String {
    let words = [
        ("expected f64", "expected a number"),
        ("expected u32", "expected a whole number from 0"),
        ("expected u64", "expected a whole number from 0"),
        ("expected a boolean", "expected true or false"),
        ("unit variant, expected string only", "expected a word in quotes"),
        ("expected a map", "expected a table"),
    ];
    let replace = |text: String, (from, to)| text.replace(from, to);
    words.into_iter().fold(message.trim().to_string(), replace)
}
