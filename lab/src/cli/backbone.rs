//! `vines backbone`: the backbone, tracked with the loop closed.

use clap::Args;
use indicatif::ProgressBar;
use vines::{backbone::track_into, comparison::TrackedComparison, fit::contradiction, report};

use super::experiment::ExperimentArguments;
use super::failure::Failure;
use super::options::Endpoint;
use super::output::{print, written};
use super::summary;

const HELP: &str = "\
Leads the response from level to level, and measures the drive and the frequency:
  frequency, response, base   in Hz and m, on a rig that does not report impacts; in the files always (f_Hz, A_m, E_m)
  C           amplitude of the first harmonic of the response that the scene's sensor reads, over b
  sigma       detuning (Omega - 1)/epsilon of resonance as [resonance] defines it
  G           base amplitude over b epsilon
  off target  phase of the response relative to the reference, less controller.phase_target
  averaged    periods, at the end of the dwell, over which the point is averaged
  error       difference in sigma or G, whichever is larger, from the exact backbone at the same C
Numbers after ± are standard uncertainties; for sigma and G they hold at the C of the same line. A level that the response does not
reach, because the drive is at a limit, is marked as not reached.

Examples:
  vines backbone                                          29 levels from C = 0.7 down to 0.14
  vines backbone --set backbone.C_to=0.2 --set backbone.points=11
  vines backbone --set chain.snr=40 --set chain.seed=7    with sensor noise
  vines backbone --rig LoViNes.fmu --out out/fmu          another rig: an FMU, or a network address

Writes tracked.json, tracked.csv and tracked.svg.";

/// Track the backbone level by level, with the response controlled
#[derive(Debug, Args)]
#[command(after_help = HELP)]
pub(super) struct Arguments {
    #[command(flatten)]
    experiment: ExperimentArguments,

    /// The rig: `built-in`, an FMU, tcp://HOST:PORT (in lock-step), udp://HOST:PORT or helic://HOST[:PORT] (in real time)
    #[arg(long, value_name = "ENDPOINT", default_value = "built-in")]
    rig: Endpoint,
}

pub(super) fn run(arguments: &Arguments) -> Result<String, Failure> {
    let experiment = &arguments.experiment;
    let (scene, session) = experiment.start("vines backbone", Some(&arguments.rig), |scene| scene.backbone_config())?;
    let bar = ProgressBar::new(scene.backbone.points.into());
    let measured = session.measure(&scene, &experiment.out, |samples, rig, controller| {
        track_into(samples, rig, controller, &scene, |done, _| {
            bar.set_position(done as u64)
        })
    });
    bar.finish_and_clear();
    let (tracked, timing) = measured?;
    let result = TrackedComparison::of(&tracked, &scene);
    let summary = summary::tracked(&result);
    let files = report::write_tracked(&result, &experiment.out)?;
    if let Some(ended) = tracked.ended {
        let mut failure = Failure::from(ended);
        let (count, files) = (result.points.len(), written(&files));
        failure.message += &format!("\n{count} points were measured before. {}", files.trim_end());
        return Err(failure);
    }
    let mut text = experiment.result(&result, &summary, &files, timing)?;
    let settled = result.points.iter().filter(|compared| compared.point.settled);
    let points: Vec<_> = settled.map(|compared| (&compared.point.at).into()).collect();
    if let Some(line) =
        contradiction(&points, scene.resonance, &scene.plant).filter(|_| !experiment.json && result.left_out.is_none())
    {
        text += &format!("{line}\n");
    }
    match result.doubt() {
        Some(reason) => {
            print(&text)?;
            Err(Failure::run(reason))
        }
        None => Ok(text),
    }
}
