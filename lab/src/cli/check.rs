//! `vines check`: the loop before the drive rises.

use clap::Args;
use vines::{
    experiment::ExperimentError,
    loop_check::{Channel, LoopCheck, Trials, Verdict, check, trials},
    report::Table,
    rig::Rig,
    scene::Scene,
};

use super::{
    endpoint::{Endpoint, ReachArguments},
    failure::Failure,
    json, log_warnings,
    scene_arguments::SceneArguments,
};

const HELP: &str = "\
Drives the rig at a hundredth of the drive for 24 periods with the loop open, and compares amplitude and phase of response and base with
those of the scene's linear resonator at rest:
  gain   over the expected one; a wrong unit shows as a power of ten
  phase  less the expected one, degrees; 180 for a reversed sensor
  delay  the same in samples; of the response it contains what a wrong natural frequency adds
  noise  RMS of everything else, and the RMS without a drive (floor), m
The exit code is 1 unless all are as expected. `vines identify` and `vines backbone` check every rig that is not a simulation first.

Examples:
  vines check --rig udp://127.0.0.1:5510
  vines check --trials 1000          random rigs, healthy and with random faults: how many are named correctly";

/// Check signs, gains, delays and noise of a rig at a hundredth of the drive
#[derive(Debug, Args)]
#[command(after_help = HELP)]
pub(super) struct Arguments {
    #[command(flatten)]
    scene: SceneArguments,

    /// The rig: `built-in` (at rest), an FMU, tcp://HOST:PORT or udp://HOST:PORT
    #[arg(long, value_name = "ENDPOINT", default_value = "built-in")]
    rig: Endpoint,

    #[command(flatten)]
    reach: ReachArguments,

    /// Check this many random healthy rigs, and as many with random faults
    #[arg(long, value_name = "N")]
    trials: Option<usize>,

    /// Seed of the trials
    #[arg(long, default_value_t = 1)]
    seed: u64,

    /// Print JSON
    #[arg(long)]
    json: bool,
}

pub(super) fn run(arguments: &Arguments) -> Result<String, Failure> {
    let mut scene = arguments.scene.load()?;
    log_warnings();
    if let Some(count) = arguments.trials {
        let found = trials(&scene, count, arguments.seed)?;
        return if arguments.json {
            json(&found)
        } else {
            Ok(counted(&found))
        };
    }
    scene.start = Default::default();
    let mut open = arguments.rig.rig(&scene, arguments.reach.reach())?;
    let found = check(&mut open.rig, &scene).map_err(ExperimentError::from)?;
    open.close();
    let text = if arguments.json {
        json(&found)?
    } else {
        described(&found)
    };
    if found.verdict == Verdict::Healthy {
        return Ok(text);
    }
    super::print(&text)?;
    Err(Failure::run(format!("the loop check failed: {}", found.verdict)))
}

/// `--no-check`, for the commands that drive a rig.
#[derive(Debug, Args)]
pub(super) struct LoopCheckArguments {
    /// Do not check the loop of a rig that is not a simulation first; see `vines check`
    #[arg(long)]
    no_check: bool,
}

impl LoopCheckArguments {
    /// Checks a rig that is not a simulation, and refuses one that is not as expected. Such a rig starts at rest.
    pub(super) fn before(&self, rig: &mut impl Rig, scene: &mut Scene) -> Result<(), Failure> {
        rig.sense().map_err(ExperimentError::from)?;
        if rig.ground_truth().map_err(ExperimentError::from)?.is_some() {
            return Ok(());
        }
        scene.start = Default::default();
        if self.no_check {
            return Ok(());
        }
        let found = check(rig, scene).map_err(ExperimentError::from)?;
        eprint!("{}", described(&found));
        match found.verdict {
            Verdict::Healthy => Ok(()),
            verdict => Err(Failure::run(format!(
                "the loop check failed, and the drive is off: {verdict}; --no-check skips it"
            ))),
        }
    }
}

fn described(found: &LoopCheck) -> String {
    let row = |name: &str, channel: &Channel| {
        [
            name.to_string(),
            format!("{:.3}", channel.gain),
            format!("{:.1}", channel.phase),
            format!("{:.1}", channel.delay),
            format!("{:.1e}", channel.noise),
            format!("{:.1e}", channel.floor),
        ]
    };
    let rows = [("response", Some(&found.response)), ("base", found.base.as_ref())];
    let rows = rows.into_iter().filter_map(|(name, channel)| Some(row(name, channel?)));
    let table = Table::new(["channel", "gain", "phase", "delay", "noise", "floor"]).rows(rows);
    format!(
        "{}\nAt E = {:.2e} m: {}\n",
        table.markdown(),
        found.amplitude,
        found.verdict
    )
}

fn counted(found: &Trials) -> String {
    let mut text = format!(
        "{} of {} healthy rigs passed, {} of {} faults were named correctly.\n",
        found.healthy[1], found.healthy[0], found.faulty[1], found.faulty[0]
    );
    for (expected, given) in &found.wrong {
        text += &format!("expected: {expected:?}\n{}", described(given));
    }
    text
}
