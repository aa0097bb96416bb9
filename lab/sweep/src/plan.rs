//! What a sweep computes: its cells in their order.

use serde_json::{Value, json};
use vines_model::orbit::stable_resonant;
use vines_testbench::scene::{Family, Scene};

use crate::{
    axis::{Axis, SIGMA, Sequence},
    cell::{Cell, compute},
    settings::{PlanError, SAMPLE, Settings, dimensions},
    variables::variables,
};

/// A checked sweep.
#[derive(Debug)]
pub struct Plan {
    family: Family,
    settings: Settings,
    sequences: Vec<Sequence>,
    scene: Scene,
    sigma: f64,
    /// Names of the dimensions, their lengths, and those of a chunk.
    pub(crate) dimensions: Vec<String>,
    pub(crate) shape: Vec<u64>,
    pub(crate) chunk: Vec<u64>,
}

impl Plan {
    /// Checks a sweep over numbers of `family`.
    ///
    /// # Errors
    /// An axis that the scene does not have, or a setting that is not allowed.
    pub fn new(mut family: Family, settings: Settings) -> Result<Self, PlanError> {
        let scene = family.scene(&[])?;
        settings.check()?;
        for axis in settings.axes.iter().filter(|axis| axis.name != SIGMA) {
            family.vary(&axis.name)?;
        }
        let (dimensions, shape) = dimensions(&settings)?;
        let mut left = settings.chunk;
        let mut chunk: Vec<u64> = shape
            .iter()
            .rev()
            .map(|length| {
                let part = left.min(*length);
                left = (left / part).max(1);
                part
            })
            .collect();
        chunk.reverse();
        let mut sampled = 0;
        let sequences = settings
            .axes
            .iter()
            .map(|axis| {
                let sequence = Sequence::new(axis, settings.seed, sampled);
                sampled += usize::from(axis.points().is_none() && axis.paired().is_none());
                sequence
            })
            .collect();
        let resonant = || stable_resonant(&scene.dimensionless()).map_or(0.0, |orbit| orbit.sigma);
        let detuned = settings.axes.iter().any(|axis| axis.name == SIGMA);
        let sigma = if detuned {
            0.0
        } else {
            settings.sigma.unwrap_or_else(resonant)
        };
        Ok(Self {
            family,
            settings,
            sequences,
            scene,
            sigma,
            dimensions,
            shape,
            chunk,
        })
    }

    /// The settings.
    #[must_use]
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Number of cells.
    #[must_use]
    pub fn cells(&self) -> u64 {
        self.shape.iter().product()
    }

    /// Number of chunks.
    #[must_use]
    pub fn chunks(&self) -> u64 {
        self.grid().iter().product()
    }

    /// Bytes of the store before compression.
    #[must_use]
    pub fn bytes(&self) -> f64 {
        let coordinates: u64 = self.coordinates().map(|(.., dimension)| self.shape[dimension]).sum();
        variables(&self.settings).count() as f64 * 7.0 * self.cells() as f64 + 8.0 * coordinates as f64
    }

    /// Number of chunks along each dimension.
    fn grid(&self) -> Vec<u64> {
        self.shape
            .iter()
            .zip(&self.chunk)
            .map(|(length, part)| length.div_ceil(*part))
            .collect()
    }

    /// Index of the n-th chunk.
    pub(crate) fn chunk_index(&self, n: u64) -> Vec<u64> {
        position(n, &self.grid())
    }

    /// Number of cells of a chunk that lie inside the sweep.
    pub(crate) fn chunk_cells(&self, index: &[u64]) -> u64 {
        index
            .iter()
            .zip(&self.chunk)
            .zip(&self.shape)
            .map(|((n, part), length)| (*part).min(length - n * part))
            .product()
    }

    /// Number of cells of a chunk, with those outside the sweep at its border.
    pub(crate) fn chunk_size(&self) -> usize {
        self.chunk.iter().product::<u64>() as usize
    }

