//! `vines theory`: first-order theory of a scene.

use std::path::PathBuf;

use clap::Args;
use serde_json::json;
use vines::table::{Cell, Table};
use vines::theory::{Activation, B_SYMMETRY_BREAKING, BranchSide, SlowFlow, backbone, resonant};
use vines::{cells, report::theory};

use super::failure::Failure;
use super::options::{SceneArguments, positive_frequency, warn_left_out};
use super::output::{Results, output, writable};
use super::summary::parameters;

const HELP: &str = "\
Everything is of first order in epsilon, except the thresholds from rest. Both branches of the slow invariant manifold
are one curve over B, the particle's speed over b omega0; C is the amplitude of v over b, and sigma the detuning (Omega - 1)/epsilon.

Examples:
  vines theory
  vines theory --set excitation.G=1.0
  vines theory --sigma=-1.0                       all equilibria at that detuning
  vines theory --figure theory.svg
  vines theory --json > theory.json";

/// Samples of the backbone in JSON.
const BACKBONE_SAMPLES: usize = 200;

/// Print first-order theory: invariant manifold, solutions at phase resonance, backbone
#[derive(Debug, Args)]
#[command(after_help = HELP)]
pub(super) struct Arguments {
    #[command(flatten)]
    scene: SceneArguments,

    /// Detuning at which to list all equilibria and the activation thresholds; without it, the thresholds at the backbone's
    /// stable solution, or at 0
    #[arg(long, value_name = "SIGMA", allow_negative_numbers = true)]
    sigma: Option<f64>,

    /// Write a figure (SVG): the slow invariant manifold, and backbones for several coefficients of restitution
    #[arg(long, value_name = "FILE")]
    figure: Option<PathBuf>,

    /// Print JSON, with the samples of the backbone, instead of a table
    #[arg(long)]
    json: bool,
}

pub(super) fn run(arguments: &Arguments) -> Result<Results, Failure> {
    writable(&arguments.figure)?;
    let loaded = arguments.scene.load()?;
    warn_left_out(loaded.left_out(), "theory is");
    let scene = loaded.dimensionless();
    let flow = SlowFlow::new(scene.lambda, scene.r);
    if let Some(sigma) = arguments.sigma {
        positive_frequency("--sigma", &scene, sigma)?;
    }
    let solutions = resonant(&scene);
    let stable = solutions.iter().find(|point| point.stable());
    let sigma = arguments.sigma.or(stable.map(|point| point.sigma)).unwrap_or(0.0);
    let equilibria = arguments.sigma.map(|sigma| flow.equilibria(scene.g, sigma));
    let activation = flow.activation(scene.epsilon, sigma);
    let (dissipation, b_min, c_min) = (flow.manifold.dissipation, flow.manifold.b_min(), flow.manifold.c_min());
    // From near the end of the left branch, where the particle is at rest, to a little beyond the stable range.
    let highest = 1.2 * B_SYMMETRY_BREAKING;
    let result = json!({
        "scene": scene,
        "manifold": {
            "R": dissipation,
            "B_min": b_min,
            "C_min": c_min,
            "B_symmetry_breaking": B_SYMMETRY_BREAKING,
        },
        "solutions": solutions,
        "sigma": sigma,
        "activation": activation,
        "equilibria": equilibria.clone().unwrap_or_default(),
        "backbone": backbone(&scene, highest / BACKBONE_SAMPLES as f64, highest, BACKBONE_SAMPLES),
    });
    let text = output(arguments.json, &result, || {
        let rows = solutions.iter().map(|point| {
            let stable = [point.impacts_stable, point.slow_flow_stable];
            row(point.branch, [point.sigma, point.c, point.b], stable)
        });
        let mut text = format!(
            "First-order theory\n  {}\n\n\
             Slow invariant manifold: R = {dissipation:.6}, fold at B = {b_min:.6}, C = {c_min:.6}\n\
             Symmetric impacts are stable for {b_min:.6} < B < {B_SYMMETRY_BREAKING:.6}\n\n\
             Resonance: {}\n{}\n{}",
            parameters(&scene),
            scene.definition.name(),
            table("branch | sigma | C | B", rows),
            thresholds(&activation, sigma),
        );
        if let Some(equilibria) = &equilibria {
            let rows = equilibria.iter().map(|point| {
                let stable = [point.impacts_stable, point.slow_flow_stable];
                row(point.branch, [point.c, point.b, point.gamma.to_degrees()], stable)
            });
            let equilibria = table("branch | C | B | phase, degrees", rows);
            text += &format!("\nEquilibria at sigma = {sigma}\n{equilibria}");
        }
        text
    })?;
    let (figure, json) = (arguments.figure.clone(), arguments.json);
    Ok(Results::with_figure(text, json, figure, move || theory(&scene).svg()))
}

fn thresholds(activation: &Activation, sigma: f64) -> String {
    let drive = |g: f64| format!("G = {g:.6}");
    let exact = |g: f64| format!("{} (exact)", drive(g));
    let stable = activation.stable.map_or("none at any G".into(), drive);
    let rows = [
        [
            "steady linear response reaches the wall",
            &drive(activation.steady_linear),
        ],
        [
            "impacts begin from rest, e = E sin(omega t)",
            &exact(activation.from_rest),
        ],
        [
            "the same with the best phase of e",
            &exact(activation.from_rest_any_phase),
        ],
        ["some 1:1 motion exists", &drive(activation.existence)],
        ["a stable one exists", &stable],
    ];
    format!("Activation at sigma = {sigma:.6}\n{}", Table::plain().rows(rows).text())
}

fn row(branch: BranchSide, numbers: [f64; 3], [impacts, slow_flow]: [bool; 2]) -> [Cell; 6] {
    let side = match branch {
        BranchSide::Left => "left",
        BranchSide::Right => "right",
    };
    let [first, second, third] = numbers;
    cells![side, first, second, third, impacts, slow_flow]
}

fn table(headings: &str, rows: impl Iterator<Item = [Cell; 6]>) -> String {
    let table = Table::new(&format!("{headings} | impacts stable | slow flow stable")).rows(rows);
    table.text_or("none at this excitation")
}
