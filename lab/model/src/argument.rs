//! The error of texts that cannot be read.

/// An argument or a setting that cannot be read; the message says what is expected.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct ArgumentError(String);

impl<T: Into<String>> From<T> for ArgumentError {
    fn from(message: T) -> Self {
        Self(message.into())
    }
}
