//! `vines chain`: effect and run time of each stage of the measurement chain.

use clap::Args;
use vines::chain_effects::{self, Effect};
use vines::report::Table;

use super::{failure::Failure, output::output, scene_arguments::SceneArguments};

const HELP: &str = "\
Locks the plant with each stage of [chain] alone and with some combinations, and prints a Markdown table:
  moves    difference from the ideal chain, mean over 200 periods after 600
  wanders  standard deviation of the drive's frequency from period to period
  –        the controller switched the drive off in this run, or with the ideal chain; the reason follows the stage
  time     of a sample of plant, chain and controller, relative to the ideal chain

Examples:
  vines chain
  vines chain --set controller.bandwidth=0.05";

/// Show the effect of each stage of the measurement chain on the locked point, and its run time
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
    let scenes = chain_effects::scenes(|further| arguments.scene.load_with(further)).map_err(Failure::input)?;
    let effects = scenes.iter().map(|(name, scene)| chain_effects::effect(name, scene));
    let effects = effects.collect::<Result<Vec<_>, _>>().map_err(Failure::input)?;
    output(arguments.json, &effects, || table(&effects).markdown())
}

/// The effects, each against the ideal chain, which is the first.
fn table(effects: &[Effect]) -> Table {
    let ideal = effects[0];
    Table::new("stage | sigma moves by | C moves by | sigma wanders by | time of a sample").rows(effects.iter().map(
        |effect| {
            let [sigma, c, wander] = match effect.fault.or(ideal.fault) {
                Some(_) => ["–"; 3].map(String::from),
                None => [
                    format!("{:+.1e}", effect.sigma - ideal.sigma),
                    format!("{:+.1e}", effect.c - ideal.c),
                    format!("{:.0e}", effect.wander),
                ],
            };
            let off = effect
                .fault
                .map_or(String::new(), |fault| format!(" (switched off: {fault})"));
            [
                format!("{}{off}", effect.name),
                sigma,
                c,
                wander,
                format!("× {:.2}", effect.sample_seconds / ideal.sample_seconds),
            ]
        },
    ))
}
