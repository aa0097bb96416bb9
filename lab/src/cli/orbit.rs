//! `vines orbit`: exact orbits at resonance, and their curves.

use std::f64::consts::TAU;
use std::path::PathBuf;

use clap::Args;
use lovines::{Event, State};
use serde::Serialize;
use serde_json::json;
use vines::comparison::ExactCurve;
use vines::orbit::{
    Bifurcation, Branch, BranchEnd, Condition, ContinuationLimits, DOUBLINGS, Orbit, OrbitCurve, Periodic, PlantMotion,
    Stability, continue_both_ways, phase_resonant, resonant_motion_under, response, settle, settled_motion,
    stable_resonant,
};
use vines::report::responses;
use vines::scene::{Dimensionless, Scene};
use vines::survey::{DETUNINGS, detunings, orbit_curves};
use vines::table::{Table, lines, note, number};
use vines::{ArgumentError, cells, numerics::range};

use super::failure::Failure;
use super::options::{SceneArguments, positive_frequency, warn_left_out};
use super::output::{Results, output, stability, writable};
use super::summary::{self, parameters};

const HELP: &str = "\
Lengths are over b, velocities over b omega0, Omega = omega/omega0 = 1 + epsilon sigma:
  C            amplitude of the first harmonic of the response: of v = q1 + epsilon q2, or as resonance.sensor says
  B            speed of the particle in flight
  multipliers  moduli of the multipliers of the half-period map: stable if all are below 1, neutral if the largest is 1 within 1e-7

With --backbone or --response, stable and unstable orbits are followed through folds and symmetry breaking; --json prints all of them.
--response lists the components: all symmetric 1:1 orbits over the whole range, and the branches from symmetry breakings and period
doublings, up to three in a row (mirror images count once; of a [structure] the symmetric 1:1 orbits only). Isolated branches of other
patterns, for instance within chaos, are missed; --sigma with --response follows the branch that a start leads to. A branch that is not
1:1 ends after a hundred unstable orbits in a row.

--periodic computes a motion of the plant with all effects of its cavity (friction, tilt, gaps, restitution that depends on the speed) by
Newton's method on the plant's own period map: at phase resonance under the scene's drive, continued from the ideal cavity, or, with
--sigma, the motion that the scene's start leads to. All other results are those of the ideal cavity.

Examples:
  vines orbit
  vines orbit --response --set excitation.G=1.6
  vines orbit --response --range=-3:1 --figure response.svg
  vines orbit --backbone --set plant.c=0 --set plant.r=1 --set excitation.G=0
  vines orbit --sigma=-0.6 --set excitation.G=2.2   the orbit that settles there, here six impacts in two periods
  vines orbit --set excitation.G=1.0 --set plant.r=0.7
  vines orbit --periodic --scene scenes/rough.toml  the plant's own motion, with friction
  vines orbit --scene scenes/dimensionless.toml --json";

/// Compute all exact symmetric 1:1 orbits (two impacts per period) at phase resonance
#[derive(Debug, Args)]
#[command(after_help = HELP)]
pub(super) struct Arguments {
    #[command(flatten)]
    scene: SceneArguments,

    /// The orbit of any pattern that the scene's start leads to at this detuning; with --response, its frequency response
    #[arg(
        long,
        value_name = "SIGMA",
        allow_negative_numbers = true,
        conflicts_with = "backbone"
    )]
    sigma: Option<f64>,

    /// Follow the exact backbone; without damping and with r = 1 it is the conservative nonlinear mode
    #[arg(long, group = "what")]
    backbone: bool,

    /// Follow all components of the exact frequency response at the scene's G
    #[arg(long, group = "what")]
    response: bool,

    /// The periodic motion of the plant with all effects of its cavity, at resonance or at --sigma
    #[arg(long, group = "what")]
    periodic: bool,

    /// Detunings of --response and --backbone [default: -6:6; of a structure, those of its backbone and of the controller]
    #[arg(long, value_name = "FIRST:LAST", allow_hyphen_values = true, value_parser = parsed)]
    range: Option<[f64; 2]>,

    /// Write a figure (SVG) of --response: exact and by theory, and the exact backbone
    #[arg(long, value_name = "FILE", requires = "response", conflicts_with = "sigma")]
    figure: Option<PathBuf>,

    /// Print JSON instead of a table
    #[arg(long)]
    json: bool,
}

