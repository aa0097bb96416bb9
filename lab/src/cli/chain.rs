//! `vines chain`: what each stage of the measurement chain costs and does.

use clap::Args;
use vines::stages;

use super::{failure::Failure, scene_arguments::SceneArguments};

const HELP: &str = "\
Locks the plant through each stage of [chain] alone and through some of them together, and prints a Markdown table:
  moves    against a chain without any of them, mean over 200 periods after 600
  wanders  standard deviation of the drive's frequency from period to period
  time     of a sample of plant, chain and controller, against the ideal chain

Examples:
  vines chain
  vines chain --set controller.bandwidth=0.05";

/// Show what each stage of the measurement chain costs and does to the locked point
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
    let effects = stages::effects(|further| arguments.scene.load_with(further));
    let effects = effects.map_err(Failure::input)?;
    if arguments.json {
        return Ok(serde_json::to_string_pretty(&effects)? + "\n");
    }
    Ok(stages::table(&effects))
}
