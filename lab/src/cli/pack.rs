//! `vines pack`: the two FMUs.

use std::path::PathBuf;

use clap::Args;
use vines::pack::{components, pack};

use super::failure::Failure;

const HELP: &str = "\
Examples:
  cargo build --release && target/release/vines pack --out fmus
  vines pack --libraries target/debug --out fmus";

/// Write LoViNes.fmu (the plant) and PhaseLock.fmu (the controller)
#[derive(Debug, Args)]
#[command(after_help = HELP)]
pub(super) struct Arguments {
    /// Folder for the FMUs; made if it is not there
    #[arg(long, value_name = "DIR")]
    out: PathBuf,

    /// Folder of the shared libraries; without it, the one that holds this program
    #[arg(long, value_name = "DIR")]
    libraries: Option<PathBuf>,
}

pub(super) fn run(arguments: &Arguments) -> Result<String, Failure> {
    let libraries = match &arguments.libraries {
        Some(folder) => folder.clone(),
        None => beside_this_program()?,
    };
    let written = pack(&components(), &libraries, &arguments.out)?;
    Ok(written
        .iter()
        .map(|path| format!("{}\n", path.display()))
        .collect())
}

pub(super) fn beside_this_program() -> Result<PathBuf, Failure> {
    let program = std::env::current_exe()
        .map_err(|error| Failure::run(format!("cannot tell where this program is: {error}")))?;
    Ok(program.parent().map(PathBuf::from).unwrap_or_default())
}