pub(super) fn run(arguments: &Arguments) -> Result<Results, Failure> {
    writable(&arguments.figure)?;
    let loaded = arguments.scene.load()?;
    if arguments.periodic && loaded.structure.is_none() {
        return of_the_plant(arguments, &loaded).map(Results::from);
    }
    warn_left_out(loaded.left_out_of_cavity(), "exact orbits are");
    let scene = loaded.dimensionless();
    let range = arguments
        .range
        .or_else(|| detunings(&loaded, &scene))
        .unwrap_or(DETUNINGS);
    if arguments.backbone {
        let curves = orbit_curves(&loaded, &scene, range, false);
        return shown(&scene, "Exact backbone", &curves, arguments.json, || listed(&curves)).map(Results::from);
    }
    if loaded.structure.is_some() {
        return of_a_structure(arguments, &loaded, range);
    }
    if let Some(sigma) = arguments.sigma {
        return settled(arguments, &scene, (sigma, range), loaded.dimensionless_start()).map(Results::from);
    }
    let [lowest, highest] = ContinuationLimits::default().g;
    let limits = ContinuationLimits {
        sigma: range,
        g: [lowest, highest.max(2.0 * scene.g)],
        ..ContinuationLimits::default()
    };
    if arguments.response {
        return components(arguments, &scene, &limits);
    }
    let orbits = phase_resonant(&scene);
    let title = format!("Exact symmetric 1:1 orbits at resonance: {}", scene.definition.name());
    shown(&scene, &title, &orbits, arguments.json, || listing(&scene, &orbits)).map(Results::from)
}

/// The orbits of a structure in the numbers of its driven mode: its frequency response, or at resonance.
fn of_a_structure(arguments: &Arguments, scene: &Scene, range: [f64; 2]) -> Result<Results, Failure> {
    if let Some(structure) = scene
        .structure
        .as_ref()
        .filter(|_| arguments.periodic || arguments.sigma.is_some())
    {
        return Err(Failure::input(format!(
            "--periodic and --sigma are for one oscillator, and this scene has a {}; drop them",
            structure.section()
        )));
    }
    let (numbers, json) = (scene.dimensionless(), arguments.json);
    if !arguments.response {
        let orbits = vines::survey::phase_resonant(scene, &numbers);
        let title = "Exact symmetric 1:1 orbits of the structure at resonance, in the numbers of its driven mode; the four largest multipliers";
        return shown(&numbers, title, &orbits, json, || listing(&numbers, &orbits)).map(Results::from);
    }
    let curves = orbit_curves(scene, &numbers, range, true);
    let title =
        "Exact frequency response of the structure, symmetric 1:1 motions only, in the numbers of its driven mode";
    let text = shown(&numbers, title, &curves, json, || listed(&curves))?;
    let (figure, scene) = (arguments.figure.clone(), scene.clone());
    Ok(Results::with_figure(text, json, figure, move || {
        let middle = [0.5 * (range[0] + range[1]), 0.0];
        let backbone = ExactCurve::of_scene(&scene, &numbers, middle);
        let place = |orbit: &Orbit| ([orbit.sigma, orbit.c, orbit.b], !orbit.is_unstable());
        let curves = curves.iter().map(|curve| curve.points.iter().map(place).collect());
        responses(&numbers, curves, &backbone, range).svg()
    }))
}

/// All components of the frequency response.
fn components(arguments: &Arguments, scene: &Dimensionless, limits: &ContinuationLimits) -> Result<Results, Failure> {
    let [from, to] = limits.sigma;
    positive_frequency("--range from sigma", scene, from)?;
    let response = response(scene, limits, DOUBLINGS);
    if response.components.is_empty() {
        return Err(Failure::run(format!(
            "no periodic motion with impacts was found at G = {:.4} (dimensionless) from sigma = {from} to {to}; raise excitation.G",
            scene.g
        )));
    }
    let text = shown(scene, "Exact frequency response", &response, arguments.json, || {
        let count = response.components.len();
        let curves = response.components.iter();
        let curves: String = curves
            .map(|component| branch_text(&component.name, &component.branch))
            .collect();
        let plural = if count == 1 { "" } else { "s" };
        format!(
            "{count} component{plural}\nComplete: symmetric 1:1 motions and what branches off them. Isolated branches of other patterns are missed; \
             --sigma follows the\none that a start leads to.\n\n{curves}"
        )
    })?;
    let (figure, json, scene, range) = (arguments.figure.clone(), arguments.json, *scene, limits.sigma);
    Ok(Results::with_figure(text, json, figure, move || {
        let place = |motion: &Periodic| ([motion.sigma, motion.c, motion.b], !motion.stability.is_unstable());
        let components = response.components.iter();
        let curves = components.map(|component| component.branch.points.iter().map(place).collect());
        responses(&scene, curves, &ExactCurve::of(&scene), range).svg()
    }))
}

