//! `vines check`: the loop before the drive rises.

use clap::Args;
use vines::cells;
use vines::experiment::ExperimentError;
use vines::fmu::{FmuController, FmuRig};
use vines::loop_check::{CheckedChannel, CheckedQuantity, LoopCheck, Verdict, check};
use vines::scene::{Reference, Scene};
use vines::table::{Table, number, with_uncertainty};

use super::failure::Failure;
use super::options::{Endpoint, ReachArguments, SceneArguments};
use super::output::{output, print};
use super::signals::Orderly;
use super::summary::structure;

const HELP: &str = "\
Drives the rig at a hundredth of the drive for 24 periods with the loop open, and compares amplitude and phase of response and base with
those of the scene's linear resonator at rest. Where the noise of the sensors hides the phase, the drive is raised fourfold, again and again,
up to the drive of the scene or to a response of b/2:
  gain   measured over expected amplitude; a wrong unit shows as a power of ten
  phase  measured minus expected phase, degrees; 180 for a reversed sensor
  delay  the difference of phase in samples; in the response it includes the effect of a wrong natural frequency
  noise  RMS of everything else, and the RMS without a drive (floor), m; of a force N
From the growth of the response follow its natural frequency and damping, and its phase and amplitude beside an oscillator that has both.
The second table compares the measured values with the scene. Amplitudes 5 %, phases 1 degree and clocks 0.1 % off are refused, beyond three
standard uncertainties: later measurements would be wrong by as much. A different natural frequency or damping is reported, not refused.
Of an FMU, as rig or as controller, a table shows which variables the bench uses, in which units they are declared, and how it converts them.
At the end: the gains that follow from controller.bandwidth, the only tuning parameter, with their phase margin.
A response that is late at one drive and not at less has its own name: a particle that slides on its floor does so.
The exit code is 1 if anything is refused. `vines identify` and `vines backbone` check every rig that is not a simulation first, and use
the natural frequency and the damping that the check has measured.

Example:
  vines check --rig udp://127.0.0.1:5510";

/// Check signs, gains, delays and noise of a rig at a hundredth of the drive
#[derive(Debug, Args)]
#[command(after_help = HELP)]
pub(super) struct Arguments {
    #[command(flatten)]
    scene: SceneArguments,

    /// The rig: `built-in` (at rest), an FMU, tcp://HOST:PORT, udp://HOST:PORT or helic://HOST[:PORT]
    #[arg(long, value_name = "ENDPOINT", default_value = "built-in")]
    rig: Endpoint,

    /// A controller as an FMU, of which the variables and units are shown
    #[arg(long, value_name = "ENDPOINT")]
    controller: Option<Endpoint>,

    #[command(flatten)]
    reach: ReachArguments,

    /// Print JSON
    #[arg(long)]
    json: bool,
}

pub(super) fn run(arguments: &Arguments) -> Result<String, Failure> {
    let scene = arguments.scene.load()?.at_rest();
    let scope = arguments.reach.reach()?;
    let mut variables = arguments.rig.variables("rig", |file| {
        FmuRig::connections(file, &scene.rig_names, scene.resonance)
    })?;
    let _orderly = Orderly::new();
    let mut open = arguments.rig.rig(&scene, scope)?;
    if let Some(controller) = &arguments.controller {
        let names = &scene.controller_names;
        variables += &controller.variables("controller", |file| FmuController::connections(file, names))?;
        controller.controller(&scene.plan().lock, names, scope, open.pace)?;
    }
    let checked = check(open.rig.as_mut(), &scene.plan()).map_err(ExperimentError::from)?;
    open.close();
    let text = output(arguments.json, &checked, || {
        variables + &described(&checked, &scene) + unmeasured(&checked, &scene) + &structure(&scene, true)
    })?;
    if checked.verdict == Verdict::Healthy {
        return Ok(text);
    }
    print(&text)?;
    let verdict = named(&checked.verdict.to_string(), &scene);
    Err(Failure::run(format!("the loop check failed: {verdict}")))
}

/// Why the check of a structure has no linear response.
fn unmeasured(checked: &LoopCheck, scene: &Scene) -> &'static str {
    match (&checked.linear, &scene.structure) {
        (None, Some(_)) if checked.verdict == Verdict::Healthy => {
            "Natural frequency and damping are not measured: the response does not grow as that of one mode does.\n"
        }
        _ => "",
    }
}

/// The words of a check; where a force drives, those of a force.
pub(super) fn named(text: &str, scene: &Scene) -> String {
    match &scene.structure {
        Some(structure) if structure.excitation == Reference::Force => text
            .replace(
                "whether the base moves the structure through its spring",
                "the drive point",
            )
            .replace("base sensor", "force cell")
            .replace("base", "force"),
        _ => text.into(),
    }
}

pub(super) fn described(checked: &LoopCheck, scene: &Scene) -> String {
    let channels = [("response", Some(&checked.response)), ("base", checked.base.as_ref())];
    let rows = channels.into_iter().filter_map(|(name, channel)| {
        let CheckedChannel { gain, phase, delay, noise, floor, .. } = channel?;
        let noises = [noise, floor].map(|noise| format!("{noise:.1e}"));
        let numbers = [format!("{gain:.3}"), format!("{phase:.1}"), format!("{delay:.1}")];
        Some([&[named(name, scene)][..], &numbers, &noises].concat())
    });
    let table = Table::new("channel | gain | phase | delay | noise | floor").rows(rows);
    let mut text = format!("{}\n", table.text());
    let measured = |quantity: &CheckedQuantity| with_uncertainty(quantity.measured, quantity.uncertainty);
    if !checked.quantities.is_empty() {
        let rows = checked.quantities.iter().map(|quantity| {
            let separator = if quantity.unit.is_empty() { "" } else { ", " };
            let name = format!("{}{separator}{}", quantity.name, quantity.unit);
            cells![named(&name, scene), measured(quantity), quantity.expected]
        });
        text += &format!("{}\n", Table::new("measured | value | scene").rows(rows).text());
    }
    // What a refused check measures beside its fault is not used.
    let is_told = |one: &&CheckedQuantity| one.differs() && (one.verdict.is_some() || checked.linear.is_some());
    for quantity in checked.quantities.iter().filter(is_told) {
        let CheckedQuantity { name, unit, .. } = quantity;
        let (name, measured, expected) = (named(name, scene), measured(quantity), number(quantity.expected));
        let consequence = match quantity.verdict {
            Some(_) => format!("more than {} off is refused", quantity.tolerance),
            None => "`vines identify` and `vines backbone` use the measured value".into(),
        };
        text += &format!("Different from the scene: {name} is {measured} {unit}, not {expected}; {consequence}.\n");
    }
    let unit = scene.units().reference;
    let verdict = named(&checked.verdict.to_string(), scene);
    let (name, symbol) = (unit.amplitude(), unit.symbol);
    text += &format!("At {name} = {:.2e} {symbol}: {verdict}\n", checked.amplitude);
    if checked.is_raised() {
        text += &format!(
            "The noise of the sensors needed {:.0} % of the drive; the check took {:.0} periods.\n",
            100.0 * checked.share,
            checked.periods
        );
    }
    if let Some(linear) = &checked.linear {
        text += &format!(
            "Gains at a bandwidth of {:.3} rad/s: {:.4} 1/s and {:.4} 1/s²; phase margin {:.0} degrees.\n",
            linear.bandwidth, linear.gains[0], linear.gains[1], linear.phase_margin,
        );
    }
    text
}
