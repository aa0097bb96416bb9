//! The date of generated files: the same input gives the same bytes, so that no clock is asked.

use std::env::{self, VarError};

use chrono::{DateTime, SecondsFormat};

use super::PackError;

/// By convention of reproducible builds, the date of the sources in seconds since 1970.
const VARIABLE: &str = "SOURCE_DATE_EPOCH";

/// The date of the sources in the format of XML, if the environment has it.
pub(super) fn generation() -> Result<Option<String>, PackError> {
    match env::var(VARIABLE) {
        Ok(text) if text.is_empty() => Ok(None),
        Ok(text) => format(&text).map(Some),
        Err(VarError::NotPresent) => Ok(None),
        Err(VarError::NotUnicode(text)) => Err(PackError::Date(text.to_string_lossy().into_owned())),
    }
}

fn format(seconds: &str) -> Result<String, PackError> {
    let parsed = seconds.parse::<i64>().ok();
    let date = parsed.and_then(|seconds| DateTime::from_timestamp(seconds, 0));
    let date = date.ok_or_else(|| PackError::Date(seconds.to_owned()))?;
    Ok(date.to_rfc3339_opts(SecondsFormat::Secs, true))
}

#[cfg(test)]
#[path = "../../tests/unit/pack_date.rs"]
mod tests;
