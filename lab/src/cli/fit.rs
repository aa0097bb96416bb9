//! `vines fit`: the parameters of a rig from measured points of its backbone.

use std::fmt::Write;
use std::path::PathBuf;

use clap::Args;
use vines::fit::{Fit, FitReport, Known, fit};
use vines::points::{Column, read};
use vines::report::Table;

use super::failure::Failure;
use super::options::SceneArguments;
use super::output::{output, written};

const HELP: &str = "\
A point has the frequency of phase resonance f, the amplitude A of the response and the amplitude E of the base, each with its standard
uncertainty: a locked point of `vines identify` (identification.json), the points of `vines backbone` (tracked.csv), or a table of yours
with the columns f_Hz, A_m, E_m, u_f_Hz, u_A_m and u_E_m, or others that --column names. Points that are not settled, or not symmetric
1:1, are left out.

The model is the exact symmetric 1:1 motion of a linear oscillator and a particle between two walls. The fit finds
  f0, zeta    natural frequency and damping ratio of the structure without the particle
  r           restitution coefficient
  b           half-width of the cavity
  epsilon     mass ratio m/M
and, if --known gives one of M, m, k and c, the others in SI units. The scene is where the search begins, and what the result is compared with.

If the model does not describe the points (probability of so large a chi-square below 1 %), every line says so, and the exit code is 1.

Examples:
  vines fit out/tracked.csv
  vines fit out/tracked.csv out/identification.json --known m=0.032±0.0005
  vines fit table.csv --column A=amplitude:mm --column E=base:um --column f=frequency:Hz --column u_A=noise:mm --column u_E=noise_e:um --column u_f=noise_f:Hz
  vines fit out/tracked.csv --out rig.toml      a scene with the fitted plant, for every other command";

/// Fit the parameters of a rig to measured points of its backbone
#[derive(Debug, Args)]
#[command(after_help = HELP)]
pub(super) struct Arguments {
    /// Files with points: CSV, tracked.json or identification.json
    #[arg(value_name = "FILE", required = true)]
    points: Vec<PathBuf>,

    #[command(flatten)]
    scene: SceneArguments,

    /// A value from elsewhere, with its standard uncertainty; without one it is exact. May be repeated
    #[arg(long, value_name = "SYMBOL=VALUE±U")]
    known: Vec<Known>,

    /// Name and unit of a column; may be repeated
    #[arg(long, value_name = "QUANTITY=NAME:UNIT")]
    column: Vec<Column>,

    /// Write a scene with the fitted plant
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,

    /// Print JSON instead of a table
    #[arg(long)]
    json: bool,
}

pub(super) fn run(arguments: &Arguments) -> Result<String, Failure> {
    let scene = arguments.scene.load()?;
    let (mut points, mut skipped) = (Vec::new(), 0);
    for path in &arguments.points {
        let (more, left_out) = read(path, &arguments.column).map_err(Failure::input)?;
        points.extend(more);
        skipped += left_out;
    }
    let fit = fit(&points, scene.resonance, &scene.plant, &arguments.known).map_err(Failure::run)?;
    let report = fit.report(&scene.plant);
    let mut text = output(arguments.json, &report, || {
        summary(&report, &fit, points.len(), skipped)
    })?;
    if let Some(path) = &arguments.out {
        let plant = plant_section(&report, &fit.plant(&scene.plant));
        let scene = arguments.scene.with_plant(&plant)?;
        let files = vines::write_file(path, &scene).map_err(Failure::run)?;
        if !arguments.json {
            text += &written(&[files]);
        }
    }
    if report.describes {
        return Ok(text);
    }
    super::output::print(&text)?;
    Err(Failure::run(format!(
        "the model does not describe the points: chi-square is {:.0} for {} degrees of freedom. Friction, unequal gaps, tilt, a restitution \
         that depends on the speed, or uncertainties that are too small may be the reason",
        fit.chi_square, fit.degrees
    )))
}

fn summary(report: &FitReport, fit: &Fit, points: usize, skipped: usize) -> String {
    let doubt = if report.describes { "" } else { " (rejected)" };
    let rows = report.parameters.iter().map(|one| {
        let digits = digits(one.uncertainty);
        let number = |value: f64| format!("{value:.digits$}");
        let difference = (one.value - one.expected) / one.uncertainty;
        [
            one.symbol.to_string(),
            format!("{} ± {}{doubt}", number(one.value), number(one.uncertainty)),
            one.unit.to_string(),
            number(one.expected),
            format!("{difference:+.1} u"),
        ]
    });
    let mut text = Table::new("parameter | value | unit | scene | difference")
        .rows(rows)
        .text();
    let p = report
        .p_value
        .map_or_else(|| "without a degree of freedom".into(), |p| format!("p = {p:.2}"));
    let verdict = if report.describes {
        "the model describes them"
    } else {
        "the model does not describe them"
    };
    let _ = writeln!(
        text,
        "\n{} points; chi-square {:.1} for {} degrees of freedom ({p}): {verdict}",
        report.residuals.len(),
        report.chi_square,
        report.degrees
    );
    if skipped > 0 {
        let _ = writeln!(
            text,
            "{skipped} points are not settled or not symmetric 1:1, and left out"
        );
    }
    if !report.left_out.is_empty() {
        let numbers: Vec<String> = report.left_out.iter().map(usize::to_string).collect();
        let _ = writeln!(
            text,
            "{} of {points} points contradict the others, and are left out: {}",
            numbers.len(),
            numbers.join(", ")
        );
    }
    for (one, other, correlation) in fit.not_separated() {
        let _ = writeln!(
            text,
            "{one} is not determined: {one} and {other} have the correlation {correlation:.3}; give one of them with --known"
        );
    }
    text
}

/// Decimals for two digits of a standard uncertainty.
fn digits(uncertainty: f64) -> usize {
    if uncertainty > 0.0 && uncertainty.is_finite() {
        (1.0 - uncertainty.log10().floor()).clamp(0.0, 15.0) as usize
    } else {
        6
    }
}

/// The section `[plant]` of a scene, with the standard uncertainties in comments.
fn plant_section(report: &FitReport, plant: &vines::scene::Parameters) -> String {
    let lines = vines::scene::plant_keys(plant).into_iter().map(|(symbol, value)| {
        let fitted = report.parameters.iter().find(|one| one.symbol == symbol);
        let u = fitted.map_or_else(String::new, |one| format!(" ± {:.2e}", one.uncertainty));
        let is_ideal = ["M", "k", "c", "m", "b", "r"].contains(&symbol);
        let note = if is_ideal {
            format!("  # fitted{u}")
        } else {
            String::new()
        };
        format!("{symbol} = {value}{note}\n")
    });
    format!("[plant]\n{}", lines.collect::<String>())
}
