//! One cell of the map: a rig that settles, is classified, and is timed.

use std::f64::consts::TAU;
use std::time::Instant;

use lovines::{Drive, Plant, State};
use serde::Serialize;
use vines_model::{Dimensionless, map::observe, regime::Regime};

use super::reference::{Lock, RIG, drive, evaluations, more, settle, timed};
use super::{Effort, Methods, median};
use crate::methods::BrentBaseline;

/// Periods over which a motion without repetition is followed before its regime is decided, as in `vines map`.
const FOLLOWED: usize = 400;
/// Periods over which the plant is compared with the closed form and Brent's method, and the latter's tolerance, s.
const COMPARED: u32 = 20;
const TOLERANCE: f64 = 1e-15;
/// The tolerance while it is timed: that of the benches, 1e-12 natural radians.
const TIMED_TOLERANCE: f64 = 1e-12;

/// Name of motions with fewer impacts than periods, whatever their pattern.
pub const RARE: &str = "rare impacts";

/// What was measured in one cell.
#[derive(Clone, Debug, Serialize)]
pub struct Cell {
    /// Detuning.
    pub sigma: f64,
    /// Base amplitude over `b epsilon`.
    #[serde(rename = "G")]
    pub g: f64,
    /// What the motion settles into.
    pub regime: &'static str,
    /// Impacts of the pattern that repeats, and periods that it takes; 0 where none was seen.
    pub pattern: (usize, u32),
    /// Impacts per period of the timed step.
    pub impacts_per_period: f64,
    /// What the costs are of: an impact or a period.
    pub unit: &'static str,
    /// Cost in the plant, ns: the median of the runs.
    pub ns: f64,
    /// Over the cost of an impact at the default lock, measured in turns with this cell.
    pub ratio: f64,
    /// Evaluations of the closed form per impact (or period), where the plant counts them.
    pub evaluations: Option<f64>,
    /// Cost of the closed form with Brent's method, ns; none if it stalled or was not asked for.
    pub brent_ns: Option<f64>,
    /// Largest difference of the two methods after 20 periods (displacements over b, velocities over b omega0) where the motion
    /// repeats.
    pub difference: Option<f64>,
}

/// A settled cell with its runs so far.
pub struct Settled {
    sigma: f64,
    g: f64,
    drive: Drive,
    plant: Plant,
    brent: Option<BrentBaseline>,
    regime: &'static str,
    pattern: (usize, u32),
    impacts_per_period: f64,
    difference: Option<f64>,
    evaluations: Option<f64>,
    ns: Vec<f64>,
    lock_ns: Vec<f64>,
    brent_ns: Vec<f64>,
}

impl Settled {
    /// # Errors
    /// A frequency that is not positive, or a value that the plant does not accept.
    pub fn new(sigma: f64, g: f64) -> anyhow::Result<Self> {
        let drive = drive(sigma, g)?;
        let scene = Dimensionless::of(&RIG, drive.amplitude);
        let found = observe(&scene, sigma, scene.state(&settle(drive)?.state()), FOLLOWED)?;
        // What is timed is the regime that was found, not the transient before it, whose length depends on rounding.
        let mut plant = begin(std::array::from_fn(|n| found.state[n] * scale(n)), drive)?;
        more(&mut plant, drive, FOLLOWED as u32)?;
        let repeats = found.periods > 0 || found.regime == Regime::NoImpacts;
        let state = numbers(&plant.state());
        Ok(Self {
            sigma,
            g,
            drive,
            brent: Some(BrentBaseline::new(RIG, state, time(TIMED_TOLERANCE))),
            regime: found.regime.name(),
            pattern: (found.impacts, found.periods),
            impacts_per_period: found.impacts_per_period,
            difference: repeats.then(|| difference(state, drive)).flatten(),
            plant,
            evaluations: None,
            ns: Vec::new(),
            lock_ns: Vec::new(),
            brent_ns: Vec::new(),
        })
    }

