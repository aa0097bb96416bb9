//! What a sweep computes: its cells in their order.

use serde_json::{Value, json};
use vines_model::orbit::phase_resonant;
use vines_testbench::scene::{Family, Scene, SceneError};

use crate::{
    axis::{Axis, SIGMA, Sequence},
    cell::{Cell, Results, compute, variables},
    sobol,
};

/// Settings of a sweep besides its scene.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// The axes; those with one value per sample share one dimension, the last.
    pub axes: Vec<Axis>,
    /// Detuning, if it is not an axis. Without it: that of the scene's stable phase-resonant orbit, or 0.
    pub sigma: Option<f64>,
    /// Number of samples of random and Sobol axes.
    pub samples: Option<u64>,
    /// Seed of random axes.
    pub seed: u64,
    /// Largest number of periods that a cell is followed.
    pub periods: usize,
    /// What is computed.
    pub results: Results,
    /// Largest number of cells in a chunk of the store.
    pub chunk: u64,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            axes: Vec::new(),
            sigma: None,
            samples: None,
            seed: 0,
            periods: vines_model::map::LIMIT,
            results: Results::default(),
            chunk: 4096,
        }
    }
}

/// Why a sweep cannot be made.
#[derive(Debug, thiserror::Error)]
pub enum PlanError {
    /// The scene refuses its values or an axis.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// A setting that is not allowed.
    #[error("{0}")]
    Setting(String),
}

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

/// Most cells: their number must be countable in the metadata of the store.
const MOST: u64 = 1 << 53;
/// Number of points of a Sobol sequence.
const SOBOL: u64 = 1 << 32;

/// The dimension that random and Sobol axes share.
const SAMPLE: &str = "sample";

impl Plan {
    /// Checks a sweep over numbers of `family`.
    ///
    /// # Errors
    /// An axis that the scene does not have, or a setting that is not allowed.
    pub fn new(mut family: Family, settings: Settings) -> Result<Self, PlanError> {
        let refused = |message: String| Err(PlanError::Setting(message));
        let scene = family.scene(&[])?;
        let axes = &settings.axes;
        if axes.is_empty() {
            return refused("a sweep needs at least one axis, for instance plant.r=0.3:1:71".into());
        }
        if let Some((n, axis)) = axes
            .iter()
            .enumerate()
            .find(|(n, axis)| axes[..*n].iter().any(|one| one.name == axis.name))
        {
            return refused(format!("axis {} is {} again", n + 1, axis.name));
        }
        for axis in axes.iter().filter(|axis| axis.name != SIGMA) {
            family.vary(&axis.name)?;
        }
        if settings.sigma.is_some() && axes.iter().any(|axis| axis.name == SIGMA) {
            return refused("sigma is an axis and a constant: give one of them".into());
        }
        if let Some(sigma) = settings.sigma.filter(|sigma| !sigma.is_finite()) {
            return refused(format!("sigma = {sigma} (dimensionless) is not a finite number"));
        }
        if !(100..=u32::MAX as usize / 8).contains(&settings.periods) {
            return refused(format!(
                "{} periods: from 100 to {} are allowed",
                settings.periods,
                u32::MAX / 8
            ));
        }
        if settings.chunk == 0 {
            return refused("a chunk of 0 cells: at least 1 is needed".into());
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
        let sequences = axes
            .iter()
            .map(|axis| {
                let sequence = Sequence::new(axis, settings.seed, sampled);
                sampled += usize::from(axis.points().is_none());
                sequence
            })
            .collect();
        let sigma = settings.sigma.unwrap_or_else(|| {
            let orbits = phase_resonant(&scene.dimensionless());
            orbits
                .iter()
                .find(|orbit| orbit.stable)
                .map_or(0.0, |orbit| orbit.sigma)
        });
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

    /// Bytes of the store before compression, without coordinates.
    #[must_use]
    pub fn bytes(&self) -> f64 {
        variables(self.settings.results).count() as f64 * 7.0 * self.cells() as f64
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
    fn cell_index(&self, chunk: &[u64], n: u64) -> Option<Vec<u64>> {
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
        let Some(index) = self.cell_index(chunk, n) else {
            return Cell::default();
        };
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
        })
    }
}

/// Names and lengths of the dimensions.
fn dimensions(settings: &Settings) -> Result<(Vec<String>, Vec<u64>), PlanError> {
    let refused = |message: String| Err(PlanError::Setting(message));
    let own = || {
        settings
            .axes
            .iter()
            .filter_map(|axis| axis.points().map(|points| (axis.name.clone(), points)))
    };
    let (mut names, mut shape): (Vec<String>, Vec<u64>) = own().unzip();
    let sampled = settings.axes.len() - names.len();
    match settings.samples {
        None if sampled > 0 => return refused("random and Sobol axes need a number of samples: --samples N".into()),
        Some(_) if sampled == 0 => return refused("--samples needs a random or Sobol axis".into()),
        Some(samples) if !(2..=SOBOL).contains(&samples) => {
            return refused(format!("{samples} samples: from 2 to {SOBOL} are allowed"));
        }
        Some(samples) => {
            names.push(SAMPLE.into());
            shape.push(samples);
        }
        None => {}
    }
    if sampled > sobol::MOST {
        return refused(format!(
            "{sampled} random and Sobol axes: at most {} are allowed",
            sobol::MOST
        ));
    }
    let cells = shape
        .iter()
        .try_fold(1_u64, |product, length| product.checked_mul(*length));
    if cells.is_none_or(|cells| cells > MOST) {
        return refused("more than 2^53 cells: take fewer values".into());
    }
    Ok((names, shape))
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
