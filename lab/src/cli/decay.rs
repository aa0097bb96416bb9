//! `vines decay`: how well the estimators of the decay do.

use clap::Args;
use vines::estimators;

use super::{failure::Failure, scene_arguments::SceneArguments};

const HELP: &str = "\
Locks the built-in plant, lets go, and estimates sigma along the decay with every estimator and window, on clean data and
through noise (relative to the held response, the same all along; 20 seeds). Printed is the RMS of sigma less the truth over
the points with C > 0.2. The truth is the time between zero crossings of the plant itself, found in closed form.

Examples:
  vines decay
  vines decay --set plant.r=0.8 --json";

/// Show the bias and the noise sensitivity of the estimators of the decay
#[derive(Debug, Args)]
#[command(after_help = HELP)]
pub(super) struct Arguments {
    #[command(flatten)]
    scene: SceneArguments,

    /// Print a JSON array instead of a table
    #[arg(long)]
    json: bool,
}

pub(super) fn run(arguments: &Arguments) -> Result<String, Failure> {
    let scene = arguments.scene.load()?;
    let qualities = estimators::qualities(&scene).map_err(Failure::run)?;
    if arguments.json {
        return Ok(serde_json::to_string_pretty(&qualities)? + "\n");
    }
    Ok(estimators::table(&qualities))
}
