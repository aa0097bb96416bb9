//! How a command ends early: the failure with its message and exit code, and the signals Ctrl-C and SIGTERM.

use std::error::Error;
use std::fmt::Display;
use std::process;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};

use lovines::InvalidValue;
use phase_lock::ConfigError;
use vines::cells::CellError;
use vines::rig::{Interrupted, RigError};
use vines::scene::{SceneError, refusal};
use vines::{ArgumentError, experiment::ExperimentError, net::LinkError, pack::PackError};

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

    /// The first of some failures, with the messages of all.
    pub(super) fn first_of(failures: Vec<Self>) -> Option<Self> {
        failures.into_iter().reduce(|mut first, failure| {
            first.message += &format!("\n{}", failure.message);
            first
        })
    }

    /// A failure at run time.
    pub(super) fn run(message: impl Display) -> Self {
        Self::new(1, message)
    }
}

impl<E: Error + 'static> From<E> for Failure {
    /// Errors of what a user gives are bad input; all others are failures at run time.
    fn from(error: E) -> Self {
        let any: &(dyn Error + 'static) = &error;
        if let Some(error) = any.downcast_ref::<ConfigError>() {
            return Self::input(refusal(error));
        }
        let is_of_experiment = match any.downcast_ref() {
            Some(ExperimentError::Rig(cause)) if cause.cause::<Interrupted>().is_some() => {
                return Self::new(INTERRUPTED, error);
            }
            // The plant refuses a drive that comes from the scene.
            Some(ExperimentError::NoDrive | ExperimentError::Rig(RigError::Refused(_))) => true,
            _ => false,
        };
        let is_input = is_of_experiment
            || any.is::<ArgumentError>()
            || any.is::<InvalidValue>()
            || any.is::<PackError>()
            || any.is::<SceneError>()
            || any.is::<CellError>()
            || matches!(any.downcast_ref(), Some(LinkError::Address { .. }));
        Self::new(if is_input { 2 } else { 1 }, error)
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
