//! `vines identify`: the whole experiment.

use std::path::{Path, PathBuf};

use clap::Args;
use indicatif::{ProgressBar, ProgressStyle};
use vines::{
    experiment::{self, Plan, Stage},
    identification, pack, report,
};

use super::{
    door::{Door, OpenRig, ReachArguments},
    failure::Failure,
    pack::beside_this_program,
    scene_arguments::SceneArguments,
};

const HELP: &str = "\
Examples:
  vines identify                                   the default scene, results in out/
  vines identify --set plant.r=0.7 --out r07       another coefficient of restitution
  vines identify --scene scenes/dimensionless.toml --set excitation.G=1.3
  vines identify --controller mine.fmu             another controller on the same plant
  vines identify --rig udp://127.0.0.1:5510        a rig across the network; see `vines rig`

Without --rig, writes LoViNes.fmu and PhaseLock.fmu and runs the first; then writes identification.json, backbone.csv, backbone.svg and sim.svg.";

/// Lock the plant at phase resonance, let it decay, and identify its backbone
#[derive(Debug, Args)]
#[command(after_help = HELP)]
pub(super) struct Arguments {
    #[command(flatten)]
    scene: SceneArguments,

    /// Folder for the results; made if it is not there
    #[arg(long, value_name = "DIR", default_value = "out")]
    out: PathBuf,

    /// What is shaken: an FMU, `built-in`, or udp://HOST:PORT; without it, this program's plant FMU is packed into the
    /// results' folder
    #[arg(long, value_name = "DOOR")]
    rig: Option<Door>,

    /// What controls it: `built-in`, an FMU, or udp://HOST:PORT
    #[arg(long, value_name = "DOOR", default_value = "built-in")]
    controller: Door,

    #[command(flatten)]
    reach: ReachArguments,

    /// Print identification.json instead of the table
    #[arg(long)]
    json: bool,
}

pub(super) fn run(arguments: &Arguments) -> Result<String, Failure> {
    let scene = arguments.scene.load()?;
    env_logger::Builder::new()
        .filter_level(log::LevelFilter::Warn)
        .format_timestamp(None)
        .init();
    let reach = arguments.reach.reach();
    let OpenRig { mut rig, pace } = match &arguments.rig {
        Some(door) => door.rig(&scene, reach)?,
        None => Door::Fmu(packed_plant(&arguments.out)?).rig(&scene, reach)?,
    };
    let mut controller = arguments.controller.controller(&scene, reach, pace)?;
    let bar = progress_bar();
    let record = experiment::run(
        rig.as_mut(),
        controller.as_mut(),
        &Plan::of(&scene),
        |stage, done, of| {
            show(&bar, stage, done, of);
        },
    );
    bar.finish_and_clear();
    // A rig across the network is told that this is all, before it has to wonder.
    drop((rig, controller));
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

/// This program's own plant, packed.
fn packed_plant(out: &Path) -> Result<PathBuf, Failure> {
    Ok(pack::pack(&pack::components(), &beside_this_program()?, out)?.swap_remove(0))
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
