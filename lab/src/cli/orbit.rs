//! `vines orbit`: exact orbits at phase resonance.

use std::fmt::Write;

use clap::Args;
use vines::{
    orbit::{
        Bifurcation, Branch, Limits, Orbit, Periodic, backbone, convergence, phase_resonant,
        response,
    },
    scene::Dimensionless,
};

use super::{
    failure::Failure,
    scene_arguments::SceneArguments,
    table::{number, parameters, table, yes_no},
};

const HELP: &str = "\
Lengths are over b, velocities over b omega0, Omega = omega/omega0 = 1 + epsilon sigma:
  C            amplitude of the first harmonic of the centre of mass, v = q1 + epsilon q2
  B            speed of the particle in flight
  multipliers  moduli of the multipliers of the half-period map; stable if all are below 1

With --backbone or --response, orbits are followed by pseudo-arclength through folds and symmetry breaking, stable and unstable
ones alike; --json prints all of them.

Examples:
  vines orbit
  vines orbit --response --set excitation.G=1.6
  vines orbit --convergence                   how theory approaches the exact orbit
  vines orbit --set excitation.G=1.0 --set plant.r=0.7
  vines orbit --scene scenes/dimensionless.toml --json";

/// All exact symmetric 1:1 orbits (two impacts per period) at phase resonance
#[derive(Debug, Args)]
#[command(after_help = HELP)]
pub(super) struct Arguments {
    #[command(flatten)]
    scene: SceneArguments,

    /// Follow the exact backbone through the scene's phase-resonant orbit
    #[arg(long, group = "what")]
    backbone: bool,

    /// Follow the exact frequency response at the scene's G, with the asymmetric orbits that branch off
    #[arg(long, group = "what")]
    response: bool,

    /// Theory less exact orbit at epsilon and its halvings, with the exponent that fits
    #[arg(long, group = "what")]
    convergence: bool,

    /// Print JSON instead of a table
    #[arg(long)]
    json: bool,
}

pub(super) fn run(arguments: &Arguments) -> Result<String, Failure> {
    let scene = arguments.scene.load()?.dimensionless();
    let none = || {
        Failure::run(format!(
            "there is no phase-resonant orbit to start from at G = {} (dimensionless); see `vines orbit`",
            scene.g
        ))
    };
    if arguments.backbone {
        let branch = backbone(&scene, &Limits::default()).ok_or_else(none)?;
        return shown(&scene, "Exact backbone", &branch, arguments.json, || {
            curve("Symmetric 1:1", &branch)
        });
    }
    if arguments.response {
        let found = response(&scene, &Limits::default()).ok_or_else(none)?;
        return shown(
            &scene,
            "Exact frequency response",
            &found,
            arguments.json,
            || {
                let asymmetric = found.asymmetric.iter();
                curve("Symmetric 1:1", &found.symmetric)
                    + &asymmetric
                        .map(|branch| curve("Asymmetric", branch))
                        .collect::<String>()
            },
        );
    }
    if arguments.convergence {
        let study = convergence(&scene, HALVINGS).ok_or_else(|| {
            Failure::run(format!(
                "theory or exact orbits have no stable phase-resonant solution at G = {} (dimensionless)",
                scene.g
            ))
        })?;
        return shown(
            &scene,
            "Theory less exact orbit",
            &study,
            arguments.json,
            || {
                let rows: Vec<_> = study
                    .rows
                    .iter()
                    .map(|row| {
                        let mut cells = vec![format!("{:.3e}", row.epsilon)];
                        cells.extend([row.sigma, row.c, row.b].map(|one| format!("{one:.3e}")));
                        cells
                    })
                    .collect();
                let [sigma, c, b] = study.slopes;
                table(&["epsilon", "sigma", "C", "B"], &rows)
                    + &format!("\nExponent of epsilon: sigma {sigma:.3}, C {c:.3}, B {b:.3}\n")
            },
        );
    }
    let orbits = phase_resonant(&scene);
    if arguments.json {
        return Ok(serde_json::to_string_pretty(&orbits)? + "\n");
    }
    let title = "Exact symmetric 1:1 orbits at phase resonance";
    Ok(format!(
        "{title}\n  {}\n\n{}",
        parameters(&scene),
        listing(&scene, &orbits)
    ))
}

/// Halvings of epsilon in the convergence study.
const HALVINGS: u32 = 7;
/// Rows of a curve that a person is shown.
const ROWS: usize = 24;

fn shown(
    scene: &Dimensionless,
    title: &str,
    found: &impl serde::Serialize,
    json: bool,
    text: impl FnOnce() -> String,
) -> Result<String, Failure> {
    if json {
        return Ok(serde_json::to_string_pretty(found)? + "\n");
    }
    Ok(format!("{title}\n  {}\n\n{}", parameters(scene), text()))
}

fn curve(name: &str, branch: &Branch) -> String {
    let ended = serde_json::to_value(branch.ended).unwrap_or_default();
    let mut text = format!(
        "{name}: {} orbits, {} of them stable; ended: {}\n",
        branch.points.len(),
        branch.points.iter().filter(|one| one.stable).count(),
        ended.as_str().unwrap_or_default()
    );
    let row = |motion: &Periodic| -> Vec<String> {
        let largest = motion.moduli()[3];
        let numbers = [
            motion.sigma,
            motion.g,
            motion.c,
            motion.gamma.to_degrees(),
            motion.b,
        ];
        let mut cells: Vec<String> = numbers.map(number).into();
        cells.extend([number(largest), yes_no(motion.stable)]);
        cells
    };
    let headings = [
        "sigma",
        "G",
        "C",
        "phase, degrees",
        "B",
        "largest mult.",
        "stable",
    ];
    let thinned = branch
        .points
        .iter()
        .step_by(branch.points.len().div_ceil(ROWS));
    text += &table(&headings, &thinned.map(row).collect::<Vec<_>>());
    for special in &branch.special {
        let what = match special.kind {
            Bifurcation::Fold => "fold",
            Bifurcation::SymmetryBreaking => "symmetry breaking",
            Bifurcation::PeriodDoubling => "period doubling",
            Bifurcation::Torus => "torus (modulation begins)",
        };
        let Periodic { sigma, g, c, b, .. } = special.motion;
        let _ = writeln!(
            text,
            "  {what} at sigma = {sigma:.6}, G = {g:.6}, C = {c:.6}, B = {b:.6}"
        );
    }
    text + "\n"
}

fn listing(scene: &Dimensionless, orbits: &[Orbit]) -> String {
    if orbits.is_empty() {
        return if scene.g == 0.0 {
            "  none: without excitation (G = 0) there is nothing to be in resonance with\n".into()
        } else {
            "  none between 0.2 and 3 omega0 at this excitation\n".into()
        };
    }
    let rows: Vec<_> = orbits
        .iter()
        .map(|orbit| {
            let numbers = [orbit.sigma, orbit.omega, orbit.c, orbit.b];
            let mut row: Vec<String> = numbers.map(number).into();
            row.extend(orbit.multipliers.map(|one| format!("{one:.4}")));
            row.push(yes_no(orbit.stable));
            row
        })
        .collect();
    let headings = [
        "sigma", "Omega", "C", "B", "mult1", "mult2", "mult3", "mult4", "stable",
    ];
    table(&headings, &rows)
}
