//! The failure of a command: one message and an exit code.

use std::fmt::{self, Display, Formatter};

use phase_lock::ConfigError;
use vines::{
    experiment::ExperimentError,
    net::LinkError,
    pack::PackError,
    rig::{Interrupted, RigError},
    scene::{SceneError, refusal},
};

/// Exit code of a program that a signal ended: 128 and the number of SIGINT.
pub(super) const INTERRUPTED: u8 = 130;

/// A message and an exit code.
#[derive(Debug)]
pub(super) struct Failure {
    code: u8,
    message: String,
}

impl Failure {
    /// Bad usage or input: exit code 2.
    pub(super) fn input(message: impl Display) -> Self {
        Self { code: 2, message: message.to_string() }
    }

    /// A failure at run time: exit code 1.
    pub(super) fn run(message: impl Display) -> Self {
        Self { code: 1, message: message.to_string() }
    }

    /// A failure of the rig. A drive that the plant refuses comes from the scene.
    fn of_rig(cause: &RigError, message: &impl Display) -> Self {
        match cause {
            RigError::Refused(_) => Self::input(message),
            _ if cause.cause::<Interrupted>().is_some() => Self { code: INTERRUPTED, message: message.to_string() },
            _ => Self::run(message),
        }
    }

    /// A rig in real time missed too many deadlines: exit code 3.
    pub(super) fn late(message: impl Display) -> Self {
        Self { code: 3, message: message.to_string() }
    }

    /// Ended by a signal: exit code 130.
    #[cfg(feature = "sweep")]
    pub(super) fn interrupted(message: impl Display) -> Self {
        Self { code: INTERRUPTED, message: message.to_string() }
    }

    /// The same exit code with another message.
    pub(super) fn with_message(self, message: String) -> Self {
        Self { message, ..self }
    }

    pub(super) fn code(&self) -> u8 {
        self.code
    }
}

impl Display for Failure {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)
    }
}

impl From<SceneError> for Failure {
    fn from(error: SceneError) -> Self {
        Self::input(error)
    }
}

impl From<ConfigError> for Failure {
    fn from(error: ConfigError) -> Self {
        Self::input(refusal(&error))
    }
}

impl From<ExperimentError> for Failure {
    fn from(error: ExperimentError) -> Self {
        match &error {
            ExperimentError::Rig(cause) => Self::of_rig(cause, &error),
            _ => Self::run(error),
        }
    }
}

impl From<LinkError> for Failure {
    fn from(error: LinkError) -> Self {
        match error {
            LinkError::Address { .. } | LinkError::Remote { .. } => Self::input(error),
            _ => Self::run(error),
        }
    }
}

impl From<PackError> for Failure {
    fn from(error: PackError) -> Self {
        match error {
            PackError::Read { .. } => Self::run(error),
            _ => Self::input(error),
        }
    }
}

impl From<serde_json::Error> for Failure {
    fn from(error: serde_json::Error) -> Self {
        Self::run(format!("cannot write JSON: {error}"))
    }
}
