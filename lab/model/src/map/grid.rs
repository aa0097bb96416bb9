//! The grid: all points, on all cores.

use std::f64::consts::TAU;

use rand_chacha::{
    ChaCha8Rng,
    rand_core::{Rng, SeedableRng},
};
use rayon::prelude::*;
use serde::Serialize;
use thiserror::Error;

use lovines::InvalidValue;

use super::{
    axis::{Axis, Range},
    observe::{observe, observe_confirmed},
    run::Point,
};
use crate::Dimensionless;
use crate::orbit::{BifurcationCurve, Limits, bifurcation_curves, stable_resonant};
use crate::regime::Regime;
use crate::theory::SlowFlow;

/// Usual largest number of periods that a cell is followed.
pub const LIMIT: usize = 20_000;
/// Usual number of further motions that must agree where chance decides when chaos ends.
pub const CONFIRMATIONS: usize = 6;

/// Settings of a map.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Plan {
    /// Parameters that are not on an axis.
    pub scene: Dimensionless,
    /// Detuning, if it is not on an axis.
    pub sigma: f64,
    /// Start (q1, q1', q2, q2'), dimensionless.
    pub start: [f64; 4],
    /// Horizontal axis.
    pub x: Range,
    /// Vertical axis.
    pub y: Range,
    /// Largest number of periods that a cell is followed.
    pub limit: usize,
    /// Starts per cell: that of the scene, and random ones.
    pub starts: usize,
    /// Motions from starts close by that must lead to the same regime where chance decides when chaos ends.
    pub confirmations: usize,
}

/// One cell of the map.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Cell {
    /// Detuning.
    pub sigma: f64,
    /// Base amplitude over `b epsilon`.
    #[serde(rename = "G")]
    pub g: f64,
    /// Restitution coefficient.
    pub r: f64,
    /// Result.
    #[serde(flatten)]
    pub point: Point,
    /// First-order theory has a stable symmetric 1:1 motion here.
    pub theory_stable: bool,
    /// Other regimes that random starts lead to and, where motions from starts close by differ, theirs; the cell is undecided then.
    pub coexisting: Vec<Regime>,
}

/// The map, row by row from the smallest y, each from the smallest x.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Map {
    /// Its settings.
    pub plan: Plan,
    /// Result.
    pub cells: Vec<Cell>,
    /// Where the 1:1 motions bifurcate; only over sigma and G.
    pub curves: Vec<BifurcationCurve>,
}

/// Why a map cannot be made.
#[derive(Debug, Error)]
pub enum MapError {
    /// Both axes have the same quantity.
    #[error("both axes are {0}: take two of sigma, G and r")]
    SameAxis(Axis),
    /// So few periods that nothing can be decided.
    #[error("{0} periods are too few to decide a regime: at least 100 are needed")]
    TooShort(usize),
    /// Not a positive frequency.
    #[error("sigma = {sigma} (dimensionless) gives the frequency {omega} omega0, which must be above 0")]
    Frequency {
        /// The detuning.
        sigma: f64,
        /// The frequency over omega0.
        omega: f64,
    },
    /// The plant refuses a parameter or the start.
    #[error(transparent)]
    Plant(#[from] InvalidValue),
}

impl Plan {
    /// A map from one start per cell, at the detuning of the stable resonant orbit (0 without one) if that is not on an axis.
    #[must_use]
    pub fn new(scene: Dimensionless, start: [f64; 4], x: Range, y: Range) -> Self {
        let mut plan = Self {
            scene,
            sigma: 0.0,
            start,
            x,
            y,
            limit: LIMIT,
            starts: 1,
            confirmations: 0,
        };
        if x.axis != Axis::Sigma && y.axis != Axis::Sigma {
            plan.sigma = stable_resonant(&scene).map_or(0.0, |orbit| orbit.sigma);
        }
        plan
    }

    /// Detuning and scene at a point of the plane.
    #[must_use]
    pub fn at(&self, x: f64, y: f64) -> (f64, Dimensionless) {
        let (mut sigma, mut scene) = (self.sigma, self.scene);
        for (range, value) in [(self.x, x), (self.y, y)] {
            match range.axis {
                Axis::Sigma => sigma = value,
                Axis::G => scene.g = value,
                Axis::R => scene.r = value,
            }
        }
        (sigma, scene)
    }

