//! A sweep: its settings, its cells in their order, and the chunks of its store.

use serde_json::{Value, json};
use vines_model::{Dimensionless, orbit::stable_resonant};
use vines_testbench::scene::{Family, Scene, SceneError};

use crate::{
    axis::{Axis, SIGMA, Values},
    cell::{Cell, Results, variables},
    monitor::Monitor,
};

/// Settings of a sweep besides its scene.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// The axes; those with one value per sample share one dimension, the last.
    pub axes: Vec<Axis>,
    /// Detuning, if it is not an axis. Default: the detuning of the scene's stable phase-resonant orbit, or 0.
    pub sigma: Option<f64>,
    /// Number of samples of random axes; paired values have their own.
    pub samples: Option<u64>,
    /// Seed of random axes.
    pub seed: u64,
    /// Largest number of periods that a cell is followed.
    pub periods: usize,
    /// What is computed.
    pub results: Results,
    /// Largest number of cells in a chunk of the store.
    pub chunk: u64,
    /// Only the regime is computed, at first in cells so far apart, and then where neighbours differ; two grids.
    pub adaptive: Option<u64>,
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
            adaptive: None,
        }
    }
}

/// Why a sweep cannot be made.
#[derive(Debug, thiserror::Error)]
pub enum SweepError {
    /// The scene refuses its values or an axis.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The plant refuses its values.
    #[error(transparent)]
    Plant(#[from] lovines::InvalidValue),
    /// A setting that is not allowed.
    #[error("{0}")]
    Setting(String),
}

fn refused<T>(message: impl Into<String>) -> Result<T, SweepError> {
    Err(SweepError::Setting(message.into()))
}

/// Most cells of an adaptive sweep: all their regimes are in memory, two bytes per cell.
const ADAPTIVE: u64 = 1_000_000_000;
/// Most cells of a chunk: all their results are in memory, half a kilobyte per cell.
const CHUNK: u64 = 1_000_000;
/// Most cells: their number must be countable in the metadata of the store.
const MOST: u64 = 1 << 53;
/// Most samples.
const SAMPLES: u64 = 1 << 32;

/// The dimension that paired and random axes share.
const SAMPLE: &str = "sample";

impl Settings {
    /// Whether there is an axis with this name.
    fn has(&self, name: &str) -> bool {
        self.axes.iter().any(|axis| axis.name == name)
    }

    fn check(&self) -> Result<(), SweepError> {
        let (axes, most) = (&self.axes, u32::MAX as usize / 8);
        let again = (1..axes.len()).find(|n| axes[..*n].iter().any(|axis| axis.name == axes[*n].name));
        refused(if axes.is_empty() {
            "a sweep needs at least one axis, for instance plant.r=0.3:1:71".into()
        } else if let Some(n) = again {
            format!("axis {} is {} again", n + 1, axes[n].name)
        } else if self.sigma.is_some() && self.has(SIGMA) {
            "sigma is an axis and a constant: give one of them".into()
        } else if let Some(sigma) = self.sigma.filter(|sigma| !sigma.is_finite()) {
            format!("sigma = {sigma} (dimensionless) is not a finite number")
        } else if !(100..=most).contains(&self.periods) {
            format!("{} periods: from 100 to {most} are allowed", self.periods)
        } else if !(1..=CHUNK).contains(&self.chunk) {
            let cells = self.chunk;
            format!("a chunk of {cells} cells: from 1 to {CHUNK} are allowed, which must be in memory")
        } else if let Some(stride) = self.adaptive {
            let points: Option<Vec<u64>> = axes.iter().map(Axis::points).collect();
            match points.as_deref() {
                _ if !stride.is_power_of_two() || !(2..=64).contains(&stride) => {
                    format!("adaptive refinement from every {stride}-th cell: 2, 4, 8, 16, 32 or 64 are allowed")
                }
                Some([rows, columns]) if rows.checked_mul(*columns).is_none_or(|cells| cells > ADAPTIVE) => {
                    format!("adaptive refinement of more than {ADAPTIVE} cells, which must be in memory")
                }
                Some([_, _]) if self.results != Results::default() => {
                    "adaptive refinement has the regime only: leave out other results".into()
                }
                Some([_, _]) => return Ok(()),
                _ => "adaptive refinement needs exactly two axes, each a grid or a list".into(),
            }
        } else {
            return Ok(());
        })
    }

