//! The map of run time: what an impact costs over detuning and base amplitude, on the axes of the regime map.
//!
//! Each cell is one rig. It settles, its regime is told from its impacts, and then long steps are timed: a cell and the default lock
//! take turns, so that their ratio does not depend on what else the machine does. Where there are fewer impacts than periods, the
//! cost is that of a period.

use std::f64::consts::TAU;
use std::hint::black_box;
use std::time::Instant;

use lovines::{Drive, Outcome, Parameters, Plant, State};
use serde::{Deserialize, Serialize};
use vines_model::{Dimensionless, map::observe, regime::Regime};

use crate::baseline::Baseline;
use crate::median;

/// Mass ratio of the default scene (lab/scene/paper.toml).
const EPSILON: f64 = 0.032 / 3.807;
/// Detuning and base amplitude where its loop locks.
const LOCK: (f64, f64) = (-1.1394, 1.1);
/// Periods that pass before anything is looked at, and over which a motion without repetition is followed before its regime is decided.
const SETTLING: u32 = 400;
/// Periods over which the plant is compared with the baseline, and the tolerances of the latter then and while it is timed.
const COMPARED: u32 = 20;
const TOLERANCES: (f64, f64) = (1e-13, 1e-12);
/// Name of motions with fewer impacts than periods, whatever their pattern.
const RARE: &str = "rare impacts";

/// How a row is measured.
#[derive(Clone, Copy, Debug, Deserialize)]
pub struct Effort {
    /// Periods in the timed step of the plant.
    periods: u32,
    /// Periods in the timed step of the closed form with Brent's method.
    brent_periods: u32,
    /// Timed runs of each cell, and of the lock beside it.
    runs: usize,
}

/// What was measured in one cell.
#[derive(Clone, Debug, Serialize)]
pub struct Cell {
    /// Detuning.
    sigma: f64,
    /// Base amplitude over `b epsilon`.
    #[serde(rename = "G")]
    g: f64,
    /// What the motion settles into.
    regime: &'static str,
    /// Impacts per period of the timed step.
    impacts_per_period: f64,
    /// What the costs are of: an impact or a period.
    unit: &'static str,
    /// Cost in the plant, ns: the median of the runs.
    ns: f64,
    /// Over the cost of an impact at the default lock, measured in turns with this cell.
    ratio: f64,
    /// Evaluations of the closed form per impact (or period).
    evaluations: f64,
    /// Cost of the closed form with Brent's method, ns; none if it stalls.
    brent_ns: Option<f64>,
    /// Largest difference of the two methods after 20 periods, in half-widths and natural radians, where the motion repeats.
    difference: Option<f64>,
}

/// The cells of one base amplitude.
#[derive(Debug, Serialize)]
pub struct Row {
    /// From the lowest detuning to the highest.
    cells: Vec<Cell>,
    /// Median cost of an impact at the default lock during this row, ns.
    lock_ns: f64,
}

/// The default rig, its drive at a detuning and a base amplitude, and where it has settled.
struct Settled {
    plant: Plant,
    drive: Drive,
}

impl Settled {
    fn from(start: State, sigma: f64, g: f64) -> anyhow::Result<Self> {
        let omega = 1.0 + EPSILON * sigma;
        anyhow::ensure!(
            omega > 0.0 && omega.is_finite() && g.is_finite(),
            "sigma = {sigma}, G = {g} (dimensionless): a frequency of {omega} omega0; allowed are finite values with a frequency above 0"
        );
        let drive = Drive::harmonic(g * EPSILON, omega);
        let mut plant = Plant::new(Parameters::dimensionless(EPSILON, 1.4274, 0.65), start)?;
        plant.begin(drive)?;
        plant.advance(drive, f64::from(SETTLING) * TAU / omega)?;
        Ok(Self { plant, drive })
    }

    /// From the start of the default scene.
    fn new(sigma: f64, g: f64) -> anyhow::Result<Self> {
        Self::from(State { dq2: 0.9027, ..State::default() }, sigma, g)
    }

    /// The length of some periods of the drive, s.
    fn periods(&self, count: u32) -> f64 {
        f64::from(count) * TAU / self.drive.omega
    }

    /// Wall time of `periods` in one step with the state read at the end, ns, and what the step met.
    fn timed(&self, periods: u32) -> anyhow::Result<(f64, Outcome)> {
        let mut plant = self.plant;
        let began = Instant::now();
        let outcome = plant.advance(black_box(self.drive), self.periods(periods));
        black_box(plant.state());
        Ok((began.elapsed().as_nanos() as f64, outcome?))
    }

    fn baseline(&self, tolerance: f64) -> Baseline {
        Baseline::new(*self.plant.parameters(), self.plant.state(), tolerance)
    }

    /// Nanoseconds of the baseline per impact, or per period of a motion without impacts; none if it stalls.
    fn timed_baseline(&self, periods: u32) -> Option<f64> {
        let mut brent = self.baseline(TOLERANCES.1);
        let began = Instant::now();
        let ended = brent.advance(black_box(self.drive), self.periods(periods));
        black_box(brent.state());
        let ns = began.elapsed().as_nanos() as f64;
        ended.is_ok().then_some(ns / units(brent.impacts, periods))
    }

