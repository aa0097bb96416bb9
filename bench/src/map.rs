//! The map of run time: what an impact costs over detuning and base amplitude, on the axes of the regime map.
//!
//! Each cell is one rig. It settles, its regime is told from its impacts, and then long steps are timed: a cell and the default lock
//! take turns, so that their ratio does not depend on what else the machine does. Where there are fewer impacts than periods, the
//! cost is that of a period.

mod cell;
mod reference;
pub mod terminal;

use anyhow::anyhow;
use serde::{Deserialize, Serialize};

pub use cell::Cell;
use reference::Lock;

/// Which methods a map times.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Methods {
    /// The plant alone.
    Plant,
    /// The plant, and the closed form with Brent's method.
    Both,
}

/// How a row is measured.
#[derive(Clone, Copy, Debug, Deserialize)]
pub struct Effort {
    /// Methods to time.
    pub methods: Methods,
    /// Periods in the timed step of the plant.
    pub periods: u32,
    /// Periods in the timed step of the closed form with Brent's method.
    pub brent_periods: u32,
    /// Timed runs of each cell, and of the lock beside it.
    pub runs: usize,
}

impl Default for Effort {
    fn default() -> Self {
        Self {
            methods: Methods::Both,
            periods: 200,
            brent_periods: 50,
            runs: 5,
        }
    }
}

/// The cells of one base amplitude.
#[derive(Debug, Serialize)]
pub struct Row {
    /// From the lowest detuning to the highest.
    pub cells: Vec<Cell>,
    /// Median cost of an impact at the default lock during this row, ns.
    pub lock_ns: f64,
}

/// Measures the cells at `G` = `g` and each detuning in `sigmas`, in as many rounds as there are runs.
///
/// # Errors
/// A frequency that is not positive, or a value that the plant does not accept.
pub fn row(g: f64, sigmas: &[f64], effort: &Effort) -> anyhow::Result<Row> {
    let lock = Lock::settle()?;
    let mut begun = sigmas
        .iter()
        .map(|&sigma| cell::Settled::new(sigma, g))
        .collect::<Result<Vec<_>, _>>()?;
    for round in 0..effort.runs {
        // Each round begins elsewhere: what another program does periodically does not meet the same cell every time.
        let first = round * begun.len() / effort.runs;
        let (before, after) = begun.split_at_mut(first);
        for cell in after.iter_mut().chain(before) {
            cell.run(&lock, effort)?;
        }
    }
    let lock_ns = median(begun.iter().flat_map(cell::Settled::lock_ns).collect());
    Ok(Row {
        cells: begun.iter().map(cell::Settled::judge).collect(),
        lock_ns: lock_ns.unwrap_or(f64::NAN),
    })
}

/// The middle value, or the mean of the two in the middle; none of no values.
fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    let middle = values.len() / 2;
    match values.len() {
        0 => None,
        n if n % 2 == 1 => Some(values[middle]),
        _ => Some(0.5 * (values[middle - 1] + values[middle])),
    }
}

/// Equally spaced values; parsed from `-5:5:33`: first, last, how many.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Axis {
    from: f64,
    to: f64,
    points: usize,
}

impl Axis {
    /// As the regime map has it, with fewer points.
    pub const SIGMA: Self = Self { from: -5.0, to: 5.0, points: 33 };
    /// Likewise.
    pub const G: Self = Self { from: 0.1, to: 3.0, points: 21 };

    /// The values.
    pub fn values(&self) -> Vec<f64> {
        let step = (self.to - self.from) / (self.points - 1).max(1) as f64;
        (0..self.points).map(|n| self.from + step * n as f64).collect()
    }
}

impl std::str::FromStr for Axis {
    type Err = anyhow::Error;

    fn from_str(text: &str) -> anyhow::Result<Self> {
        let wrong = || {
            anyhow!(
                "`{text}` is not an axis; expected FIRST:LAST:POINTS (dimensionless) with 1 to 500 points, for instance -5:5:33"
            )
        };
        let parts: Vec<&str> = text.split(':').collect();
        let number = |text: &str| text.parse::<f64>().ok().filter(|x| x.is_finite());
        let (from, to, points) = match parts[..] {
            [only] => (number(only), number(only), Some(1)),
            [from, to, points] => (number(from), number(to), points.parse().ok()),
            _ => (None, None, None),
        };
        match (from, to, points) {
            (Some(from), Some(to), Some(points @ 1..=500)) if from <= to => Ok(Self { from, to, points }),
            _ => Err(wrong()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn short() -> Effort {
        Effort { periods: 20, brent_periods: 20, runs: 3, ..Effort::default() }
    }

    #[test]
    fn regimes_are_told_apart_and_the_two_methods_agree_where_motion_repeats() {
        let expected = [
            (1.2, -3.0, "symmetric 1:1"),
            (1.2, 0.0, "symmetric 1:1"),
            (1.2, 1.0, "symmetric 1:1"),
            (1.5, -1.14, "asymmetric 1:1"),
            (2.5, 0.0, "n impacts"),
        ];
        for (g, sigma, name) in expected {
            let row = row(g, &[sigma], &short()).expect("a row");
            let cell = &row.cells[0];
            assert_eq!(cell.regime, name, "sigma = {sigma}, G = {g}");
            let difference = cell.difference.expect("a motion that repeats");
            assert!(difference < 1e-11, "{sigma}, {g}: {difference:e}");
            assert!(cell.ratio > 0.0 && cell.brent_ns.is_some());
        }
        let rare = row(0.1, &[-4.0], &short()).expect("a row");
        assert_eq!((rare.cells[0].regime, rare.cells[0].unit), (cell::RARE, "period"));
    }

    #[test]
    fn a_frequency_below_zero_is_refused() {
        let refused = row(1.0, &[-200.0], &short()).unwrap_err();
        assert!(refused.to_string().contains("sigma = -200"), "{refused}");
    }

    #[test]
    fn axes_are_parsed_and_wrong_ones_refused() {
        let axis: Axis = "-5:5:3".parse().expect("an axis");
        assert_eq!(axis.values(), [-5.0, 0.0, 5.0]);
        assert_eq!("1.2".parse::<Axis>().expect("a value").values(), [1.2]);
        for wrong in ["", "1:2", "2:1:3", "1:2:0", "1:2:501", "a:2:3", "0:inf:3"] {
            assert!(wrong.parse::<Axis>().is_err(), "{wrong}");
        }
    }
}