/// Parses FIRST:LAST.
fn parsed(text: &str) -> Result<[f64; 2], ArgumentError> {
    let form = "expected FIRST:LAST, two detunings (dimensionless), the first below the last, for instance -6:6";
    let (from, to) = text.split_once(':').ok_or(form)?;
    match (from.trim().parse::<f64>(), to.trim().parse::<f64>()) {
        (Ok(from), Ok(to)) if from < to && from.is_finite() && to.is_finite() => Ok([from, to]),
        _ => Err(form.into()),
    }
}

/// Periods before the motion is evaluated: nearly forty decay times, 1/(π ε λ) periods each, of the default scene's linear oscillator.
const SETTLE: usize = 1000;

/// The motion that the start leads to at one detuning, or its frequency response.
fn settled(
    arguments: &Arguments,
    scene: &Dimensionless,
    (sigma, range): (f64, [f64; 2]),
    start: [f64; 4],
) -> Result<String, Failure> {
    positive_frequency("--sigma", scene, sigma)?;
    let motion = settle(scene, sigma, start, SETTLE)?;
    let motion = motion.ok_or_else(|| {
        Failure::run(format!(
            "the scene's start leads to no repeating pattern of impacts at sigma = {sigma} (dimensionless) within {SETTLE} periods; \
             see `vines map`"
        ))
    })?;
    let pattern = motion.pattern.name();
    if arguments.response {
        let limits = ContinuationLimits { sigma: range, ..ContinuationLimits::default() };
        let branch = continue_both_ways(scene, &motion, Condition::Excitation(scene.g), &limits);
        return shown(scene, "Exact frequency response", &branch, arguments.json, || {
            branch_text(&pattern, &branch)
        });
    }
    shown(scene, "Exact orbit", &motion, arguments.json, || {
        described(&pattern, &motion)
    })
}