    /// Indices of the n-th cell of a chunk; None outside the sweep.
    pub(crate) fn cell_index(&self, chunk: &[u64], n: u64) -> Option<Vec<u64>> {
        let mut index = position(n, &self.chunk);
        for (one, (chunk, part)) in index.iter_mut().zip(chunk.iter().zip(&self.chunk)) {
            *one += chunk * part;
        }
        index
            .iter()
            .zip(&self.shape)
            .all(|(one, length)| one < length)
            .then_some(index)
    }

    /// The axes with their dimensions.
    pub(crate) fn coordinates(&self) -> impl Iterator<Item = (&Axis, &Sequence, usize)> {
        let axes = self.settings.axes.iter().zip(&self.sequences);
        axes.map(|(axis, sequence)| {
            let name = if axis.points().is_some() {
                axis.name.as_str()
            } else {
                SAMPLE
            };
            let dimension = self.dimensions.iter().position(|one| one == name).unwrap_or(0);
            (axis, sequence, dimension)
        })
    }

    /// Computes the n-th cell of a chunk; outside the sweep it is empty.
    pub(crate) fn cell(&self, chunk: &[u64], n: u64) -> Cell {
        self.cell_index(chunk, n)
            .map_or_else(Cell::default, |index| self.cell_at(&index))
    }

    /// Computes the cell with these indices.
    pub(crate) fn cell_at(&self, index: &[u64]) -> Cell {
        let (mut sigma, mut g) = (self.sigma, None);
        let mut values = Vec::with_capacity(self.sequences.len());
        for (axis, sequence, dimension) in self.coordinates() {
            let value = sequence.at(index[dimension]);
            if axis.name == SIGMA {
                sigma = value;
                continue;
            }
            values.push(value);
            if axis.name == "excitation.G" {
                g = Some(value);
            }
        }
        match self.family.scene(&values) {
            Ok(scene) => compute(&scene, sigma, g, self.settings.periods, self.settings.results),
            Err(error) => Cell::failed(error.to_string()),
        }
    }

    /// The cell at a relative position in the sweep, from 0 to 1.
    pub(crate) fn cell_near(&self, position: f64) -> Cell {
        let chunk = self.chunk_index(((self.chunks() - 1) as f64 * position) as u64);
        let inside = (0..self.chunk_size() as u64)
            .rev()
            .find(|n| self.cell_index(&chunk, *n).is_some());
        self.cell(&chunk, (inside.unwrap_or(0) as f64 * position) as u64)
    }

    /// All that determines the cells, as it is written to the store.
    pub(crate) fn description(&self) -> Value {
        let axes: Vec<String> = self.settings.axes.iter().map(Axis::to_string).collect();
        let scene = serde_json::to_value(&self.scene).unwrap_or_default();
        json!({
            "version": env!("CARGO_PKG_VERSION"),
            "scene": scene,
            "sigma": self.settings.axes.iter().all(|axis| axis.name != SIGMA).then_some(self.sigma),
            "axes": axes,
            "samples": self.settings.samples,
            "seed": self.settings.seed,
            "periods": self.settings.periods,
            "results": self.settings.results.names(),
            "chunk": self.chunk,
            "adaptive": self.settings.adaptive,
        })
    }
}

/// Indices of the n-th element of an array, the last index fastest.
fn position(mut n: u64, shape: &[u64]) -> Vec<u64> {
    let mut index: Vec<u64> = shape
        .iter()
        .rev()
        .map(|length| {
            let one = n % length;
            n /= length;
            one
        })
        .collect();
    index.reverse();
    index
}

/// The part of a sweep that one process computes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shard {
    /// Number of this part, from 0.
    pub number: u64,
    /// Number of parts.
    pub of: u64,
}

impl Shard {
    /// The whole sweep.
    pub const ALL: Self = Self { number: 0, of: 1 };

    /// Number of its cells.
    #[must_use]
    pub fn cells(self, plan: &Plan) -> u64 {
        self.chunks(plan).map(|n| plan.chunk_cells(&plan.chunk_index(n))).sum()
    }

    /// Its chunks.
    pub(crate) fn chunks(self, plan: &Plan) -> impl Iterator<Item = u64> + Send {
        (self.number..plan.chunks()).step_by(self.of as usize)
    }
}
