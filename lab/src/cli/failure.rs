//! How a command ends early: the failure with its message and exit code.

use std::fmt::Display;
use std::io;

use lovines::InvalidValue;
use phase_lock::ConfigError;
use vines::FileError;
use vines::cells::CellError;
use vines::experiment::ExperimentError;
use vines::fmu::{FmuError, Obstacle};
use vines::identification::IdentificationError;
use vines::net::{Address, LinkError};
use vines::orbit::NoMotion;
use vines::pack::PackError;
use vines::report::ReportError;
use vines::rig::{Interrupted, RigError};
use vines::scene::{SceneError, refusal};

/// Exit code of an experiment that a signal ended; that of the program is of the signal ([`super::signals`]).
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

/// The exit code of each type of error.
macro_rules! exit_codes {
    ($($code:literal: $($error:ty),+;)+) => {
        $($(impl From<$error> for Failure {
            fn from(error: $error) -> Self {
                Self::new($code, error)
            }
        })+)+
    };
}

exit_codes! {
    2: CellError, InvalidValue, SceneError;
    1: io::Error, FileError, NoMotion, ReportError, RigError;
}

impl From<FmuError> for Failure {
    fn from(error: FmuError) -> Self {
        let FmuError::Load { obstacle: Some(obstacle), .. } = error else {
            return Self::run(error);
        };
        let advice = match obstacle {
            Obstacle::NoFolder => "; set TMPDIR to a folder that can be written to, or use `built-in`",
            Obstacle::NoExecution => &format!(
                "; it was unpacked to {}, whose file system may be mounted noexec: set TMPDIR to another folder",
                std::env::temp_dir().display()
            ),
            Obstacle::Python => {
                "; it needs Python in this program: set LD_PRELOAD to the library of that Python, libpython3.X.so, and PYTHONPATH to its \
                 packages, or serve the controller from Python"
            }
            Obstacle::Library => "; it needs that library: install it, or export the FMU with its libraries",
        };
        Self::run(format!("{error}{advice}"))
    }
}

impl From<PackError> for Failure {
    fn from(error: PackError) -> Self {
        let advice = match &error {
            PackError::NotOwn { package, .. } => {
                &format!("; build it with `cargo build --release -p {package}`, or name its folder with --libraries")
            }
            PackError::NoLibrary(_) => ": give one by --binary PLATFORM=FILE, or leave out --only-binaries",
            PackError::Foreign(_) => "; build it again",
            _ => "",
        };
        Self::input(format!("{error}{advice}"))
    }
}

impl From<ConfigError> for Failure {
    fn from(error: ConfigError) -> Self {
        Self::input(refusal(&error))
    }
}

impl From<LinkError> for Failure {
    fn from(error: LinkError) -> Self {
        match &error {
            LinkError::Address { .. } => Self::input(error),
            LinkError::Remote(_) => Self::input(format!(
                "{error}. Use --key on both sides; use --allow-remote only on a network where everyone may do so"
            )),
            LinkError::Unreachable { peer, controller, .. } => {
                let command = match peer {
                    Address::Tcp(place) if *controller => format!("vines controller --listen {place}"),
                    Address::Tcp(place) => format!("vines rig --lock-step --listen {place}"),
                    Address::Udp(place) => format!("vines rig --listen {place}"),
                };
                Self::run(format!(
                    "{error}: is `{command}` running there, with the same --key or none?"
                ))
            }
            _ => Self::run(error),
        }
    }
}

/// What to do about a controller that does otherwise than asked.
const ADVICE_AS_ASKED: &str = "; set phase and drive of the controller, or controller.phase_target and [excitation] of the scene, and check the gains \
                               of the rig with `vines check`";

impl From<ExperimentError> for Failure {
    fn from(error: ExperimentError) -> Self {
        let code = match &error {
            ExperimentError::Rig(RigError::Failed(cause)) if cause.is::<Interrupted>() => INTERRUPTED,
            // The plant refuses a drive that comes from the scene.
            ExperimentError::NoDrive | ExperimentError::Rig(RigError::Refused(_)) => 2,
            _ => 1,
        };
        let advice = match error {
            ExperimentError::OtherThanAsked { .. } => ADVICE_AS_ASKED,
            ExperimentError::Tripped { .. } => ". `vines check` looks for the cause",
            ExperimentError::NoLock { unmet: None, .. } => {
                "; see phase_lock.acquire_timeout and the [controller] section"
            }
            ExperimentError::NoLock { .. } => "; make the loop slower, or set a larger value",
            ExperimentError::NoDrive => ": set G, E or F of [excitation] above 0",
            _ => "",
        };
        Self::new(code, format!("{error}{advice}"))
    }
}

impl From<IdentificationError> for Failure {
    fn from(error: IdentificationError) -> Self {
        let advice = match error {
            IdentificationError::OtherThanAsked { .. } => ADVICE_AS_ASKED,
            IdentificationError::OffTarget { .. } => ": `vines check` measures its delay",
            _ => "",
        };
        Self::run(format!("{error}{advice}"))
    }
}