/// The motion of the plant with the effects of its cavity.
fn of_the_plant(arguments: &Arguments, scene: &Scene) -> Result<String, Failure> {
    let (plant, definition, numbers) = (&scene.plant, scene.definition(), scene.dimensionless());
    let motion = match arguments.sigma {
        None => resonant_motion_under(plant, definition, scene.amplitude)?,
        Some(sigma) => {
            positive_frequency("--sigma", &numbers, sigma)?;
            let drive = [numbers.omega(sigma), scene.amplitude];
            let motion = settled_motion(plant, definition, drive, scene.start, SETTLE)?;
            motion.ok_or_else(|| {
                Failure::run(format!(
                    "the scene's start leads to no motion that repeats within 32 periods, at sigma = {sigma} (dimensionless) after {SETTLE} \
                     periods: simulate it with `vines identify` or choose another start"
                ))
            })?
        }
    };
    let ideal = match arguments.sigma {
        None => scene.left_out().zip(stable_resonant(&numbers)),
        Some(_) => None,
    };
    let events = events(&motion);
    let State { q1, dq1, q2, dq2 } = motion.state;
    let PlantMotion {
        omega, amplitude, response, periods, impacts, rests, sticks, ..
    } = motion;
    let (f_hz, sigma) = (omega / TAU, numbers.sigma(omega));
    let (a_m, phase_deg) = (response.norm(), response.arg().to_degrees());
    let Stability { multipliers: roots, stable, neutral } = &motion.stability;
    let mut result = json!({
        "f_hz": f_hz,
        "sigma": sigma,
        "e_m": amplitude,
        "a_m": a_m,
        "phase_deg": phase_deg,
        "periods": periods,
        "impacts": impacts,
        "rests": rests,
        "sticks": sticks,
        "multipliers": roots,
        "stable": stable,
        "neutral": neutral,
        "state": [q1, dq1, q2, dq2],
        "events": events,
    });
    let ideal = ideal.map(|(left_out, orbit)| (left_out, orbit.sigma, orbit.c * numbers.b));
    if let Some(ideal) = &ideal {
        result["ideal"] = json!(ideal);
    }
    let title = "Periodic motion of the plant with all effects of its cavity";
    shown(&numbers, title, &result, arguments.json, || {
        let rows = events.iter().map(|one| {
            let side = one.side.map(|side| format!("{side:+}"));
            cells![one.phase_deg, one.event, side, one.velocity]
        });
        let table = Table::new("phase, degrees | event | side | w' before, m/s").rows(rows);
        let ideal = ideal.as_ref().map_or(String::new(), |(left_out, sigma, a_m)| {
            let results = format!("sigma = {sigma:.6} and response {a_m:.6e} m are");
            lines([note(summary::ideal(&results, left_out))])
        });
        format!(
            "  {f_hz:.6} Hz, sigma = {sigma:.6}; base {amplitude:.6e} m; response {a_m:.6e} m at {phase_deg:.4} degrees\n  in {periods} period{}: \
             impacts {impacts}, at rest on a wall {rests}, sticking to the floor {sticks}\n  multipliers {}: {}\n{ideal}\n{}",
            if periods == 1 { "" } else { "s" },
            multipliers(roots),
            match [*stable, *neutral] {
                [true, _] => "stable",
                [_, true] => "neutral",
                _ => "unstable",
            },
            table.text(),
        )
    })
}

/// An event of a motion.
#[derive(Serialize)]
struct MotionEvent {
    phase_deg: f64,
    event: &'static str,
    /// The wall of an impact, of coming to rest or of a release, or the direction of w' afterwards.
    side: Option<f64>,
    /// w' just before an impact.
    velocity: Option<f64>,
}

fn events(motion: &PlantMotion) -> Vec<MotionEvent> {
    let of = |(phase, event): &(f64, Event)| {
        let (event, side, velocity) = match *event {
            Event::Impact { wall, velocity, .. } => ("impact", Some(wall.sign()), Some(velocity)),
            Event::Stuck { wall, .. } => ("rests on the wall", Some(wall.sign()), None),
            Event::Released { wall, .. } => ("leaves the wall", Some(wall.sign()), None),
            Event::Sticking { .. } => ("sticks to the floor", None, None),
            Event::Slip { direction, .. } => ("slips", Some(direction), None),
            Event::Reversal { direction, .. } => ("turns round", Some(direction), None),
        };
        MotionEvent { phase_deg: phase.to_degrees(), event, side, velocity }
    };
    motion.events.iter().map(of).collect()
}

/// Multipliers in a line: real and imaginary parts.
fn multipliers(multipliers: &[[f64; 2]]) -> String {
    let each = multipliers.iter().map(|[re, im]| format!("{re:.5}{im:+.5}i"));
    each.collect::<Vec<_>>().join(", ")
}

/// A result as JSON, or as text under a title and the parameters of the scene.
fn shown(
    scene: &Dimensionless,
    title: &str,
    result: &impl Serialize,
    json: bool,
    text: impl FnOnce() -> String,
) -> Result<String, Failure> {
    output(json, result, || {
        format!("{title}\n  {}\n\n{}", parameters(scene), text())
    })
}

/// The motion and the states after its impacts.
fn described(pattern: &str, motion: &Periodic) -> String {
    let Periodic { sigma, c, b, gamma, .. } = motion;
    let rows = motion.bounces.iter().map(|impact| {
        let phase = impact.phase.to_degrees().rem_euclid(360.0);
        cells![format!("{:+}", impact.wall), phase, impact.q1, impact.dq1, impact.dq2]
    });
    let table = Table::new("wall | phase, degrees | q1 | q1' after | q2' after").rows(rows);
    format!(
        "{pattern}\n  sigma = {sigma:.6}, C = {c:.6}, phase {:.4} degrees, B = {b:.6}\n  multipliers {}\n\n{}",
        gamma.to_degrees(),
        multipliers(&motion.stability.multipliers),
        table.text()
    )
}

