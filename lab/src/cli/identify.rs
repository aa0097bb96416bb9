//! `vines identify`: the whole experiment.

use std::path::{Path, PathBuf};

use clap::Args;
use indicatif::ProgressBar;
use vines::experiment::{ExperimentError, Plan, Stage, run_into};
use vines::identification::{self, IdentificationError};
use vines::record::Sample;
use vines::{
    advice,
    comparison::Comparison,
    pack, report,
    rig::{BuiltIn, Fault},
    scene::Scene,
};

use super::output::{output, print, progress_bar, result, saved, writable, written};
use super::{endpoint::Endpoint, experiment::ExperimentArguments, failure::Failure, pack::beside_this_program};

const HELP: &str = "\
Examples:
  vines identify                                   the default scene, results in out/
  vines identify --set plant.r=0.7 --out r07       another coefficient of restitution
  vines identify --scene scenes/dimensionless.toml --set excitation.G=1.3
  vines identify --controller mine.fmu             another controller on the same plant
  vines identify --rig udp://127.0.0.1:5510        a rig in real time across the network; see `vines rig`

Writes identification.json, backbone.csv, backbone.svg and sim.svg. Without --rig, the rig is this program's LoViNes.fmu; it is
written as well, with PhaseLock.fmu.";

/// Lock the plant at phase resonance, let it decay, and identify its backbone
#[derive(Debug, Args)]
#[command(after_help = HELP)]
pub(super) struct Arguments {
    #[command(flatten)]
    experiment: ExperimentArguments,

    /// The rig: `built-in`, an FMU, tcp://HOST:PORT (in lock-step), udp://HOST:PORT or helic://HOST[:PORT] (in real time)
    /// [default: this program's plant FMU]
    #[arg(long, value_name = "ENDPOINT")]
    rig: Option<Endpoint>,
}

pub(super) fn run(arguments: &Arguments) -> Result<String, Failure> {
    let experiment = &arguments.experiment;
    let (mut scene, reach) = experiment.begin()?;
    // Invalid settings are refused before anything is written or driven.
    BuiltIn::new(&scene.controller_config())?;
    let mut open = match &arguments.rig {
        // A rig that is refused leaves no folder.
        Some(endpoint) => endpoint.rig(&scene, reach)?,
        None => {
            writable(&experiment.out)?;
            // The folder of the results gets the FMUs if the run succeeds.
            let folder = tempfile::tempdir().map_err(Failure::run)?;
            Endpoint::Fmu(fmus(folder.path())?.swap_remove(0)).rig(&scene, reach)?
        }
    };
    writable(&experiment.out)?;
    experiment.check_loop(&mut open.rig, &mut scene)?;
    let (endpoint, config) = (&experiment.controller, scene.controller_config());
    let mut controller = endpoint.controller(&config, &scene.controller_names, reach, open.pace)?;
    let plan = Plan::of(&scene);
    let bar = progress_bar(plan.lock as u64, "{msg:29} [{wide_bar}] {pos}/{len} samples");
    let mut samples = Vec::new();
    let record = run_into(
        &mut samples,
        &mut open.rig,
        controller.as_mut(),
        &plan,
        |stage, done, of| show(&bar, stage, done, of),
    );
    bar.finish_and_clear();
    drop(controller);
    let timing = open.close();
    let record = match record {
        Ok(record) => record,
        Err(error) => return Err(interrupted(error, &samples, &scene, &experiment.out)),
    };
    let found = identification::identify(&record, &scene).map_err(|error| {
        let reason = match error {
            IdentificationError::Regime { regime, .. } => advice::reason(&scene, Some(regime)),
            _ => None,
        };
        kept(Failure::run(error), reason, &record.samples, &experiment.out)
    })?;
    let found = Comparison::of(&found, &scene);
    let summary = report::summary::identification(&found);
    let mut files = saved(report::write(&found, &experiment.out), || {
        let points = report::decay_csv(&found).map_err(Failure::run)?;
        output(experiment.json, &found, || format!("{summary}\n{points}"))
    })?;
    if arguments.rig.is_none() {
        match fmus(&experiment.out) {
            Ok(fmus) => files.extend(fmus),
            Err(failure) => {
                print(&output(experiment.json, &found, || {
                    format!("{summary}\n{}", written(&files))
                })?)?;
                return Err(failure);
            }
        }
    }
    result(experiment.json, &found, &summary, &files, timing)
}

/// The failure of an experiment that ended early, with the reason that the exact orbits know, and what was measured in a file.
pub(super) fn interrupted(error: ExperimentError, samples: &[Sample], scene: &Scene, out: &Path) -> Failure {
    let reason = matches!(
        error,
        ExperimentError::NoLock { .. }
            | ExperimentError::NotReached { .. }
            | ExperimentError::Tripped { stage: Stage::Locking, fault: Fault::ResponseTooLarge, .. }
    )
    .then(|| advice::reason(scene, advice::last_regime(samples, scene)))
    .flatten();
    kept(Failure::from(error), reason, samples, out)
}

/// The failure with its reason, and what was measured in a file.
fn kept(mut failure: Failure, reason: Option<String>, samples: &[Sample], out: &Path) -> Failure {
    let kept = match report::write_interrupted(samples, out) {
        Ok(files) => written(&files).trim_end().to_string(),
        Err(error) => error.to_string(),
    };
    for line in [reason, (!samples.is_empty()).then_some(kept)].into_iter().flatten() {
        failure.message += &format!("\n{line}");
    }
    failure
}

/// Packs this program's FMUs into a folder; the plant is the first.
fn fmus(out: &Path) -> Result<Vec<PathBuf>, Failure> {
    let libraries = beside_this_program()?.as_path().into();
    Ok(pack::pack(&pack::components(), &libraries, out)?)
}

fn show(bar: &ProgressBar, stage: Stage, done: usize, of: usize) {
    // Updating the bar at every sample would take longer than the experiment.
    if !done.is_multiple_of(64) && done != of {
        return;
    }
    let message = stage.name();
    if bar.message() != message {
        bar.set_message(message);
        bar.set_length(of as u64);
        bar.force_draw();
    }
    bar.set_position(done as u64);
}
