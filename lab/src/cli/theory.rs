//! `vines theory`: first-order theory of a scene.

use clap::Args;
use serde::Serialize;
use vines::{
    report::{Table, row, summary::parameters},
    scene::Dimensionless,
    theory::{Activation, B_SYMMETRY_BREAKING, BackbonePoint, BranchSide, Equilibrium, SlowFlow, backbone, resonant},
};

use super::output::{output, yes_no};
use super::{failure::Failure, options::SceneArguments};

const HELP: &str = "\
Everything is of first order in epsilon, except the thresholds from rest. Both branches of the slow invariant manifold
are one curve over B, the particle's speed over b omega0; C is the amplitude of v over b, and sigma the detuning (Omega - 1)/epsilon.

Examples:
  vines theory
  vines theory --set excitation.G=1.0
  vines theory --sigma=-1.0                       all equilibria at that detuning
  vines theory --points 500 --json > theory.json";

/// Print first-order theory: invariant manifold, solutions at phase resonance, backbone
#[derive(Debug, Args)]
#[command(after_help = HELP)]
pub(super) struct Arguments {
    #[command(flatten)]
    scene: SceneArguments,

    /// Samples of the backbone
    #[arg(long, value_name = "N", default_value_t = 200, value_parser = clap::value_parser!(u32).range(2..=100_000))]
    points: u32,

    /// Detuning at which to list all equilibria and the activation thresholds; without it, the thresholds at the backbone's
    /// stable solution, or at 0
    #[arg(long, value_name = "SIGMA", allow_negative_numbers = true)]
    sigma: Option<f64>,

    /// Print JSON, with the samples of the backbone, instead of a table
    #[arg(long)]
    json: bool,
}

/// The JSON that is printed.
#[derive(Debug, Serialize)]
struct Report {
    scene: Dimensionless,
    manifold: Constants,
    solutions: Vec<BackbonePoint>,
    sigma: f64,
    activation: Activation,
    /// At that sigma; empty unless it was given.
    equilibria: Vec<Equilibrium>,
    backbone: Vec<BackbonePoint>,
}

#[derive(Debug, Serialize)]
struct Constants {
    #[serde(rename = "R")]
    dissipation: f64,
    #[serde(rename = "B_min")]
    b_min: f64,
    #[serde(rename = "C_min")]
    c_min: f64,
    #[serde(rename = "B_symmetry_breaking")]
    b_symmetry_breaking: f64,
}

pub(super) fn run(arguments: &Arguments) -> Result<String, Failure> {
    let scene = arguments.scene.load_for("theory is")?.dimensionless();
    let flow = SlowFlow::new(scene.lambda, scene.r);
    if let Some(sigma) = arguments.sigma.filter(|sigma| !sigma.is_finite()) {
        return Err(Failure::input(format!(
            "--sigma = {sigma} (dimensionless) is not a finite number"
        )));
    }
    let solutions = resonant(&scene);
    let stable = solutions.iter().find(|point| point.stable());
    let sigma = arguments.sigma.or(stable.map(|point| point.sigma)).unwrap_or(0.0);
    let at_sigma = arguments.sigma.map(|sigma| flow.equilibria(scene.g, sigma));
    let points = arguments.points as usize;
    // From near the end of the left branch, where the particle is at rest, to a little beyond the stable range.
    let highest = 1.2 * B_SYMMETRY_BREAKING;
    let report = Report {
        scene,
        manifold: Constants {
            dissipation: flow.manifold.dissipation,
            b_min: flow.manifold.b_min(),
            c_min: flow.manifold.c_min(),
            b_symmetry_breaking: B_SYMMETRY_BREAKING,
        },
        solutions,
        sigma,
        activation: flow.activation(scene.epsilon, sigma),
        equilibria: at_sigma.unwrap_or_default(),
        backbone: backbone(&scene, highest / points as f64, highest, points),
    };
    output(arguments.json, &report, || text(&report, arguments.sigma.is_some()))
}

fn text(report: &Report, with_equilibria: bool) -> String {
    let Constants { dissipation, b_min, c_min, b_symmetry_breaking } = report.manifold;
    let solutions = report.solutions.iter().map(|point| {
        let stable = [point.impacts_stable, point.slow_flow_stable];
        cells(point.branch, [point.sigma, point.c, point.b], stable)
    });
    let mut text = format!(
        "First-order theory\n  {}\n\n\
         Slow invariant manifold: R = {dissipation:.6}, fold at B = {b_min:.6}, C = {c_min:.6}\n\
         Symmetric impacts are stable for {b_min:.6} < B < {b_symmetry_breaking:.6}\n\n\
         Resonance: {}\n{}\n{}",
        parameters(&report.scene),
        report.scene.definition.name(),
        table("branch | sigma | C | B", solutions),
        thresholds(report),
    );
    if with_equilibria {
        let equilibria = report.equilibria.iter().map(|point| {
            let stable = [point.impacts_stable, point.slow_flow_stable];
            cells(point.branch, [point.c, point.b, point.gamma.to_degrees()], stable)
        });
        let equilibria = table("branch | C | B | phase, degrees", equilibria);
        text += &format!("\nEquilibria at sigma = {}\n{equilibria}", report.sigma);
    }
    text
}

fn thresholds(report: &Report) -> String {
    let activation = &report.activation;
    let stable = activation
        .stable
        .map_or("none at any G".into(), |g| format!("G = {g:.6}"));
    format!(
        "Activation at sigma = {:.6}\n  steady linear response reaches the wall      G = {:.6}\n  \
         impacts begin from rest, e = E sin(omega t)  G = {:.6} (exact)\n  \
         the same with the best phase of e            G = {:.6} (exact)\n  \
         some 1:1 motion exists                       G = {:.6}\n  \
         a stable one exists                          {stable}\n",
        report.sigma,
        activation.steady_linear,
        activation.from_rest,
        activation.from_rest_any_phase,
        activation.existence
    )
}

fn cells(branch: BranchSide, numbers: [f64; 3], stable: [bool; 2]) -> Vec<String> {
    let side = match branch {
        BranchSide::Left => "left",
        BranchSide::Right => "right",
    };
    let mut cells = row(side, numbers);
    cells.extend(stable.map(yes_no));
    cells
}

fn table(headings: &str, rows: impl Iterator<Item = Vec<String>>) -> String {
    let table = Table::new(&format!("{headings} | impacts stable | slow flow stable")).rows(rows);
    match table.is_empty() {
        true => "  none at this excitation\n".into(),
        false => table.text(),
    }
}
