//! `vines identify`: the whole experiment.

use clap::Args;
use indicatif::ProgressBar;
use vines::experiment::{self, Stage};
use vines::identification::{IdentificationError, Regime, identify};
use vines::{advice, comparison::Comparison, pack::File, report, survey::contradiction};

use super::experiment::{ExperimentArguments, INTERRUPTED_FILE};
use super::options::Endpoint;
use super::output::{Results, progress_bar};
use super::summary;
use super::{failure::Failure, pack::fmus};

const HELP: &str = "\
Examples:
  vines identify                                   the default scene, results in out/
  vines identify --set plant.r=0.7 --out r07       another coefficient of restitution
  vines identify --scene scenes/dimensionless.toml --set excitation.G=1.3
  vines identify --controller mine.fmu             another controller on the same plant
  vines identify --rig udp://127.0.0.1:5510        a rig in real time across the network; see `vines rig`
  vines identify --record run.csv                  what the sensors read as well, for `vines fit run.csv`
  vines identify --rig udp://127.0.0.1:5510 --watch    the same, shown in a browser while it runs

Writes identification.json, backbone.csv, backbone.svg, history.svg and sim.svg. Without --rig, the rig is this program's LoViNes.fmu; it is
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

/// Results that are written.
pub(super) const FILES: [&str; 6] = [
    "identification.json",
    "backbone.csv",
    "backbone.svg",
    "history.svg",
    "sim.svg",
    INTERRUPTED_FILE,
];

pub(super) fn run(arguments: &Arguments) -> Result<Results, Failure> {
    let experiment = &arguments.experiment;
    let (scene, plan, session) =
        experiment.start("vines identify", arguments.rig.as_ref(), |plan| plan.lock, &FILES)?;
    let bar = progress_bar(Stage::Locking.samples(&plan) as u64, "", "samples");
    let measured = session.measure(&scene, &plan, |samples, rig, controller| {
        experiment::run(samples, rig, controller, &plan, |stage, done| {
            show(&bar, stage, done, stage.samples(&plan))
        })
    });
    bar.finish_and_clear();
    let (record, mut ended) = measured?;
    let identification = match identify(&record, &plan) {
        Ok(identification) => identification,
        Err(error) => {
            let reason = match &error {
                IdentificationError::Regime { regime, repeats, silent: None, .. } => {
                    let regime = repeats.map_or(*regime, |_| Regime::Symmetric);
                    advice::reason(&scene, &plan.knowledge.numbers, Some(regime))
                }
                _ => None,
            };
            ended.keep(&record.samples, &plan);
            return Err(ended.without_result(Failure::from(error), reason));
        }
    };
    let result = Comparison::of(&identification, &scene);
    let reports_impacts = identification.lock.regime_by_impacts.is_some();
    let mut text = summary::identification(&result, &scene) + &summary::structure(&scene, reports_impacts);
    let unstable = result
        .exact
        .filter(|orbit| reports_impacts && scene.structure.is_some() && orbit.is_unstable() && !record.held);
    if let Some(orbit) = unstable {
        text += &format!(
            "warning: the exact orbit there is unstable under a constant drive (largest multiplier {:.4}): the motion is modulated around it, or \
             will leave it\n",
            orbit.multipliers[3]
        );
    }
    // A rig that reports its impacts is a simulation of the scene.
    let lock = vec![identification.lock.at.measured(&scene.units())];
    if !reports_impacts && let Some(found) = contradiction(&scene, lock) {
        text += &format!(
            "\n{}: track the backbone with `vines backbone`, and run `vines fit`\n",
            summary::contradicts(&found)
        );
    }
    let files = report::identification_files(&result, &record, &scene).map_err(Failure::from);
    let files = files.and_then(|files| {
        let mut files: Vec<File> = files
            .into_iter()
            .map(|(name, content)| (name.into(), content.into()))
            .collect();
        if arguments.rig.is_none() && scene.structure.is_none() {
            files.extend(fmus()?);
        }
        Ok(files)
    });
    let failures = summary::not_as_asked(&result, &scene).map(Failure::run);
    experiment.finish(ended, &result, &text, files, Failure::first_of(failures.collect()))
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
