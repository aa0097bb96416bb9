//! Settings of a sweep, checked.

use vines_testbench::scene::SceneError;

use crate::{
    axis::{Axis, SIGMA},
    cell::Results,
};

/// Settings of a sweep besides its scene.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// The axes; those with one value per sample share one dimension, the last.
    pub axes: Vec<Axis>,
    /// Detuning, if it is not an axis. Without it: that of the scene's stable phase-resonant orbit, or 0.
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

impl Settings {
    pub(crate) fn check(&self) -> Result<(), PlanError> {
        let refused = |message: String| Err(PlanError::Setting(message));
        let axes = &self.axes;
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
        if self.sigma.is_some() && axes.iter().any(|axis| axis.name == SIGMA) {
            return refused("sigma is an axis and a constant: give one of them".into());
        }
        if let Some(sigma) = self.sigma.filter(|sigma| !sigma.is_finite()) {
            return refused(format!("sigma = {sigma} (dimensionless) is not a finite number"));
        }
        if !(100..=u32::MAX as usize / 8).contains(&self.periods) {
            return refused(format!(
                "{} periods: from 100 to {} are allowed",
                self.periods,
                u32::MAX / 8
            ));
        }
        if !(1..=CHUNK).contains(&self.chunk) {
            return refused(format!(
                "a chunk of {} cells: from 1 to {CHUNK} are allowed, which must be in memory",
                self.chunk
            ));
        }
        self.adaptive.map_or(Ok(()), |stride| self.check_adaptive(stride))
    }

    fn check_adaptive(&self, stride: u64) -> Result<(), PlanError> {
        let refused = |message: String| Err(PlanError::Setting(message));
        if !stride.is_power_of_two() || !(2..=64).contains(&stride) {
            return refused(format!(
                "adaptive refinement from every {stride}-th cell: 2, 4, 8, 16, 32 or 64 are allowed"
            ));
        }
        let points: Vec<u64> = self.axes.iter().filter_map(Axis::points).collect();
        if points.len() != 2 || self.axes.len() != 2 {
            return refused("adaptive refinement needs exactly two axes, each a grid or a list".into());
        }
        if points[0].checked_mul(points[1]).is_none_or(|cells| cells > ADAPTIVE) {
            return refused(format!(
                "adaptive refinement of more than {} cells, which must be in memory",
                ADAPTIVE
            ));
        }
        if self.results != Results::default() {
            return refused("adaptive refinement has the regime only: leave out other results".into());
        }
        Ok(())
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

/// Most cells of an adaptive sweep: all their regimes are in memory, two bytes per cell.
const ADAPTIVE: u64 = 1_000_000_000;
/// Most cells of a chunk: all their results are in memory, half a kilobyte per cell.
const CHUNK: u64 = 1_000_000;
/// Most cells: their number must be countable in the metadata of the store.
const MOST: u64 = 1 << 53;
/// Most samples.
const SAMPLES: u64 = 1 << 32;

/// The dimension that paired and random axes share.
pub(crate) const SAMPLE: &str = "sample";

/// Names and lengths of the dimensions.
pub(crate) fn dimensions(settings: &Settings) -> Result<(Vec<String>, Vec<u64>), PlanError> {
    let refused = |message: String| Err(PlanError::Setting(message));
    let own = || {
        settings
            .axes
            .iter()
            .filter_map(|axis| axis.points().map(|points| (axis.name.clone(), points)))
    };
    let (mut names, mut shape): (Vec<String>, Vec<u64>) = own().unzip();
    let sampled = settings.axes.len() - names.len();
    let mut paired = settings
        .axes
        .iter()
        .filter_map(|axis| Some((&axis.name, axis.paired()?)));
    let mut samples = settings.samples;
    if let Some((first, length)) = paired.next() {
        if let Some((other, second)) = paired.find(|(_, other)| *other != length) {
            return refused(format!(
                "{first} has {length} paired values and {other} has {second}: paired values belong together, one per sample"
            ));
        }
        if samples.is_some_and(|samples| samples != length) {
            return refused(format!(
                "{length} paired values of {first} are {length} samples: leave out another number"
            ));
        }
        samples = Some(length);
    }
    match samples {
        None if sampled > 0 => {
            return refused("random axes need a number of samples (--samples N, in Python samples=N)".into());
        }
        Some(_) if sampled == 0 => return refused("a number of samples needs a random axis".into()),
        Some(samples) if !(2..=SAMPLES).contains(&samples) => {
            return refused(format!("{samples} samples: from 2 to {SAMPLES} are allowed"));
        }
        Some(samples) => {
            names.push(SAMPLE.into());
            shape.push(samples);
        }
        None => {}
    }
    let cells = shape
        .iter()
        .try_fold(1_u64, |product, length| product.checked_mul(*length));
    if cells.is_none_or(|cells| cells > MOST) {
        return refused("more than 2^53 cells: take fewer values".into());
    }
    Ok((names, shape))
}
