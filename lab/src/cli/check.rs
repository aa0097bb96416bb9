//! `vines check`: the loop before the drive rises.

use clap::Args;
use vines::experiment::ExperimentError;
use vines::loop_check::{Channel, LockTime, LoopCheck, Trials, Verdict, check, lock_times, trials};
use vines::report::{Table, number, with_uncertainty};

use super::endpoint::{Endpoint, ReachArguments};
use super::output::{log_warnings, output, print};
use super::{failure::Failure, scene_arguments::SceneArguments, serving::count};

const HELP: &str = "\
Drives the rig at a hundredth of the drive for 24 periods with the loop open, and compares amplitude and phase of response and base with
those of the scene's linear resonator at rest:
  gain   over the expected one; a wrong unit shows as a power of ten
  phase  less the expected one, degrees; 180 for a reversed sensor
  delay  the same in samples; that of the response includes the effect of a wrong natural frequency
  noise  RMS of everything else, and the RMS without a drive (floor), m
From the growth of the response follow its natural frequency and damping, and its phase and amplitude beside an oscillator that has both.
The second table compares what was measured with the scene. Amplitudes 5 %, phases 1 degree and clocks 0.1 % off are refused, beyond three
standard uncertainties: what is measured later would be wrong by as much. A natural frequency or a damping that differs is only said.
At the end: the gains that follow from controller.bandwidth, the only tuning parameter, with their phase margin.
The exit code is 1 if anything is refused. `vines identify` and `vines backbone` check every rig that is not a simulation first, and use
the natural frequency and the damping that the check has measured.

Examples:
  vines check --rig udp://127.0.0.1:5510
  vines check --trials 1000          random rigs, healthy and with random faults: how many are named correctly";

/// What a random rig of `--trials` draws itself.
const DRAWN: [&str; 12] = [
    "plant.epsilon",
    "plant.lambda",
    "plant.m",
    "plant.c",
    "plant.r",
    "start",
    "excitation",
    "chain.snr",
    "chain.filter",
    "chain.adc_bits",
    "chain.delay",
    "chain.seed",
];

/// Check signs, gains, delays and noise of a rig at a hundredth of the drive
#[derive(Debug, Args)]
#[command(after_help = HELP)]
pub(super) struct Arguments {
    #[command(flatten)]
    scene: SceneArguments,

    /// The rig: `built-in` (at rest), an FMU, tcp://HOST:PORT, udp://HOST:PORT or helic://HOST[:PORT]
    #[arg(long, value_name = "ENDPOINT", default_value = "built-in")]
    rig: Endpoint,

    #[command(flatten)]
    reach: ReachArguments,

    /// Check this many random healthy rigs, and as many with random faults
    #[arg(long, value_name = "N", value_parser = count::<usize>)]
    trials: Option<usize>,

    /// Print how fast the phase locks over the bandwidth, in a simulation of the scene, beside published times
    #[arg(long)]
    lock_times: bool,

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
        if let Some(one) = arguments.scene.one_of(&DRAWN) {
            return Err(one
                .error(format!(
                    "random rigs draw {} themselves; set other keys",
                    DRAWN.join(", ")
                ))
                .into());
        }
        let found = trials(&scene, count, arguments.seed)?;
        return output(arguments.json, &found, || counted(&found));
    }
    if arguments.lock_times {
        let times = lock_times(&scene).map_err(Failure::run)?;
        return output(arguments.json, &times, || listed(&times));
    }
    scene.start = Default::default();
    let mut open = arguments.rig.rig(&scene, arguments.reach.reach()?)?;
    let found = check(&mut open.rig, &scene).map_err(ExperimentError::from)?;
    open.close();
    let text = output(arguments.json, &found, || described(&found))?;
    if found.verdict == Verdict::Healthy {
        return Ok(text);
    }
    print(&text)?;
    Err(Failure::run(format!("the loop check failed: {}", found.verdict)))
}

pub(super) fn described(found: &LoopCheck) -> String {
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
    let table = Table::new("channel | gain | phase | delay | noise | floor").rows(rows);
    let mut text = format!("{}\n", table.markdown());
    if !found.quantities.is_empty() {
        let rows = found.quantities.iter().map(|one| {
            let name = format!(
                "{}{}{}",
                one.name,
                if one.unit.is_empty() { "" } else { ", " },
                one.unit
            );
            [
                name,
                with_uncertainty(one.measured, one.uncertainty),
                number(one.expected),
            ]
        });
        text += &format!("{}\n", Table::new("measured | value | scene").rows(rows).markdown());
    }
    for one in found.quantities.iter().filter(|one| one.differs()) {
        let consequence = match one.verdict {
            Some(_) => format!("more than {} off is refused", one.tolerance),
            None => "`vines identify` and `vines backbone` use the measured value".into(),
        };
        text += &format!(
            "Different from the scene: {} is {} {}, not {}; {consequence}.\n",
            one.name,
            with_uncertainty(one.measured, one.uncertainty),
            one.unit,
            number(one.expected)
        );
    }
    text += &format!("At E = {:.2e} m: {}\n", found.amplitude, found.verdict);
    if let Some(linear) = &found.linear {
        text += &format!(
            "Gains at a bandwidth of {:.3} rad/s: {:.4} 1/s and {:.4} 1/s²; phase margin {:.0} degrees.\n",
            linear.bandwidth, linear.gains[0], linear.gains[1], linear.phase_margin,
        );
    }
    text
}

fn listed(times: &[LockTime]) -> String {
    let periods = |time: Option<f64>| time.map_or_else(|| "-".into(), |time| format!("{time:.0}"));
    let rows = times.iter().map(|time| {
        let reported = format!("{:.0}", time.reported);
        [
            time.bandwidth.to_string(),
            periods(time.from_start),
            periods(time.from_motion),
            reported,
        ]
    });
    let table = Table::new("bandwidth | from the start | from a steady motion | reported").rows(rows);
    format!(
        "Periods until the phase error has stayed within 2 degrees for twenty of them\n\n{}",
        table.markdown()
    )
}

fn counted(found: &Trials) -> String {
    let mut text = format!(
        "{} of {} healthy rigs passed, {} of {} faults were named correctly.\n",
        found.healthy[1], found.healthy[0], found.faulty[1], found.faulty[0]
    );
    let [integral, gain, damping] = found.linear;
    text += &format!(
        "Linear response of the healthy rigs, median and largest errors: integral gain {:.2} and {:.2} %, response gain {:.2} and {:.2} %, \
         damping rate {:.1} and {:.1} standard uncertainties.\n",
        100.0 * integral[0],
        100.0 * integral[1],
        100.0 * gain[0],
        100.0 * gain[1],
        damping[0],
        damping[1],
    );
    for (expected, given) in &found.wrong {
        text += &format!("expected: {expected:?}\n{}", described(given));
    }
    text
}
