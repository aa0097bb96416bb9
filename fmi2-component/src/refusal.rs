//! What a call answers (FMI 2.0, clause 2.1.3), and why it was refused.

/// `fmi2Status`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(C)]
pub enum Status {
    /// All is well.
    Ok = 0,
    /// Something is not quite right, but the call was done.
    Warning = 1,
    /// The call was not done; the component is as it was before.
    Discard = 2,
    /// The call was wrong.
    Error = 3,
    /// The component can only be freed.
    Fatal = 4,
    /// The call continues in the background. This shell never returns it.
    Pending = 5,
}

/// A call that was not done, and one line which says what, where and what was expected.
///
/// Any error type converts into a refusal with [`Status::Error`], so that `?` works on a component's own
/// errors. (For that blanket conversion a refusal is not itself a `std::error::Error`.)
///
/// It is as small as a pointer: every call that succeeds hands on that there is none.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Refusal(Box<(Status, String)>);

impl Refusal {
    /// The call could not be done, and changed nothing.
    pub fn discard(message: impl Into<String>) -> Self {
        Self::new(Status::Discard, message)
    }

    /// The call was wrong.
    pub fn error(message: impl Into<String>) -> Self {
        Self::new(Status::Error, message)
    }

    /// The component can only be freed.
    pub fn fatal(message: impl Into<String>) -> Self {
        Self::new(Status::Fatal, message)
    }

    #[cold]
    fn new(status: Status, message: impl Into<String>) -> Self {
        Self(Box::new((status, message.into())))
    }

    /// The status of the call: discard, error or fatal.
    pub fn status(&self) -> Status {
        self.0.0
    }

    /// What, where, and what was expected.
    pub fn message(&self) -> &str {
        &self.0.1
    }
}

impl<E: std::error::Error> From<E> for Refusal {
    fn from(error: E) -> Self {
        Self::error(describe(&error))
    }
}

/// The error and what caused it, on one line.
fn describe(error: &dyn std::error::Error) -> String {
    match error.source() {
        Some(cause) => format!("{error}: {}", describe(cause)),
        None => error.to_string(),
    }
}
