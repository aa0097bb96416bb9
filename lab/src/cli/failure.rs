//! How a command ends early: the failure with its message and exit code, and the signals Ctrl-C and SIGTERM.

use std::fmt::Display;
use std::process;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};

use phase_lock::ConfigError;
use vines::rig::{Interrupted, RigError};
use vines::scene::{SceneError, refusal};
use vines::{experiment::ExperimentError, net::LinkError, pack::PackError, report::ReportError};

/// Exit code of a program that a signal ended: 128 and the number of SIGINT.
pub(super) const INTERRUPTED: u8 = 130;

/// A message and an exit code.
#[derive(Debug)]
pub(super) struct Failure {
    pub code: u8,
    pub message: String,
}

impl Failure {
    pub(super) fn new(code: u8, message: impl Display) -> Self {
        Self { code, message: message.to_string() }
    }

    /// Bad usage or input.
    pub(super) fn input(message: impl Display) -> Self {
        Self::new(2, message)
    }

    /// A failure at run time.
    pub(super) fn run(message: impl Display) -> Self {
        Self::new(1, message)
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
            // The plant refuses a drive that comes from the scene.
            ExperimentError::Peak | ExperimentError::Rig(RigError::Refused(_)) => Self::input(error),
            ExperimentError::Rig(cause) if cause.cause::<Interrupted>().is_some() => Self::new(INTERRUPTED, error),
            _ => Self::run(error),
        }
    }
}

impl From<LinkError> for Failure {
    fn from(error: LinkError) -> Self {
        match error {
            LinkError::Address { .. } => Self::input(error),
            _ => Self::run(error),
        }
    }
}

impl From<ReportError> for Failure {
    fn from(error: ReportError) -> Self {
        Self::run(error)
    }
}

impl From<PackError> for Failure {
    fn from(error: PackError) -> Self {
        Self::input(error)
    }
}

/// A flag that Ctrl-C and SIGTERM set: a driven rig stops, and the session ends before the program does. A second signal ends the program
/// at once.
pub(super) fn stop_flag() -> Result<Arc<AtomicBool>, Failure> {
    static FLAG: OnceLock<Arc<AtomicBool>> = OnceLock::new();
    if let Some(flag) = FLAG.get() {
        return Ok(Arc::clone(flag));
    }
    let flag = Arc::clone(FLAG.get_or_init(Arc::default));
    let signal = Arc::clone(&flag);
    ctrlc::set_handler(move || {
        if signal.swap(true, Ordering::Relaxed) {
            process::exit(INTERRUPTED.into());
        }
    })
    .map_err(|error| Failure::run(format!("cannot wait for Ctrl-C: {error}")))?;
    Ok(flag)
}
