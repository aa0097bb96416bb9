//! `vines structure`: a structure before it is driven.

use std::f64::consts::TAU;
use std::path::PathBuf;

use clap::Args;
use serde_json::json;
use vines::cells;
use vines::orbit::{Bifurcation, StabilityChange, StructureBranch, StructureOrbit};
use vines::scene::{Scene, Structure};
use vines::survey::Survey;
use vines::table::{Cell, Table, lines};

use super::output::{Results, output, progress_bar, stability, writable};
use super::{failure::Failure, options::SceneArguments};

const HELP: &str = "\
The first table has the modes:
  m phi²      modal mass ratio, the particle over the modal mass at the cavity; first-order theory needs it to be small
  ratio       natural frequency over the driven mode's, and the nearest of its harmonics 3, 5 and 7, which impacts excite
  influence   what the mode adds to the conditions of impact, over what the driven mode alone has; far below 1 it leaves the motion, though
              not always its stability, as it is
The second table has all exact symmetric 1:1 orbits at phase resonance under the scene's drive, from 0.2 to 3 times the frequency of the driven
mode. The third has the stretches of the backbone that are stable or neutral, with the driven mode alone and with all modes, and the mode that
carries the disturbance at each end. Warnings name the ends at which it is not the driven one.

Examples:
  vines structure --scene scenes/cantilever.toml
  vines structure --scene beam.toml --set structure.mode=2 --json";

/// Print the modes of a structure, its exact 1:1 orbits at phase resonance, and which mode takes their stability
#[derive(Debug, Args)]
#[command(after_help = HELP)]
pub(super) struct Arguments {
    #[command(flatten)]
    scene: SceneArguments,

    /// Write a figure (SVG) of the backbone with all modes beside that of the driven mode alone
    #[arg(long, value_name = "FILE")]
    figure: Option<PathBuf>,

    /// Print JSON
    #[arg(long)]
    json: bool,
}

pub(super) fn run(arguments: &Arguments) -> Result<Results, Failure> {
    writable(&arguments.figure)?;
    let scene = arguments.scene.load()?;
    let no_structure = || Failure::input("the scene has no [structure]: its host is one oscillator, see `vines orbit`");
    let structure = scene.structure.as_ref().ok_or_else(no_structure)?;
    let bar = progress_bar(Survey::ORBITS as u64, "computing the backbone", "orbits");
    let survey = Survey::of(&scene, &|| {
        bar.inc(1);
        if bar.position() > bar.length().unwrap_or(0) {
            bar.inc_length(Survey::ORBITS as u64);
        }
    });
    bar.finish_and_clear();
    let survey = survey.ok_or_else(|| Failure::run("the exact orbits have no closed form at this frequency"))?;
    let result = json!({ "structure": structure, "survey": survey });
    let text = output(arguments.json, &result, || described(&scene, structure, &survey))?;
    let (figure, json, scene) = (arguments.figure.clone(), arguments.json, scene.clone());
    let drawn = move || vines::report::structure(&scene, &survey).map_or(String::new(), |figure| figure.svg());
    Ok(Results::with_figure(text, json, figure, drawn))
}

fn described(scene: &Scene, structure: &Structure, survey: &Survey) -> String {
    let point = |n: usize| &structure.points[n];
    let unit = structure.excitation.unit();
    let drive = structure
        .drive
        .map_or_else(|| "the base".into(), |n| format!("a force at {}", point(n)));
    let mut text = format!(
        "Structure of {} modes, driven by {drive} in mode {}; cavity at {}, sensor at {}\n\n",
        structure.modes.len(),
        structure.driven + 1,
        point(structure.cavity),
        point(structure.sensor)
    );
    text += &modes(structure, survey);
    let b = structure.units().response.of_metres(scene.plant.half_width);
    // The reference of an orbit, and what drives it.
    let (command, of_command) = match structure.shaker {
        Some(_) => ("command, V".to_owned(), "V"),
        None => (format!("drive, {unit}"), unit),
    };
    text += &format!(
        "\nExact symmetric 1:1 orbits at phase resonance under {:.4e} {unit}\n",
        scene.drive()
    );
    let rows = survey.orbits.iter().map(|orbit| row(orbit, b));
    let orbits = Table::new(&format!(
        "frequency, Hz | response, m | C | {command} | largest mult. | stable"
    ))
    .rows(rows);
    text += &orbits.text_or("none from 0.2 to 3 times the frequency of the driven mode");
    text += "\nStable stretches of the backbone, with the driven mode alone and with all modes, and what ends them\n";
    let [alone, all] = [("driven", &survey.facts.alone), ("all", &survey.facts.all)].map(|(modes, branches)| {
        let stretches = branches.iter().flat_map(StructureBranch::stretches);
        stretches
            .map(|(run, ends)| stretch(modes, run, ends, b))
            .collect::<Vec<_>>()
    });
    let is_lost = all.is_empty() && !alone.is_empty();
    let stretches = Table::new(&format!(
        "modes | C | frequency, Hz | {command} | lower end | upper end"
    ));
    text += &stretches.rows(alone.into_iter().chain(all)).text();
    if is_lost {
        text += "warning: with all modes no orbit of the backbone is stable\n";
    }
    text += &behind_shaker(scene, survey, b);
    for (mode, StabilityChange { kind, orbit, .. }) in survey.taken() {
        text += &format!(
            "warning: mode {} takes the stability at C = {:.4}, {:.4} Hz, {:.4e} {of_command} ({})\n",
            mode + 1,
            orbit.response / b,
            orbit.omega / TAU,
            orbit.drive,
            words(*kind)
        );
    }
    text
}

