//! `vines sweep` in a program that was built without it.

use clap::Args;

use super::failure::Failure;

/// Sweep any parameters of a scene and of its start, into a Zarr store: run `scripts/sweep`
#[derive(Debug, Args)]
#[command(disable_help_flag = true)]
pub(super) struct Arguments {
    /// Options of `scripts/sweep`
    #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
    options: Vec<String>,
}

pub(super) fn run(arguments: &Arguments) -> Result<String, Failure> {
    Err(Failure::input(format!(
        "this program was built without sweeps; `scripts/sweep {}` builds one with sweeps and runs it",
        arguments.options.join(" ")
    )))
}
