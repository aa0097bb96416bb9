//! The map on the terminal: `vines-bench map`.

use anyhow::{Context, bail};
use std::fmt::Write as _;
use std::io::IsTerminal;

use vines_model::regime::Regime;

use super::cell::RARE;
use super::{Axis, Cell, Effort, Methods, median, row};

/// How the command is called.
pub const HELP: &str = "\
vines-bench map: run time per impact over sigma and G, as ratios to the default lock in the same run

  --sigma FIRST:LAST:POINTS   detunings (default -5:5:33); a single value is allowed
  --G FIRST:LAST:POINTS       base amplitudes over b epsilon (default 0.1:3:21)
  --method plant|both         the plant alone, or Brent's method, too (default plant)
  --runs N                    timed runs of each cell (default 5)
  --periods N                 periods in each timed step (default 200)
  --cells                     also a line per cell

Where impacts are rarer than periods, the cost is that of a period.";

/// The largest ratios that are accepted: median and worst cell of a regime.
const ALLOWED: (f64, f64) = (4.0, 8.0);
const ALLOWED_SYMMETRIC: (f64, f64) = (1.5, 1.5);

/// Runs the command with its arguments; the text to print.
///
/// # Errors
/// An argument that is not known or has no valid value.
pub fn run(arguments: &[String]) -> anyhow::Result<String> {
    let (mut sigmas, mut gs) = (Axis::SIGMA, Axis::G);
    let mut effort = Effort { methods: Methods::Plant, ..Effort::default() };
    let mut cells_too = false;
    let mut rest = arguments.iter();
    while let Some(option) = rest.next() {
        let mut value = || {
            rest.next()
                .map(String::as_str)
                .with_context(|| format!("{option} needs a value"))
        };
        match option.as_str() {
            "--help" | "-h" => return Ok(HELP.into()),
            "--sigma" => sigmas = value()?.parse()?,
            "--G" => gs = value()?.parse()?,
            "--method" => effort.methods = methods(value()?)?,
            "--runs" => effort.runs = count(option, value()?)? as usize,
            "--periods" => effort.periods = count(option, value()?)?,
            "--cells" => cells_too = true,
            _ => match option.split_once('=') {
                Some(("--sigma", value)) => sigmas = value.parse()?,
                Some(("--G", value)) => gs = value.parse()?,
                _ => bail!("{option} is not an option of this command\n{HELP}"),
            },
        }
    }
    let (sigmas, gs) = (sigmas.values(), gs.values());
    let (mut rows, mut locks) = (Vec::new(), Vec::new());
    for (n, g) in gs.iter().enumerate() {
        if std::io::stderr().is_terminal() {
            eprint!("\rrow {} of {} ", n + 1, gs.len());
        }
        let row = row(*g, &sigmas, &effort)?;
        locks.push(row.lock_ns);
        rows.push(row.cells);
    }
    if std::io::stderr().is_terminal() {
        eprint!("\r");
    }
    let mut text = picture(&rows);
    if cells_too {
        text += "\n";
        for cell in rows.iter().flatten() {
            text += &line(cell);
        }
    }
    let lock = median(locks).unwrap_or(f64::NAN);
    let _ = write!(text, "\nDefault lock: {lock:.1} ns per impact\n\n");
    text += &summary(&rows.concat(), effort.methods == Methods::Both);
    Ok(text)
}

fn methods(text: &str) -> anyhow::Result<Methods> {
    match text {
        "plant" => Ok(Methods::Plant),
        "both" => Ok(Methods::Both),
        _ => bail!("--method {text}: allowed are plant and both"),
    }
}

fn count(option: &str, text: &str) -> anyhow::Result<u32> {
    let allowed = |n: &u32| (1..=100_000).contains(n);
    let wrong = || format!("{option} {text}: allowed is a whole number from 1 to 100000");
    text.parse().ok().filter(allowed).with_context(wrong)
}

/// One letter for a regime.
fn letter(regime: &str) -> char {
    match regime {
        "symmetric 1:1" => 's',
        "asymmetric 1:1" => 'a',
        "n impacts" => 'n',
        "modulated" => 'm',
        "chaotic" => 'c',
        "sticking" => 'k',
        RARE => 'r',
        _ => '.',
    }
}