    /// One run of the lock, of the plant, and of the closed form with Brent's method where asked for.
    ///
    /// # Errors
    /// None, as long as the drive of the cell is valid.
    pub fn run(&mut self, lock: &Lock, effort: &Effort) -> anyhow::Result<()> {
        self.lock_ns.push(lock.run(effort.periods)?);
        let (ns, outcome) = timed(&self.plant, self.drive, effort.periods)?;
        let units = units(outcome.impacts, effort.periods);
        self.ns.push(ns / units);
        self.evaluations = evaluations(&outcome).map(|n| n as f64 / units);
        if effort.methods == Methods::Both {
            self.run_brent(effort.brent_periods);
        }
        Ok(())
    }

    fn run_brent(&mut self, periods: u32) {
        let Some(mut brent) = self.brent else { return };
        let Drive { amplitude, omega, .. } = self.drive;
        let duration = f64::from(periods) * TAU / omega;
        let began = Instant::now();
        let ended = brent.advance(std::hint::black_box(amplitude), omega, duration);
        std::hint::black_box(brent.q1);
        let ns = began.elapsed().as_nanos() as f64;
        match ended {
            Ok(()) => self.brent_ns.push(ns / units(brent.impacts, periods)),
            Err(_) => self.brent = None,
        }
    }

    pub fn lock_ns(&self) -> impl Iterator<Item = f64> + '_ {
        self.lock_ns.iter().copied()
    }

    /// What the runs come to.
    pub fn judge(&self) -> Cell {
        let ns = median(self.ns.clone()).unwrap_or(f64::NAN);
        let lock = median(self.lock_ns.clone()).unwrap_or(f64::NAN);
        Cell {
            sigma: self.sigma,
            g: self.g,
            regime: if 0.0 < self.impacts_per_period && self.impacts_per_period < 1.0 {
                RARE
            } else {
                self.regime
            },
            pattern: self.pattern,
            impacts_per_period: self.impacts_per_period,
            unit: if self.impacts_per_period < 1.0 {
                "period"
            } else {
                "impact"
            },
            ns,
            ratio: ns / lock,
            evaluations: self.evaluations,
            brent_ns: self.brent.and_then(|_| median(self.brent_ns.clone())),
            difference: self.difference,
        }
    }
}

/// Impacts, or periods where impacts are rarer.
fn units(impacts: u64, periods: u32) -> f64 {
    (impacts as f64).max(f64::from(periods))
}

/// Largest difference of the plant and the closed form with Brent's method from the same state on; none if the latter stalls.
fn difference(state: [f64; 4], drive: Drive) -> Option<f64> {
    let mut plant = begin(state, drive).ok()?;
    let mut brent = BrentBaseline::new(RIG, state, time(TOLERANCE));
    let period = TAU / drive.omega;
    for _ in 0..COMPARED {
        plant.advance(drive, period).ok()?;
        brent.advance(drive.amplitude, drive.omega, period).ok()?;
    }
    let there = [brent.q1, brent.dq1, brent.q2, brent.dq2];
    let here = numbers(&plant.state());
    (0..4).map(|n| ((there[n] - here[n]) / scale(n)).abs()).reduce(f64::max)
}

fn begin([q1, dq1, q2, dq2]: [f64; 4], drive: Drive) -> anyhow::Result<Plant> {
    let state = State { q1, dq1, q2, dq2 };
    let mut plant = Plant::new(RIG, state)?;
    plant.begin(drive)?;
    Ok(plant)
}

fn numbers(state: &State) -> [f64; 4] {
    [state.q1, state.dq1, state.q2, state.dq2]
}

/// Unit of velocities: half-widths in natural radians, m/s.
fn speed() -> f64 {
    RIG.half_width * RIG.natural_frequency()
}

/// Seconds of so many natural radians.
fn time(radians: f64) -> f64 {
    radians / RIG.natural_frequency()
}

/// Unit of the n-th state.
fn scale(n: usize) -> f64 {
    if n.is_multiple_of(2) { RIG.half_width } else { speed() }
}