    /// Number of cells.
    #[must_use]
    pub fn cells(&self) -> usize {
        self.x.points * self.y.points
    }

    /// First-order theory has a stable symmetric 1:1 motion at a point of the plane.
    #[must_use]
    pub fn theory_stable(&self, x: f64, y: f64) -> bool {
        let (sigma, scene) = self.at(x, y);
        SlowFlow::new(scene.lambda, scene.r).has_stable_motion(scene.g, sigma)
    }

    fn check(&self) -> Result<(), MapError> {
        if self.x.axis == self.y.axis {
            return Err(MapError::SameAxis(self.x.axis));
        }
        if self.limit < 100 {
            return Err(MapError::TooShort(self.limit));
        }
        let lowest = self.at(self.x.from, self.y.from).0;
        let omega = 1.0 + self.scene.epsilon * lowest;
        if omega <= 0.0 {
            return Err(MapError::Frequency { sigma: lowest, omega });
        }
        Ok(())
    }

    /// Runs all cells on all cores; calls `done` after each.
    ///
    /// # Errors
    /// Invalid axes, times or values.
    pub fn run(&self, done: impl Fn() + Sync) -> Result<Map, MapError> {
        self.check()?;
        let cells = (0..self.cells())
            .into_par_iter()
            .map(|n| {
                let (x, y) = (self.x.at(n % self.x.points), self.y.at(n / self.x.points));
                let (sigma, scene) = self.at(x, y);
                let (mut point, other) = observe_confirmed(&scene, sigma, self.start, self.limit, self.confirmations)?;
                let mut coexisting = self.coexisting(&scene, sigma, n, point.regime)?;
                if let Some(other) = other {
                    coexisting.extend([point.regime, other]);
                    coexisting.sort();
                    coexisting.dedup();
                    point.regime = Regime::Undecided;
                }
                done();
                Ok(Cell {
                    sigma,
                    g: scene.g,
                    r: scene.r,
                    point,
                    theory_stable: self.theory_stable(x, y),
                    coexisting,
                })
            })
            .collect::<Result<_, InvalidValue>>()?;
        Ok(Map { plan: *self, cells, curves: self.curves() })
    }

    /// Regimes other than `known` that the random starts of the n-th cell lead to.
    fn coexisting(
        &self,
        scene: &Dimensionless,
        sigma: f64,
        n: usize,
        known: Regime,
    ) -> Result<Vec<Regime>, InvalidValue> {
        let mut random = ChaCha8Rng::seed_from_u64(n as u64);
        let mut found = Vec::new();
        for _ in 1..self.starts {
            let regime = observe(scene, sigma, random_state(&mut random), self.limit)?.regime;
            if regime != known && !found.contains(&regime) {
                found.push(regime);
            }
        }
        found.sort();
        Ok(found)
    }

    fn curves(&self) -> Vec<BifurcationCurve> {
        let range = |axis: Axis| [self.x, self.y].into_iter().find(|one| one.axis == axis);
        let (Some(sigma), Some(g)) = (range(Axis::Sigma), range(Axis::G)) else {
            return Vec::new();
        };
        let limits = Limits {
            sigma: [sigma.from, sigma.to],
            g: [g.from, g.to],
            ..Limits::default()
        };
        bifurcation_curves(&self.scene, &limits)
    }
}

impl Map {
    /// How many cells show a regime, and how many of those lie where theory has a stable 1:1 motion.
    #[must_use]
    pub fn count(&self, regime: Regime) -> (usize, usize) {
        let cells = || self.cells.iter().filter(|cell| cell.point.regime == regime);
        (cells().count(), cells().filter(|cell| cell.theory_stable).count())
    }
}

/// A random state with the particle inside its cavity: (q1, q1', q2, q2'), dimensionless.
fn random_state(random: &mut impl Rng) -> [f64; 4] {
    let mut uniform = || random.next_u64() as f64 / u64::MAX as f64;
    let (size, phase) = (1.5 * uniform(), TAU * uniform());
    let q1 = size * phase.sin();
    [
        q1,
        size * phase.cos(),
        q1 + 1.98 * (uniform() - 0.5),
        4.0 * (uniform() - 0.5),
    ]
}