/// The modes as a table, and what is to be said of them.
fn modes(structure: &Structure, survey: &Survey) -> String {
    let rows = survey.facts.modes.iter().enumerate().map(|(n, mode)| {
        let (order, distance) = mode.harmonic;
        let harmonic = match n == survey.driven {
            true => "driven".to_owned(),
            false => format!("{order}, {:+.2}", (mode.ratio - f64::from(order)).signum() * distance),
        };
        let (hertz, zeta, mass, ratio) = (mode.omega0 / TAU, mode.zeta, mode.mass_ratio, mode.ratio);
        cells![n + 1, hertz, zeta, mass, ratio, harmonic, mode.influence]
    });
    let mut text = Table::new("mode | frequency, Hz | damping | m phi² | ratio | harmonic | influence")
        .rows(rows)
        .text();
    if structure.shaker.is_some() {
        text += "  the modes of the structure with its shaker: a damping above 1 is that of two poles which do not oscillate\n";
    }
    if let Some(masses) = structure.mass_loading() {
        text += &format!("  {masses}\n");
    }
    let left_out = (1..).zip(&structure.modes).filter(|(_, mode)| mode.out_of_phase > 0.0);
    text + &lines(left_out.map(|(n, mode): (usize, _)| {
        let percent = 100.0 * mode.out_of_phase;
        format!("  mode {n}: {percent:.1} % of the shape are out of phase and left out")
    }))
}

/// The stable backbone behind a shaker as a table; empty without one.
fn behind_shaker(scene: &Scene, survey: &Survey, b: f64) -> String {
    let rows = survey.behind_shaker.iter().map(|one| {
        let [omega, drive] = one.at;
        let apart = one.by_sine.map(|[sine, by]| {
            let numbers = scene.dimensionless();
            [numbers.sigma(omega) - numbers.sigma(sine), drive / by - 1.0]
        });
        let sigma = apart.map(|[sigma, _]| format!("{sigma:+.2e}"));
        let by = apart.map(|[_, by]| format!("{:+.3}", 100.0 * by));
        let [third, fifth, seventh] = one.harmonics.map(|harmonic| format!("{:.3}", 100.0 * harmonic));
        let (c, hertz, drive) = (one.response / b, omega / TAU, format!("{drive:.4e}"));
        cells![c, hertz, drive, third, fifth, seventh, sigma, by]
    });
    let behind = Table::new(&format!(
        "C | frequency, Hz | drive, {} | 3rd, % | 5th, % | 7th, % | sigma less sine's | drive over sine's, %",
        scene
            .structure
            .as_ref()
            .map_or("", |structure| structure.excitation.unit())
    ))
    .rows(rows);
    behind.text_under(
        "\nThe stable backbone behind the shaker: harmonics of the drive, and distance from the backbone under a pure sine at the same C",
    )
}

/// A bifurcation on a backbone.
fn words(kind: Bifurcation) -> &'static str {
    match kind {
        // The backbone goes on.
        Bifurcation::Fold => "fold of the frequency response",
        kind => kind.name(),
    }
}

/// A stretch of stable orbits, from its smaller to its larger C.
fn stretch(modes: &str, run: &[StructureOrbit], ends: [Option<&StabilityChange>; 2], b: f64) -> Vec<String> {
    let neutral = if run[0].stability.neutral { ", neutral" } else { "" };
    let mut ends = [(&run[0], ends[0]), (&run[run.len() - 1], ends[1])]
        .map(|(orbit, change)| (change.map_or(orbit, |change| &change.orbit), change));
    ends.sort_by(|one, other| one.0.response.total_cmp(&other.0.response));
    let between = |value: fn(&StructureOrbit) -> f64, unit: f64| {
        let [low, high] = ends.map(|(orbit, _)| format!("{:.4}", value(orbit) / unit));
        if low == high { low } else { format!("{low} to {high}") }
    };
    let drives = ends.map(|(orbit, _)| format!("{:.3e}", orbit.drive));
    let reason = |change: Option<&StabilityChange>| match change {
        None => "the curve ends".into(),
        Some(change) => match change.section() {
            None => words(change.kind).into(),
            Some(mode) => format!("{} (mode {})", words(change.kind), mode + 1),
        },
    };
    let [lower, upper] = ends.map(|(_, change)| reason(change));
    vec![
        format!("{modes}{neutral}"),
        between(|orbit| orbit.response, b),
        between(|orbit| orbit.omega, TAU),
        drives.join(" to "),
        lower,
        upper,
    ]
}

/// An orbit; C is its response over that of the driven mode with the amplitude b at the cavity.
fn row(orbit: &StructureOrbit, b: f64) -> [Cell; 6] {
    let [response, drive] = [orbit.response, orbit.drive].map(|value| format!("{value:.4e}"));
    let (hertz, c) = (orbit.omega / TAU, orbit.response / b);
    let stable = stability(orbit.stability.stable, orbit.stability.neutral);
    cells![hertz, response, c, drive, orbit.stability.growth(), stable]
}
