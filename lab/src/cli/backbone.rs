//! `vines backbone`: the backbone, tracked with the loop closed.

use clap::Args;
use vines::comparison::TrackedComparison;
use vines::identification::Regime;
use vines::survey::{contradiction, stable_backbone};
use vines::{backbone::track, numerics::range, report, scene::Scene};

use super::experiment::{ExperimentArguments, INTERRUPTED_FILE};
use super::failure::Failure;
use super::options::Endpoint;
use super::output::{Results, progress_bar};
use super::summary;

const HELP: &str = "\
Leads the response from level to level, and measures the drive and the frequency:
  frequency, response, base   in Hz and m, a force in N: all that is said of a rig that does not report impacts; in the files always (f_Hz,
              A_m, and E_m or F_N)
  motion      what the response shows: near the linear response, nonlinear and symmetric or asymmetric, irregular
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

/// Results that are written.
pub(super) const FILES: [&str; 4] = ["tracked.json", "tracked.csv", "tracked.svg", INTERRUPTED_FILE];

pub(super) fn run(arguments: &Arguments) -> Result<Results, Failure> {
    let experiment = &arguments.experiment;
    let (scene, plan, session) =
        experiment.start("vines backbone", Some(&arguments.rig), |plan| plan.tracking, &FILES)?;
    let bar = progress_bar(scene.backbone.points.into(), "tracking the backbone", "levels");
    let measured = session.measure(&scene, &plan, |samples, rig, controller| {
        track(samples, rig, controller, &plan, |done| bar.set_position(done as u64))
    });
    bar.finish_and_clear();
    let (tracked, ended) = measured?;
    let result = TrackedComparison::of(&tracked, &scene);
    let mut text = summary::tracked(&result, &scene) + &summary::structure(&scene, result.reports_impacts());
    let settled = result.points.iter().filter(|compared| compared.is_of_backbone());
    let units = scene.units();
    let points: Vec<_> = settled.map(|compared| compared.point.at.measured(&units)).collect();
    let (settled, of) = (points.len(), result.points.len());
    if settled < of {
        let motion = match result.reports_impacts() {
            true => "a motion with impacts",
            false => "a nonlinear motion",
        };
        text += &format!("{settled} of {of} points are settled points of {motion}\n");
    }
    if let Some(end) = &result.end {
        text += &format!("{end}\n");
    }
    if tracked.ended.is_none()
        && let Some(found) = contradiction(&scene, points)
    {
        text += &format!("\n{}; run `vines fit`\n", summary::contradicts(&found));
    }
    let files = report::tracked_files(&result).map_err(Failure::from);
    let failure = match tracked.ended {
        Some(error) => {
            let mut failure = Failure::from(error);
            failure.message += &format!("\n{of} points were measured before");
            Some(failure)
        }
        None => (settled == 0).then(|| Failure::run(not_a_backbone(&result, &scene))),
    };
    experiment.finish(ended, &result, &text, files, failure)
}

/// Why the points, none of which is a settled one of a motion with impacts or, where none are reported, of a nonlinear one, are no backbone; and what to
/// do.
fn not_a_backbone(result: &TrackedComparison, scene: &Scene) -> String {
    let count = |wanted: Regime| result.points.iter().filter(|row| row.regime() == wanted).count();
    let [linear, doubtful] = [Regime::NoImpacts, Regime::NotEstablished].map(count);
    let of = result.points.len();
    let (is_linear, is_doubtful) = (linear == of, linear + doubtful == of);
    match result.reports_impacts() {
        false if is_linear => format!(
            "all {of} points are near the linear response: within these levels there is no nonlinear motion. Set backbone.C_from to a larger one"
        ),
        false if is_doubtful => format!(
            "whether the motion is linear is not established of {doubtful} of {of} points: their distance from the linear response, which the loop \
             check measures, is within its uncertainty. Do not skip the loop check; set backbone.C_from to a larger level; reduce noise"
        ),
        false => format!("none of {of} points is a settled point of a nonlinear motion: the column `motion` says why"),
        true if is_linear => format!(
            "all {of} points are without impacts (the linear mode): the particle does not reach the walls. Check that it moves freely; give it \
             a velocity in [start]"
        ),
        true if is_doubtful => format!("the regime of {doubtful} of {of} points is not established"),
        true => {
            let levels = stable_backbone(scene, &scene.dimensionless());
            let (low, high) = range((f64::INFINITY, 0.0), levels.iter().map(|orbit| orbit.c));
            let settled = format!("none of {of} points is a settled point of a symmetric 1:1 motion");
            match low <= high {
                true => format!(
                    "{settled}: in the ideal cavity it is stable for C from {low:.3} to {high:.3}. Set backbone.C_from and backbone.C_to to \
                     levels within this range"
                ),
                false => format!("{settled}: in the ideal cavity it is nowhere stable"),
            }
        }
    }
}
