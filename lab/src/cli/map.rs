//! `vines map`: the regime map.

use std::fmt::Write;
use std::path::PathBuf;

use clap::Args;
use vines::map::{CONFIRMATIONS, LIMIT};
use vines::orbit::Branch;
use vines::regime_map::{Axis, Map};
use vines::report;

use super::failure::Failure;
use super::options::{SceneArguments, warn_left_out};
use super::output::{Results, Written, progress_bar, results};
use super::summary::{parameters, regimes};

const HELP: &str = "\
Every cell is one plant, driven at a fixed frequency from the scene's start:
  no impacts      the particle rests, and the primary mass cannot reach it
  symmetric 1:1   two impacts per period, half a period apart; asymmetric 1:1: at uneven intervals
  n impacts       any other motion that repeats itself
  quasi-periodic  nothing repeats; the largest Lyapunov exponent is zero within its uncertainty
  modulated       the exponent is positive, and a fifth of the impacts or more are captured into 1:1 resonance for a while
  chaotic         the exponent is positive, with fewer captures
  undecided       none of these was shown within --periods, or motions that start 1e-9 apart differ after them
A cell is followed until it repeats itself, or for --periods; the table has the periods followed, the duration of the transient,
the recurrence, the exponent with its standard error, the share of captured impacts, and how often the particle sticks to a wall.

Chaos may end after a random time. A cell is named modulated or chaotic only if all of 1 + --confirmations motions remain so for
--periods; docs/regimes.md says how often chaos ends later. The column `coexisting` has the regimes of motions that differ.
Where several regimes are stable, the start decides: a particle at rest may remain at rest where a moving one hits the walls.
A map over two numbers of the start, such as start.q2 and start.dq2, shows which starts lead to which regime.

A key is sigma, G, r, or section.key of a scene. More axes, or a map too large for the memory: `vines.sweep` in Python.

Examples:
  vines map                                               sigma and G, in out/
  vines map --x r=0.3:1:71 --y G=0.2:3:57 --sigma=-1.1
  vines map --x plant.b=0.005:0.02:31 --y r=0.3:1:36
  vines map --x sigma=-2:1:61 --y G=0.5:2:61 --set start.dq2=0 --set start.q2=0.005

Over sigma and G, the curves on which 1:1 motions bifurcate are followed and drawn, solid where they bound the stability of a motion.

Writes map.csv and map.svg, and over sigma and G also bifurcations.csv.";

/// Map the regimes of the response over sigma and G, or two other keys of a scene
#[derive(Debug, Args)]
#[command(after_help = HELP)]
pub(super) struct Arguments {
    #[command(flatten)]
    scene: SceneArguments,

    /// Horizontal axis: its key, first and last value, and the number of points
    #[arg(long, value_name = "KEY=FIRST:LAST:POINTS", default_value = "sigma=-5:5:101")]
    x: Axis,

    /// Vertical axis, in the same form
    #[arg(long, value_name = "KEY=FIRST:LAST:POINTS", default_value = "G=0.1:3:59")]
    y: Axis,

    /// Detuning, if it is not on an axis [default: that of the scene's stable phase-resonant orbit, or 0]
    #[arg(long, value_name = "SIGMA", allow_negative_numbers = true)]
    sigma: Option<f64>,

    /// Largest number of periods that a cell is followed; at least 100
    #[arg(long, value_name = "PERIODS", default_value_t = LIMIT)]
    periods: usize,

    /// Further motions, from starts 1e-9 apart, that must lead to the same regime in chaotic and modulated cells, and
    /// after transients of more than 500 periods
    #[arg(long, value_name = "N", default_value_t = CONFIRMATIONS)]
    confirmations: usize,

    /// Folder for the results; created if it does not exist
    #[arg(long, value_name = "DIR", default_value = "out")]
    out: PathBuf,
}

/// What is written.
pub(super) const FILES: [&str; 3] = ["map.csv", "map.svg", "bifurcations.csv"];

pub(super) fn run(arguments: &Arguments) -> Result<Results, Failure> {
    let Arguments { x, y, sigma, periods, confirmations, out, .. } = arguments;
    let mut map = Map::new(arguments.scene.family()?, x, y, *sigma, *periods)?;
    if let Some(structure) = &map.common.scene.structure {
        return Err(Failure::input(format!(
            "a regime map is of one oscillator: the scene has a {}; drop it, and give M, k and c",
            structure.section()
        )));
    }
    warn_left_out(map.common.scene.left_out(), "a regime map is");
    let folder = results(out, &FILES)?;
    let bar = progress_bar(map.size(), "mapping regimes", "cells");
    map.run(*confirmations, || bar.inc(1))?;
    bar.finish_and_clear();
    Ok(Results::new(format!("{}\n", summary(&map)), false, move || {
        let mut written = Written::default();
        let files = report::map_files(&map).map_err(Failure::from);
        written.add(files.and_then(|files| Ok(folder.replace(files)?)));
        written
    }))
}

fn summary(map: &Map) -> String {
    let Map { x, y, .. } = map;
    let mut text = format!(
        "Regimes over {x} and {y}\n  {}\n\n{}",
        parameters(&map.common.scene.dimensionless()),
        regimes(map).text()
    );
    if !map.curves.is_empty() {
        text.push('\n');
    }
    for curve in &map.curves {
        let Branch { points, ended: [start, end], .. } = &curve.branch;
        let (name, count) = (curve.name(), points.len());
        let _ = writeln!(text, "  {name}: {count} points; ends: {}; {}", start.name(), end.name());
    }
    text
}