/// A letter and the ratio for every cell, the largest base amplitude first.
fn picture(rows: &[Vec<Cell>]) -> String {
    let mut text = String::from(
        "Regime and ratio to the default lock's cost per impact; G downwards, sigma across\n\
         s symmetric 1:1, a asymmetric 1:1, n n impacts, m modulated, c chaotic, k sticking, r rare impacts, . no impacts\n\n",
    );
    for row in rows.iter().rev() {
        let _ = write!(text, "{:5.2} ", row[0].g);
        for cell in row {
            let ratio = match cell.ratio {
                x if x < 9.95 => format!("{x:.1}"),
                x => format!("{x:.0}"),
            };
            let _ = write!(text, " {}{ratio:<4}", letter(cell.regime));
        }
        text = text.trim_end().to_owned() + "\n";
    }
    if let Some(row) = rows.first() {
        text += "      ";
        for cell in row {
            let _ = write!(text, " {:<5}", format!("{:.1}", cell.sigma));
        }
        text = text.trim_end().to_owned() + "\n";
    }
    text
}

fn line(cell: &Cell) -> String {
    let number = |x: Option<f64>, digits: usize| x.map_or_else(|| "-".to_owned(), |x| format!("{x:.digits$e}"));
    format!(
        "sigma {:7.4} G {:6.4} {:14} {:6.2} impacts per period {:9.1} ns per {} ratio {:7.2} Brent {} ns difference {}\n",
        cell.sigma,
        cell.g,
        cell.regime,
        cell.impacts_per_period,
        cell.ns,
        cell.unit,
        cell.ratio,
        number(cell.brent_ns, 2),
        number(cell.difference, 1),
    )
}

/// A line per regime: median and worst ratio, what is allowed, and how the closed form with Brent's method compares.
fn summary(cells: &[Cell], brent_too: bool) -> String {
    let mut text = format!(
        "{:15} {:>5} {:>9} {:>8} {:>8}  {:24} {:>10}",
        "regime", "cells", "median ns", "ratio", "worst", "worst at", "difference"
    );
    let counted = cells.iter().any(|c| c.evaluations.is_some());
    if counted {
        text += "  evaluations: median, worst";
    }
    if brent_too {
        text += "  Brent/plant";
    }
    text += "  targets (median, worst)\n";
    for regime in Regime::SIMULATED.map(|one| one.name()).into_iter().chain([RARE]) {
        let cells: Vec<&Cell> = cells.iter().filter(|c| c.regime == regime).collect();
        let middle = |value: fn(&Cell) -> Option<f64>| {
            median(cells.iter().filter_map(|c| value(c)).collect()).unwrap_or(f64::NAN)
        };
        let Some(worst) = cells.iter().max_by(|a, b| a.ratio.total_cmp(&b.ratio)) else {
            continue;
        };
        let ratio = middle(|c| Some(c.ratio));
        let difference = cells.iter().filter_map(|c| c.difference).reduce(f64::max);
        let allowed = if regime == "symmetric 1:1" {
            ALLOWED_SYMMETRIC
        } else {
            ALLOWED
        };
        let _ = write!(
            text,
            "{regime:15} {:5} {:9.1} {ratio:8.2} {:8.2}  {:24} {:>10}",
            cells.len(),
            middle(|c| Some(c.ns)),
            worst.ratio,
            format!("sigma {:.3}, G {:.3}", worst.sigma, worst.g),
            difference.map_or_else(|| "-".to_owned(), |x| format!("{x:.1e}")),
        );
        if counted {
            let worst = cells.iter().filter_map(|c| c.evaluations).fold(0.0, f64::max);
            let _ = write!(text, "  {:19.2} {worst:6.2}", middle(|c| c.evaluations));
        }
        if brent_too {
            let times = median(cells.iter().filter_map(|c| Some(c.brent_ns? / c.ns)).collect());
            let shown = times.map_or_else(|| "-".to_owned(), |x| format!("{x:.2}"));
            let _ = write!(text, "  {shown:>11}");
        }
        let met = ratio <= allowed.0 && worst.ratio <= allowed.1;
        let _ = writeln!(
            text,
            "  {} ({}, {})",
            if met { "met" } else { "missed" },
            allowed.0,
            allowed.1
        );
    }
    text
}
