//! Options of a scene: a number, or `false` or "none". Zero is a number like every other.

use serde::{Deserialize, Deserializer, de::Error};

/// What the file says.
#[derive(Deserialize)]
#[serde(untagged, expecting = "expected a number, or false or \"none\"")]
enum Written<T> {
    Value(T),
    Switch(bool),
    Word(String),
}

/// Reads an option.
pub(super) fn option<'de, D: Deserializer<'de>, T: Deserialize<'de>>(from: D) -> Result<Option<T>, D::Error> {
    match Written::deserialize(from)? {
        Written::Value(value) => Ok(Some(value)),
        Written::Switch(false) => Ok(None),
        Written::Word(word) if word == "none" => Ok(None),
        Written::Switch(_) | Written::Word(_) => Err(D::Error::custom("expected a number, or false or \"none\"")),
    }
}
