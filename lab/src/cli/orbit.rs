//! `vines orbit`: exact orbits at resonance, and their curves.

mod studies;
mod text;

use clap::Args;
use vines::orbit::{Condition, DOUBLINGS, Limits, backbone, continue_both_ways, phase_resonant, response, settle};
use vines::{ArgumentError, scene::Dimensionless};

use studies::{converged, defined};
use text::{SEARCHED, curve, described, listing, shown};

use super::{failure::Failure, scene_arguments::SceneArguments};

const HELP: &str = "\
Lengths are over b, velocities over b omega0, Omega = omega/omega0 = 1 + epsilon sigma:
  C            amplitude of the first harmonic of the response: of v = q1 + epsilon q2, or as resonance.sensor says
  B            speed of the particle in flight
  multipliers  moduli of the multipliers of the half-period map; stable if all are below 1

With --backbone or --response, orbits are followed by pseudo-arclength through folds and symmetry breaking, stable and unstable
ones alike; --json prints all of them. --response lists the components: all of symmetric 1:1 orbits over the whole range, those that
branch off at symmetry breakings and period doublings, three in a row (mirror images count once). Isolated branches of other patterns,
for instance within chaos, are missed; --sigma with --response follows the one that a start leads to. A branch that is not 1:1 ends
after a hundred unstable orbits in a row.

Examples:
  vines orbit
  vines orbit --response --set excitation.G=1.6
  vines orbit --backbone --set plant.c=0 --set plant.r=1 --set excitation.G=0
  vines orbit --sigma=-0.6 --set excitation.G=2.2   the orbit that settles there, here six impacts in two periods
  vines orbit --definitions                   resonance by phase or peak, by e or force, of v, q1 or acceleration
  vines orbit --convergence                   how theory approaches the exact orbit
  vines orbit --set excitation.G=1.0 --set plant.r=0.7
  vines orbit --scene scenes/dimensionless.toml --json";

/// Compute all exact symmetric 1:1 orbits (two impacts per period) at phase resonance
#[derive(Debug, Args)]
#[command(after_help = HELP)]
pub(super) struct Arguments {
    #[command(flatten)]
    scene: SceneArguments,

    /// The orbit of any pattern that the scene's start leads to at this detuning; with --response, its frequency response
    #[arg(long, value_name = "SIGMA", allow_negative_numbers = true, conflicts_with_all = ["backbone", "convergence"])]
    sigma: Option<f64>,

    /// Follow the exact backbone; without damping and with r = 1 it is the conservative nonlinear mode
    #[arg(long, group = "what")]
    backbone: bool,

    /// Follow all components of the exact frequency response at the scene's G
    #[arg(long, group = "what")]
    response: bool,

    /// Detunings of --response and --backbone
    #[arg(long, value_name = "FIRST:LAST", default_value = "-6:6", allow_hyphen_values = true, value_parser = detunings)]
    range: [f64; 2],

    /// Theory minus exact orbit at epsilon and its halvings, with the fitted exponent
    #[arg(long, group = "what")]
    convergence: bool,

    /// Theory minus exact orbit at epsilon and four halvings, for all definitions of resonance, references and sensors
    #[arg(long, group = "what")]
    definitions: bool,

    /// Print JSON instead of a table
    #[arg(long)]
    json: bool,
}

pub(super) fn run(arguments: &Arguments) -> Result<String, Failure> {
    let loaded = arguments.scene.load()?;
    let scene = loaded.dimensionless();
    if let Some(sigma) = arguments.sigma {
        return settled(arguments, &scene, sigma, loaded.dimensionless_start());
    }
    let [lowest, highest] = Limits::default().g;
    let limits = Limits {
        sigma: arguments.range,
        g: [lowest, highest.max(2.0 * scene.g)],
        ..Limits::default()
    };
    if arguments.backbone {
        let branch = backbone(&scene, &limits).ok_or_else(|| {
            Failure::run(format!(
                "there is no phase-resonant orbit to start from at G = {} (dimensionless); see `vines orbit`",
                scene.g
            ))
        })?;
        return shown(&scene, "Exact backbone", &branch, arguments.json, || {
            curve("Symmetric 1:1", &branch)
        });
    }
    if arguments.response {
        return components(arguments, &scene, &limits);
    }
    if arguments.convergence {
        return converged(&scene, arguments.json);
    }
    if arguments.definitions {
        return defined(&scene, arguments.json);
    }
    let orbits = phase_resonant(&scene);
    let title = format!("Exact symmetric 1:1 orbits at resonance: {}", scene.definition.name());
    shown(&scene, &title, &orbits, arguments.json, || listing(&scene, &orbits))
}

/// All components of the frequency response.
fn components(arguments: &Arguments, scene: &Dimensionless, limits: &Limits) -> Result<String, Failure> {
    let [from, to] = arguments.range;
    if 1.0 + scene.epsilon * from <= 0.0 {
        let rule = "1 + epsilon sigma must be above 0";
        return Err(Failure::input(format!(
            "--range from sigma = {from} (dimensionless): {rule}"
        )));
    }
    let found = response(scene, limits, DOUBLINGS);
    if found.components.is_empty() {
        return Err(Failure::run(format!(
            "no periodic motion with impacts was found at G = {} (dimensionless) from sigma = {from} to {to}; raise excitation.G",
            scene.g
        )));
    }
    shown(scene, "Exact frequency response", &found, arguments.json, || {
        let count = found.components.len();
        let all = found.components.iter().map(|one| curve(&one.name, &one.branch));
        format!(
            "{count} component{}\n{}\n{}",
            if count == 1 { "" } else { "s" },
            SEARCHED,
            all.collect::<String>()
        )
    })
}

/// Parses FIRST:LAST.
fn detunings(text: &str) -> Result<[f64; 2], ArgumentError> {
    let form = "expected FIRST:LAST, two detunings (dimensionless), the first below the last, for instance -6:6";
    let (from, to) = text.split_once(':').ok_or(form)?;
    match (from.trim().parse::<f64>(), to.trim().parse::<f64>()) {
        (Ok(from), Ok(to)) if from < to && from.is_finite() && to.is_finite() => Ok([from, to]),
        _ => Err(form.into()),
    }
}

/// Periods before the motion is evaluated.
const SETTLE: usize = 1000;

/// The motion that the start leads to at one detuning, or its frequency response.
fn settled(arguments: &Arguments, scene: &Dimensionless, sigma: f64, start: [f64; 4]) -> Result<String, Failure> {
    if !(1.0 + scene.epsilon * sigma > 0.0 && sigma.is_finite()) {
        return Err(Failure::input(format!(
            "--sigma = {sigma} (dimensionless): it must be finite, and 1 + epsilon sigma above 0"
        )));
    }
    let motion = settle(scene, sigma, start, SETTLE).map_err(Failure::input)?;
    let motion = motion.ok_or_else(|| {
        Failure::run(format!(
            "the scene's start leads to no repeating pattern of impacts at sigma = {sigma} (dimensionless) within {SETTLE} periods; \
             see `vines map`"
        ))
    })?;
    let pattern = motion.pattern.name();
    if arguments.response {
        let condition = Condition::Excitation(scene.g);
        let branch = continue_both_ways(
            scene,
            &motion,
            condition,
            &Limits { sigma: arguments.range, ..Limits::default() },
        );
        return shown(scene, "Exact frequency response", &branch, arguments.json, || {
            curve(&pattern, &branch)
        });
    }
    shown(scene, "Exact orbit", &motion, arguments.json, || {
        described(&pattern, &motion)
    })
}