/// A motion of a curve, as a line of a table.
struct Place {
    numbers: [f64; 5],
    largest: f64,
    stability: &'static str,
}

impl From<&Orbit> for Place {
    fn from(one: &Orbit) -> Self {
        Self {
            numbers: [one.sigma, one.g, one.c, one.gamma, one.b],
            largest: one.multipliers[3],
            stability: stability(one.stable, one.neutral),
        }
    }
}

impl From<&Periodic> for Place {
    fn from(one: &Periodic) -> Self {
        Self {
            numbers: [one.sigma, one.g, one.c, one.gamma, one.b],
            largest: one.stability.growth(),
            stability: stability(one.stability.stable, one.stability.neutral),
        }
    }
}

/// Curves of symmetric motions.
fn listed(curves: &[OrbitCurve]) -> String {
    if curves.is_empty() {
        return "  none at these detunings\n".into();
    }
    let text = curves.iter().map(|OrbitCurve { points, special, closed }| {
        let special = special.iter().map(|(kind, orbit)| (*kind, orbit.into()));
        let ends = if *closed { "closed" } else { "open" };
        curve("Symmetric 1:1", ends, points.iter().map(Place::from), special)
    });
    text.collect()
}

/// A continued branch.
fn branch_text(name: &str, branch: &Branch) -> String {
    let ends = match branch.ended {
        [BranchEnd::Closed, _] => "closed".into(),
        [first, last] => format!("ends: {}; {}", first.name(), last.name()),
    };
    let special = branch.special.iter().map(|one| (one.kind, (&one.motion).into()));
    curve(name, &ends, branch.points.iter().map(Place::from), special)
}

/// A curve: its ends, at most 24 of its orbits, its bifurcations.
fn curve(
    name: &str,
    ends: &str,
    points: impl Iterator<Item = Place>,
    special: impl Iterator<Item = (Bifurcation, Place)>,
) -> String {
    let points: Vec<Place> = points.collect();
    let count = |word: &str| points.iter().filter(|place| place.stability == word).count();
    let [stable, neutral] = ["yes", "neutral"].map(count);
    let neutral = match neutral {
        0 => "",
        count => &format!(" and {count} neutral"),
    };
    let (low, high) = range((f64::MAX, f64::MIN), points.iter().map(|place| place.numbers[0]));
    let head = format!(
        "{name}: sigma from {low:.4} to {high:.4}, {} orbits, {stable} of them stable{neutral}; {ends}\n",
        points.len()
    );
    let thinned = points.iter().step_by(points.len().div_ceil(24));
    let rows = thinned.map(|Place { numbers: [sigma, g, c, gamma, b], largest, stability }| {
        cells![*sigma, *g, *c, gamma.to_degrees(), *b, *largest, *stability]
    });
    let table = Table::new("sigma | G | C | phase, degrees | B | largest mult. | stable");
    let special = special.map(|(kind, Place { numbers: [sigma, g, c, _, b], .. })| {
        let (name, g) = (kind.name(), number(g));
        format!("  {name} at sigma = {sigma:.6}, G = {g}, C = {c:.6}, B = {b:.6}")
    });
    format!("{head}{}{}\n", table.rows(rows).text(), lines(special))
}

/// Orbits, a line each.
fn listing(scene: &Dimensionless, orbits: &[Orbit]) -> String {
    let none = match scene.g == 0.0 {
        true => "none: without excitation (G = 0) there is no resonance",
        false => "none between 0.2 and 3 omega0 at this excitation",
    };
    let rows = orbits.iter().map(|orbit| {
        let Orbit { sigma, omega, c, b, stable, neutral, .. } = *orbit;
        let (phase, stable) = (orbit.gamma.to_degrees(), stability(stable, neutral));
        let [m1, m2, m3, m4] = orbit.multipliers.map(|modulus| format!("{modulus:.4}"));
        cells![sigma, omega, c, phase, b, m1, m2, m3, m4, stable]
    });
    let table = Table::new("sigma | Omega | C | phase, degrees | B | mult1 | mult2 | mult3 | mult4 | stable");
    table.rows(rows).text_or(none)
}