    /// Names and lengths of the dimensions.
    fn dimensions(&self) -> Result<(Vec<String>, Vec<u64>), SweepError> {
        let own = |axis: &Axis| Some((axis.name.clone(), axis.points()?));
        let (mut names, mut shape): (Vec<String>, Vec<u64>) = self.axes.iter().filter_map(own).unzip();
        let lengths = self.axes.iter().filter_map(|axis| match &axis.values {
            Values::Paired(list) => Some((&axis.name, list.len() as u64)),
            _ => None,
        });
        let paired: Vec<(&String, u64)> = lengths.collect();
        if let Some([(first, length), (other, second)]) =
            paired.array_windows().find(|[first, second]| first.1 != second.1)
        {
            return refused(format!(
                "{first} has {length} paired values and {other} has {second}: paired values belong together, one per sample"
            ));
        }
        let sampled = names.len() < self.axes.len();
        match (self.samples, paired.first()) {
            (Some(_), _) if !sampled => return refused("a number of samples needs a random axis"),
            (None, None) if sampled => {
                return refused("random axes need a number of samples (--samples N, in Python samples=N)");
            }
            (Some(samples), Some((name, length))) if samples != *length => {
                return refused(format!(
                    "{length} paired values of {name} are {length} samples: leave out another number"
                ));
            }
            _ => {}
        }
        if let Some(samples) = self.samples.or(paired.first().map(|(_, length)| *length)) {
            if !(2..=SAMPLES).contains(&samples) {
                return refused(format!("{samples} samples: from 2 to {SAMPLES} are allowed"));
            }
            names.push(SAMPLE.into());
            shape.push(samples);
        }
        let cells = shape
            .iter()
            .try_fold(1_u64, |product, length| product.checked_mul(*length));
        if cells.is_none_or(|cells| cells > MOST) {
            return refused("more than 2^53 cells: take fewer values");
        }
        Ok((names, shape))
    }
}

/// A checked sweep.
#[derive(Debug)]
pub struct Sweep {
    family: Family,
    settings: Settings,
    scene: Scene,
    sigma: f64,
    /// Names of the dimensions, their lengths, and the lengths of a chunk.
    pub(crate) dimensions: Vec<String>,
    pub(crate) shape: Vec<u64>,
    pub(crate) chunk: Vec<u64>,
}

impl Sweep {
    /// Checks a sweep over numbers of `family`.
    ///
    /// # Errors
    /// An axis that the scene does not have, or a setting that is not allowed.
    pub fn new(mut family: Family, settings: Settings) -> Result<Self, SweepError> {
        let scene = family.scene(&[])?;
        settings.check()?;
        for axis in settings.axes.iter().filter(|axis| axis.name != SIGMA) {
            family.vary(&axis.name)?;
        }
        let (dimensions, shape) = settings.dimensions()?;
        let (mut chunk, mut left) = (shape.clone(), settings.chunk);
        for length in chunk.iter_mut().rev() {
            *length = left.min(*length);
            left = (left / *length).max(1);
        }
        let resonant = || stable_resonant(&scene.dimensionless()).map_or(0.0, |orbit| orbit.sigma);
        let sigma = match settings.sigma {
            Some(sigma) => sigma,
            None if settings.has(SIGMA) => 0.0,
            None => resonant(),
        };
        Ok(Self { family, settings, scene, sigma, dimensions, shape, chunk })
    }

    /// The scene without the values of the axes.
    #[must_use]
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// The detuning, unless it is an axis.
    #[must_use]
    pub fn sigma(&self) -> Option<f64> {
        (!self.settings.has(SIGMA)).then_some(self.sigma)
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
        self.chunk_grid().iter().product()
    }

    /// Bytes of the store before compression.
    #[must_use]
    pub fn bytes(&self) -> f64 {
        let coordinates: u64 = self.coordinates().map(|(_, dimension, _)| self.shape[dimension]).sum();
        self.variables().count() as f64 * 7.0 * self.cells() as f64 + 8.0 * coordinates as f64
    }

    pub(crate) fn variables(&self) -> impl Iterator<Item = crate::cell::Variable> {
        variables(&self.settings.results, self.settings.adaptive.is_some())
    }

    /// Number of chunks along each dimension.
    fn chunk_grid(&self) -> Vec<u64> {
        let lengths = self.shape.iter().zip(&self.chunk);
        lengths.map(|(length, part)| length.div_ceil(*part)).collect()
    }

    /// Index of the n-th chunk.
    pub(crate) fn chunk_index(&self, n: u64) -> Vec<u64> {
        position(n, &self.chunk_grid())
    }

    /// Number of cells of a chunk, with those outside the sweep at its border.
    pub(crate) fn chunk_size(&self) -> u64 {
        self.chunk.iter().product()
    }

    /// Indices of the n-th cell of a chunk; None outside the sweep.
    pub(crate) fn chunk_cell(&self, index: &[u64], n: u64) -> Option<Vec<u64>> {
        let inside = position(n, &self.chunk);
        let chunks = index.iter().zip(&self.chunk).zip(&self.shape);
        let cell = inside.into_iter().zip(chunks);
        cell.map(|(n, ((chunk, part), length))| Some(chunk * part + n).filter(|n| n < length))
            .collect()
    }

