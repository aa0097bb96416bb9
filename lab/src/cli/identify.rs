//! `vines identify`: the whole experiment.

use std::path::PathBuf;

use clap::Args;
use indicatif::{ProgressBar, ProgressStyle};
use vines::{
    experiment::{self, Plan, Stage},
    identification, pack, report,
    rig::{BuiltIn, FmuRig},
};

use super::{failure::Failure, pack::beside_this_program, scene_arguments::SceneArguments};

const HELP: &str = "\
Examples:
  vines identify                                   the default scene, results in out/
  vines identify --set plant.r=0.7 --out r07       another coefficient of restitution
  vines identify --scene scenes/dimensionless.toml --set excitation.G=1.3

Writes LoViNes.fmu and PhaseLock.fmu, then identification.json, backbone.csv, backbone.svg and sim.svg.";

/// Lock the plant at phase resonance, let it decay, and identify its backbone
#[derive(Debug, Args)]
#[command(after_help = HELP)]
pub(super) struct Arguments {
    #[command(flatten)]
    scene: SceneArguments,

    /// Folder for the results; made if it is not there
    #[arg(long, value_name = "DIR", default_value = "out")]
    out: PathBuf,

    /// Use this plant FMU; without it, the one of this program is packed into the results' folder
    #[arg(long, value_name = "FILE")]
    plant: Option<PathBuf>,

    /// Print identification.json instead of the table
    #[arg(long)]
    json: bool,
}

pub(super) fn run(arguments: &Arguments) -> Result<String, Failure> {
    let scene = arguments.scene.load()?;
    let plant = match &arguments.plant {
        Some(file) if file.is_file() => file.clone(),
        Some(file) => {
            let message = format!("{} is not there: --plant takes an FMU", file.display());
            return Err(Failure::input(message));
        }
        None => {
            let libraries = beside_this_program()?.as_path().into();
            pack::pack(&pack::components(), &libraries, &arguments.out)?[0].clone()
        }
    };
    env_logger::Builder::new()
        .filter_level(log::LevelFilter::Warn)
        .format_timestamp(None)
        .init();
    let mut controller = BuiltIn::new(&scene).map_err(Failure::input)?;
    let mut rig = FmuRig::load(&plant, &scene).map_err(Failure::run)?;
    let bar = progress_bar();
    let record = experiment::run(
        &mut rig,
        &mut controller,
        &Plan::of(&scene),
        |stage, done, of| {
            show(&bar, stage, done, of);
        },
    );
    bar.finish_and_clear();
    let record = record.map_err(Failure::run)?;
    let found = identification::identify(&record, &scene).map_err(Failure::run)?;
    let written = report::write(&found, &arguments.out).map_err(Failure::run)?;
    if arguments.json {
        return Ok(serde_json::to_string_pretty(&found)? + "\n");
    }
    let files: Vec<String> = written
        .iter()
        .map(|path| path.display().to_string())
        .collect();
    Ok(format!(
        "{}\nWritten: {}\n",
        report::table(&found),
        files.join(", ")
    ))
}

/// A bar on stderr; indicatif hides it where that is no terminal.
fn progress_bar() -> ProgressBar {
    let style = ProgressStyle::with_template("{msg:>24} [{bar:40}] {pos}/{len} samples")
        .unwrap_or_else(|_| ProgressStyle::default_bar());
    ProgressBar::new(0).with_style(style)
}

fn show(bar: &ProgressBar, stage: Stage, done: usize, of: usize) {
    // A bar that moves a few hundred times is smooth; one that moves at every sample costs more than the experiment.
    if done.is_multiple_of(64) || done == of {
        bar.set_message(match stage {
            Stage::Locking => "seeking phase resonance",
            Stage::Holding => "holding the lock",
            Stage::Decaying => "recording the decay",
        });
        bar.set_length(of as u64);
        bar.set_position(done as u64);
    }
}