    /// Largest difference of plant and baseline after some periods; none if the latter stalls.
    fn difference(&self) -> Option<f64> {
        let (mut plant, mut brent) = (self.plant, self.baseline(TOLERANCES.0));
        for _ in 0..COMPARED {
            plant.advance(self.drive, self.periods(1)).ok()?;
            brent.advance(self.drive, self.periods(1)).ok()?;
        }
        let [plant, brent] = [plant.state(), brent.state()].map(<[f64; 4]>::from);
        let both = plant.into_iter().zip(brent);
        both.map(|(a, b)| (b - a).abs()).reduce(f64::max)
    }
}

/// Impacts, or periods where impacts are rarer.
fn units(impacts: u64, periods: u32) -> f64 {
    (impacts as f64).max(f64::from(periods))
}

/// A cell with its costs so far, ns: of the lock, of the plant, of the baseline.
struct Timed {
    settled: Settled,
    cell: Cell,
    lock_ns: Vec<f64>,
    ns: Vec<f64>,
    brent_ns: Vec<Option<f64>>,
}

impl Timed {
    fn new(sigma: f64, g: f64) -> anyhow::Result<Self> {
        let settled = Settled::new(sigma, g)?;
        let scene = Dimensionless::of(settled.plant.parameters(), settled.drive.amplitude);
        let found = observe(&scene, sigma, settled.plant.state().into(), SETTLING as usize)?;
        // What is timed is the regime that was found, not the transient before it, whose length depends on rounding.
        let settled = Settled::from(found.state.into(), sigma, g)?;
        let impacts_per_period = found.impacts_per_period;
        let repeats = found.periods > 0 || found.regime == Regime::NoImpacts;
        let rare = 0.0 < impacts_per_period && impacts_per_period < 1.0;
        let cell = Cell {
            sigma,
            g,
            regime: if rare { RARE } else { found.regime.name() },
            impacts_per_period,
            unit: if impacts_per_period < 1.0 { "period" } else { "impact" },
            ns: f64::NAN,
            ratio: f64::NAN,
            evaluations: f64::NAN,
            brent_ns: None,
            difference: repeats.then(|| settled.difference()).flatten(),
        };
        Ok(Self {
            settled,
            cell,
            lock_ns: Vec::new(),
            ns: Vec::new(),
            brent_ns: Vec::new(),
        })
    }

    /// One run of the lock, of the plant, and of the closed form with Brent's method.
    fn run(&mut self, lock: &Settled, effort: &Effort) -> anyhow::Result<()> {
        let (ns, outcome) = lock.timed(effort.periods)?;
        self.lock_ns.push(ns / outcome.impacts as f64);
        let (ns, outcome) = self.settled.timed(effort.periods)?;
        let units = units(outcome.impacts, effort.periods);
        self.ns.push(ns / units);
        self.cell.evaluations = outcome.evaluations as f64 / units;
        self.brent_ns.push(self.settled.timed_baseline(effort.brent_periods));
        Ok(())
    }

    fn judge(self) -> Cell {
        let ns = median(self.ns);
        let brent_ns = self.brent_ns.into_iter().collect::<Option<Vec<_>>>().map(median);
        Cell { ns, ratio: ns / median(self.lock_ns), brent_ns, ..self.cell }
    }
}

/// Measures the cells at `G` = `g` and each detuning in `sigmas`, in as many rounds as there are runs.
///
/// # Errors
/// A frequency that is not positive, or a value that the plant does not accept.
pub fn row(g: f64, sigmas: &[f64], effort: &Effort) -> anyhow::Result<Row> {
    let lock = Settled::new(LOCK.0, LOCK.1)?;
    let begun: anyhow::Result<Vec<_>> = sigmas.iter().map(|&sigma| Timed::new(sigma, g)).collect();
    let mut begun = begun?;
    for round in 0..effort.runs {
        // Each round begins elsewhere: what another program does periodically does not meet the same cell every time.
        let first = round * begun.len() / effort.runs;
        let (before, after) = begun.split_at_mut(first);
        for cell in after.iter_mut().chain(before) {
            cell.run(&lock, effort)?;
        }
    }
    let lock_ns = median(begun.iter().flat_map(|cell| cell.lock_ns.clone()).collect());
    let cells = begun.into_iter().map(Timed::judge).collect();
    Ok(Row { cells, lock_ns })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn regimes_are_told_apart_and_the_two_methods_agree_where_motion_repeats() {
        let cell = |g: f64, sigma: f64| {
            let row = row(g, &[sigma], &Effort { periods: 20, brent_periods: 20, runs: 3 });
            row.map(|mut row| row.cells.remove(0))
        };
        for (g, sigma, name) in [
            (1.2, -3.0, "symmetric 1:1"),
            (1.2, 0.0, "symmetric 1:1"),
            (1.2, 1.0, "symmetric 1:1"),
            (1.5, -1.14, "asymmetric 1:1"),
            (2.5, 0.0, "n impacts"),
        ] {
            let cell = cell(g, sigma).expect("a row");
            assert_eq!(cell.regime, name, "sigma = {sigma}, G = {g}");
            let difference = cell.difference.expect("a motion that repeats");
            assert!(difference < 1e-11, "{sigma}, {g}: {difference:e}");
            assert!(cell.ratio > 0.0 && cell.brent_ns.is_some());
        }
        let rare = cell(0.1, -4.0).expect("a row");
        assert_eq!((rare.regime, rare.unit), (RARE, "period"));
        let refused = cell(1.0, -200.0).unwrap_err();
        assert!(refused.to_string().contains("sigma = -200"), "{refused}");
    }
}