    /// Number of cells of a chunk that lie inside the sweep.
    pub(crate) fn chunk_count(&self, index: &[u64]) -> u64 {
        let lengths = index.iter().zip(&self.chunk).zip(&self.shape);
        lengths
            .map(|((n, part), length)| (*part).min(length - n * part))
            .product()
    }

    /// The axes with their dimensions and values.
    pub(crate) fn coordinates(&self) -> impl Iterator<Item = (&Axis, usize, impl Fn(u64) -> f64)> {
        let (mut streams, seed) = (0.., self.settings.seed);
        self.settings.axes.iter().map(move |axis| {
            let name = axis.points().map_or(SAMPLE, |_| axis.name.as_str());
            let dimension = self
                .dimensions
                .iter()
                .position(|dimension| dimension == name)
                .unwrap_or(0);
            let is_random = matches!(axis.values, Values::Random(_));
            let stream = if is_random { streams.next() } else { None };
            let value = move |n| axis.at(n, seed, stream.unwrap_or_default());
            (axis, dimension, value)
        })
    }

    /// Scene, detuning and dimensionless numbers where the axes have these values, one per axis.
    ///
    /// # Errors
    /// A value that the scene refuses, or a frequency that is not positive.
    pub(crate) fn at(&self, values: &[f64]) -> Result<(Scene, f64, Dimensionless), SweepError> {
        let (mut sigma, mut g) = (self.sigma, None);
        let mut of_scene = Vec::with_capacity(values.len());
        for (axis, value) in self.settings.axes.iter().zip(values) {
            match axis.name.as_str() {
                SIGMA => sigma = *value,
                name => {
                    of_scene.push(*value);
                    // The base amplitude that a scene keeps instead of G rounds it.
                    g = (name == "excitation.G").then_some(*value).or(g);
                }
            }
        }
        let scene = self.family.scene(&of_scene)?;
        let mut numbers = scene.dimensionless();
        numbers.g = g.unwrap_or(numbers.g);
        let omega = 1.0 + numbers.epsilon * sigma;
        if omega <= 0.0 {
            return refused(format!(
                "sigma = {sigma} (dimensionless) gives the frequency {omega} omega0, which must be above 0"
            ));
        }
        Ok((scene, sigma, numbers))
    }

    /// Computes the cell with these indices.
    pub(crate) fn cell(&self, index: &[u64]) -> Cell {
        let coordinates = self.coordinates();
        let values: Vec<f64> = coordinates.map(|(_, dimension, at)| at(index[dimension])).collect();
        let Settings { results, periods, .. } = &self.settings;
        let computed = self
            .at(&values)
            .and_then(|(scene, sigma, numbers)| Ok(Cell::compute(&scene, sigma, &numbers, results, *periods)?));
        computed.unwrap_or_else(|error| Cell { failure: error.to_string(), ..Cell::default() })
    }

    /// Computes and counts the cell with these indices; None if the monitor has stopped the sweep.
    pub(crate) fn counted_cell(&self, index: &[u64], monitor: &Monitor) -> Option<Cell> {
        let cell = (!monitor.stopped()).then(|| self.cell(index));
        cell.inspect(|cell| monitor.note(cell))
    }

    /// Index of the n-th cell.
    pub(crate) fn cell_index(&self, n: u64) -> Vec<u64> {
        position(n, &self.shape)
    }

    /// All that determines the cells, as it is written to the store.
    pub(crate) fn description(&self) -> Value {
        let axes: Vec<String> = self.settings.axes.iter().map(Axis::to_string).collect();
        let scene = serde_json::to_value(&self.scene).unwrap_or_default();
        let mut description = json!({
            "version": env!("CARGO_PKG_VERSION"),
            "scene": scene,
            "sigma": self.sigma(),
            "axes": axes,
            "samples": self.settings.samples,
            "seed": self.settings.seed,
            "periods": self.settings.periods,
            "results": self.settings.results.names(),
            "chunk": self.chunk,
            "adaptive": self.settings.adaptive,
        });
        if let Some(left_out) = self.scene.left_out() {
            description["left_out_of_regime_response_orbits"] = left_out.into();
        }
        description
    }
}

/// Indices of the n-th element of an array, the last index fastest.
fn position(mut n: u64, shape: &[u64]) -> Vec<u64> {
    let mut index = shape.to_vec();
    for place in index.iter_mut().rev() {
        (*place, n) = (n % *place, n / *place);
    }
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
    pub fn cells(self, sweep: &Sweep) -> u64 {
        self.chunks(sweep).map(|index| sweep.chunk_count(&index)).sum()
    }

    /// The indices of its chunks.
    pub(crate) fn chunks(self, sweep: &Sweep) -> impl Iterator<Item = Vec<u64>> + Send {
        let all = self.number..sweep.chunks();
        all.step_by(self.of as usize).map(|n| sweep.chunk_index(n))
    }
}
