//! A regime map: cells over two grids, with the bifurcation curves of the 1:1 motions.

use std::fmt::{self, Display, Formatter};
use std::str::FromStr;

use rayon::prelude::*;

use crate::ArgumentError;
use crate::cells::{Cell, CellError, Cells, SIGMA};
use crate::map::{RegimeResult, observe_confirmed};
use crate::orbit::{BifurcationCurve, ContinuationLimits, bifurcation_curves};
use crate::regime::Regime;
use crate::scene::{Dimensionless, Family};
use crate::theory::SlowFlow;

/// Most values of an axis: all cells are in memory, 200 bytes each, and in one figure.
const MOST_AXIS_VALUES: u64 = 2000;

/// Short names of two keys: the numbers of the theory, both dimensionless.
const SHORT_NAMES: [(&str, &str); 2] = [("G", "excitation.G"), ("r", "plant.r")];

/// A number of the scene, or sigma, with values at equal distances. Parse it from `plant.r=0.3:1:71`: first, last, and how many.
#[derive(Debug, Clone, PartialEq)]
pub struct Axis {
    /// `section.key` of a scene, or `sigma`. In text, `G` and `r` stand for `excitation.G` and `plant.r`.
    key: String,
    /// First value.
    pub from: f64,
    /// Last value.
    pub to: f64,
    /// Number of values.
    pub points: u64,
}

impl Axis {
    /// The n-th value.
    pub fn at(&self, n: u64) -> f64 {
        self.from + self.step() * n as f64
    }

    /// Distance of two neighbouring values.
    pub fn step(&self) -> f64 {
        (self.to - self.from) / (self.points - 1) as f64
    }

    /// The name: short where there is a short one.
    pub fn name(&self) -> &str {
        let short = SHORT_NAMES.iter().find(|(_, key)| *key == self.key);
        short.map_or(&self.key, |(short, _)| short)
    }
}

impl Display for Axis {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        write!(f, "{}={}:{}:{}", self.name(), self.from, self.to, self.points)
    }
}

impl FromStr for Axis {
    type Err = ArgumentError;

    fn from_str(text: &str) -> Result<Self, ArgumentError> {
        let form = "expected KEY=FIRST:LAST:POINTS, for instance plant.r=0.3:1:71";
        let (name, values) = text.split_once('=').ok_or(form)?;
        let parts: Vec<&str> = values.split(':').map(str::trim).collect();
        let [from, to, points] = parts[..] else {
            return Err(form.into());
        };
        let number = |text: &str| match text.parse::<f64>() {
            Ok(number) if number.is_finite() => Ok(number),
            _ => Err(format!("`{text}` is not a finite number; {form}")),
        };
        let (name, from, to) = (name.trim(), number(from)?, number(to)?);
        let count = points
            .parse()
            .ok()
            .filter(|points| (2..=MOST_AXIS_VALUES).contains(points));
        let points = count.ok_or_else(|| {
            format!("`{points}` points: a whole number from 2 to {MOST_AXIS_VALUES} is allowed; {form}")
        })?;
        if from >= to {
            return Err(format!("{name} from {from} to {to}: the first must be below the last").into());
        }
        let key = SHORT_NAMES
            .iter()
            .find(|(short, _)| *short == name)
            .map_or(name, |(_, key)| key);
        Ok(Self { key: key.into(), from, to, points })
    }
}

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
    /// What the cells have in common.
    pub common: Cells,
    /// Horizontal axis.
    pub x: Axis,
    /// Vertical axis.
    pub y: Axis,
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
    pub fn new(family: Family, x: &Axis, y: &Axis, sigma: Option<f64>, periods: usize) -> Result<Self, CellError> {
        let map = Self {
            common: Cells::new(family, &[x, y].map(|axis| axis.key.clone()), sigma, periods)?,
            x: x.clone(),
            y: y.clone(),
            cells: Vec::new(),
            curves: Vec::new(),
        };
        let at = |x, y| map.inputs(&[x, y]);
        let [[a, b], [c, d]] = [
            [at(x.from, y.from)?, at(x.to, y.from)?],
            [at(x.from, y.to)?, at(x.to, y.to)?],
        ];
        for (axis, is_constant) in [(x, a == b && c == d), (y, a == c && b == d)] {
            if is_constant {
                return Err(CellError::WithoutEffect(axis.key.clone()));
            }
        }
        Ok(map)
    }

    /// Number of cells.
    pub fn size(&self) -> u64 {
        self.x.points * self.y.points
    }

    /// Computes all cells on all cores; calls `done` after each. `confirmations` motions from starts close by must lead to the same
    /// regime where chance decides when chaos ends.
    pub fn run(&mut self, confirmations: usize, done: impl Fn() + Sync) -> Result<(), CellError> {
        let cells = (0..self.size()).into_par_iter().map(|n| {
            let place = [self.x.at(n % self.x.points), self.y.at(n / self.x.points)];
            let cell = self.cell(&place, confirmations);
            done();
            cell
        });
        self.cells = cells.collect::<Result<_, _>>()?;
        self.curves = self.bifurcations();
        Ok(())
    }

    /// What the cell at these values of x and y depends on: its numbers, without units of length and frequency, detuning and start.
    fn inputs(&self, place: &[f64; 2]) -> Result<(Dimensionless, f64, [f64; 4]), CellError> {
        let Cell { scene, sigma, numbers } = self.common.at(place)?;
        let numbers = Dimensionless { omega0: 1.0, b: 1.0, ..numbers };
        Ok((numbers, sigma, scene.dimensionless_start()))
    }

    /// The cell at these values of x and y.
    fn cell(&self, place: &[f64; 2], confirmations: usize) -> Result<MapCell, CellError> {
        let (numbers, sigma, start) = self.inputs(place)?;
        let (mut result, differing) = observe_confirmed(&numbers, sigma, start, self.common.periods, confirmations)?;
        let mut coexisting = Vec::new();
        if let Some(regime) = differing {
            coexisting.extend([result.regime, regime]);
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
        let (sigma, g) = match self.names() {
            [SIGMA, "G"] => (&self.x, &self.y),
            ["G", SIGMA] => (&self.y, &self.x),
            _ => return Vec::new(),
        };
        let limits = ContinuationLimits {
            sigma: [sigma.from, sigma.to],
            g: [g.from, g.to],
            ..ContinuationLimits::default()
        };
        bifurcation_curves(&self.common.scene.dimensionless(), &limits)
    }

    /// Names of the axes, horizontal first: sigma, G, r, or a key of the scene.
    pub fn names(&self) -> [&str; 2] {
        [self.x.name(), self.y.name()]
    }

    /// First-order theory has a stable symmetric 1:1 motion at a point of the plane.
    pub fn theory_stable(&self, x: f64, y: f64) -> bool {
        self.common.at(&[x, y]).is_ok_and(|Cell { sigma, numbers, .. }| {
            SlowFlow::new(numbers.lambda, numbers.r).has_stable_motion(numbers.g, sigma)
        })
    }

    /// How many cells show a regime, and how many of them lie where theory has a stable 1:1 motion.
    pub fn count(&self, regime: Regime) -> (usize, usize) {
        let cells = || self.cells.iter().filter(|cell| cell.result.regime == regime);
        (cells().count(), cells().filter(|cell| cell.theory_stable).count())
    }
}
