//! Errors of a scene: which value, in which unit, and what is allowed.

use std::path::PathBuf;

use lovines::InvalidValue;
use phase_lock::{ConfigError, Number};

use super::refusal;

/// Why a scene cannot be used.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the messages explain the variants")]
pub enum SceneError {
    #[error("cannot read the scene {}: {source}", path.display())]
    Read { path: PathBuf, source: std::io::Error },
    #[error("--set {argument}: {message}")]
    Override { argument: String, message: String },
    #[error("{key} = {} {unit}: {allowed}", Number(*value))]
    Value {
        key: &'static str,
        value: f64,
        unit: &'static str,
        allowed: String,
    },
    #[error("[plant] or [start]: {0}")]
    Plant(#[from] InvalidValue),
    #[error("[excitation] or [controller]: {0}")]
    Drive(InvalidValue),
    #[error("{}", refusal(.0))]
    Controller(#[from] ConfigError),
    #[error("{origin}: {message}")]
    Text { origin: String, message: String },
}

impl SceneError {
    /// An error of the text that `origin` names.
    pub(super) fn text(origin: &str, message: impl Into<String>) -> Self {
        Self::Text { origin: origin.into(), message: message.into() }
    }
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
