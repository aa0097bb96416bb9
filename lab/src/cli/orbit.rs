//! `vines orbit`: exact orbits at phase resonance.

use clap::Args;
use vines::{
    orbit::{Orbit, phase_resonant},
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

Examples:
  vines orbit
  vines orbit --set excitation.G=1.0 --set plant.r=0.7
  vines orbit --scene scenes/dimensionless.toml --json";

/// All exact symmetric 1:1 orbits (two impacts per period) at phase resonance
#[derive(Debug, Args)]
#[command(after_help = HELP)]
pub(super) struct Arguments {
    #[command(flatten)]
    scene: SceneArguments,

    /// Print a JSON array instead of a table
    #[arg(long)]
    json: bool,
}

pub(super) fn run(arguments: &Arguments) -> Result<String, Failure> {
    let scene = arguments.scene.load()?.dimensionless();
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
