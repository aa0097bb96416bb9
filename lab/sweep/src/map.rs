//! A regime map: a sweep over two grids in memory, with the bifurcation curves of the 1:1 motions.

use rayon::prelude::*;
use vines_model::{
    map::{RegimeResult, observe_confirmed},
    orbit::{BifurcationCurve, ContinuationLimits, bifurcation_curves},
    regime::Regime,
    theory::SlowFlow,
};
use vines_testbench::scene::Family;

use crate::{
    axis::{Axis, Grid, SIGMA, Values},
    sweep::{Settings, Sweep, SweepError},
};

/// Most values of an axis: all cells are in memory, 200 bytes each, and in one figure.
const MOST: u64 = 2000;

/// One cell of a map.
#[derive(Debug, Clone, PartialEq)]
pub struct MapCell {
    /// Detuning.
    pub sigma: f64,
    /// Base amplitude over `b epsilon`.
    pub g: f64,
    /// Restitution coefficient.
    pub r: f64,
    /// Result.
    pub result: RegimeResult,
    /// First-order theory has a stable symmetric 1:1 motion here.
    pub theory_stable: bool,
    /// The regimes of motions from starts close by, where they differ; the cell is undecided then.
    pub coexisting: Vec<Regime>,
}

/// A map, row by row from the smallest y, each from the smallest x.
#[derive(Debug)]
pub struct Map {
    /// Its sweep: the axes are y and x.
    pub sweep: Sweep,
    /// Values of the horizontal axis.
    pub x: Grid,
    /// Values of the vertical axis.
    pub y: Grid,
    /// Its cells; none before [`Map::run`].
    pub cells: Vec<MapCell>,
    /// Where the 1:1 motions bifurcate; only over sigma and G.
    pub curves: Vec<BifurcationCurve>,
}

impl Map {
    /// Checks a map over numbers of `family`; nothing is computed yet.
    ///
    /// # Errors
    /// Axes, numbers of periods or values at the corners of the map that are not allowed.
    pub fn new(family: Family, x: &Axis, y: &Axis, sigma: Option<f64>, periods: usize) -> Result<Self, SweepError> {
        let grid = |axis: &Axis| match axis.values {
            Values::Grid(grid) if grid.points <= MOST => Ok(grid),
            _ => Err(SweepError::Setting(format!(
                "{axis}: a map needs FIRST:LAST:POINTS with 2 to {MOST} points"
            ))),
        };
        let settings = Settings {
            axes: vec![y.clone(), x.clone()],
            sigma,
            periods,
            ..Settings::default()
        };
        let map = Self {
            x: grid(x)?,
            y: grid(y)?,
            sweep: Sweep::new(family, settings)?,
            cells: Vec::new(),
            curves: Vec::new(),
        };
        for x in [map.x.from, map.x.to] {
            for y in [map.y.from, map.y.to] {
                map.sweep.at(&[y, x])?;
            }
        }
        Ok(map)
    }

    /// Computes all cells on all cores; calls `done` after each. `confirmations` motions from starts close by must lead to the same
    /// regime where chance decides when chaos ends.
    ///
    /// # Errors
    /// Values that scene or plant refuse.
    pub fn run(&mut self, confirmations: usize, done: impl Fn() + Sync) -> Result<(), SweepError> {
        let cells = (0..self.sweep.cells()).into_par_iter().map(|n| {
            let place = [self.y.at(n / self.x.points), self.x.at(n % self.x.points)];
            let cell = self.cell(&place, confirmations);
            done();
            cell
        });
        self.cells = cells.collect::<Result<_, _>>()?;
        self.curves = self.bifurcations();
        Ok(())
    }

    /// The cell at these values of y and x.
    fn cell(&self, place: &[f64; 2], confirmations: usize) -> Result<MapCell, SweepError> {
        let (scene, sigma, numbers) = self.sweep.at(place)?;
        let (periods, start) = (self.sweep.settings().periods, scene.dimensionless_start());
        let (mut result, coexisting_regime) = observe_confirmed(&numbers, sigma, start, periods, confirmations)?;
        let mut coexisting = Vec::new();
        if let Some(coexisting_regime) = coexisting_regime {
            coexisting.extend([result.regime, coexisting_regime]);
            coexisting.sort();
            result.regime = Regime::Undecided;
        }
        Ok(MapCell {
            sigma,
            g: numbers.g,
            r: numbers.r,
            result,
            theory_stable: SlowFlow::new(numbers.lambda, numbers.r).has_stable_motion(numbers.g, sigma),
            coexisting,
        })
    }

    fn bifurcations(&self) -> Vec<BifurcationCurve> {
        let [x, y] = self.names();
        let (sigma, g) = match [x, y] {
            [SIGMA, "G"] => (self.x, self.y),
            ["G", SIGMA] => (self.y, self.x),
            _ => return Vec::new(),
        };
        let limits = ContinuationLimits {
            sigma: [sigma.from, sigma.to],
            g: [g.from, g.to],
            ..ContinuationLimits::default()
        };
        bifurcation_curves(&self.sweep.scene().dimensionless(), &limits)
    }

    /// The axes, horizontal first.
    #[must_use]
    pub fn axes(&self) -> [&Axis; 2] {
        [1, 0].map(|n| &self.sweep.settings().axes[n])
    }

    /// Names of the axes, horizontal first: sigma, G, r, or a key of the scene.
    #[must_use]
    pub fn names(&self) -> [&str; 2] {
        self.axes().map(Axis::short_name)
    }

    /// First-order theory has a stable symmetric 1:1 motion at a point of the plane.
    #[must_use]
    pub fn theory_stable(&self, x: f64, y: f64) -> bool {
        self.sweep.at(&[y, x]).is_ok_and(|(_, sigma, numbers)| {
            SlowFlow::new(numbers.lambda, numbers.r).has_stable_motion(numbers.g, sigma)
        })
    }

    /// How many cells show a regime, and how many of them lie where theory has a stable 1:1 motion.
    #[must_use]
    pub fn count(&self, regime: Regime) -> (usize, usize) {
        let cells = || self.cells.iter().filter(|cell| cell.result.regime == regime);
        (cells().count(), cells().filter(|cell| cell.theory_stable).count())
    }
}
