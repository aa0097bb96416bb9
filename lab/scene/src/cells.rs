//! The cells of maps and sweeps: scenes that differ in some numbers, each driven at a constant detuning.

use lovines::InvalidValue;
use thiserror::Error;
use vines_model::{Dimensionless, orbit::stable_resonant};

use crate::scene::{Family, Scene, SceneError};

/// The detuning, which belongs to the drive and not to the scene.
pub const SIGMA: &str = "sigma";

/// Least and largest number of periods that a cell may be followed. A motion keeps about 100 bytes per period.
const PERIODS_ALLOWED: [usize; 2] = [100, 1_000_000];

/// Why cells cannot be computed.
#[derive(Debug, Error)]
#[expect(missing_docs, reason = "the messages explain the variants")]
pub enum CellError {
    #[error(transparent)]
    Scene(#[from] SceneError),
    #[error(transparent)]
    Plant(#[from] InvalidValue),
    #[error("{0} is on two axes; give it one")]
    Twice(String),
    #[error("sigma is an axis and a constant: give one of them")]
    ConstantAxis,
    #[error("sigma = {0} (dimensionless) is not a finite number")]
    Sigma(f64),
    #[error("sigma = {sigma} (dimensionless) gives the frequency {omega} omega0, which must be above 0")]
    Frequency { sigma: f64, omega: f64 },
    #[error(
        "{0}: a regime map does not depend on it. It is of the ideal cavity: an axis may be sigma, G or excitation.E, r, and M, k, c, m, b, epsilon, lambda of [plant] or a number of [start]"
    )]
    WithoutEffect(String),
    #[error("{0} periods: from {least} to {most} are allowed", least = PERIODS_ALLOWED[0], most = PERIODS_ALLOWED[1])]
    Periods(usize),
}

/// Cells over numbers of a scene, and how they are driven.
#[derive(Debug, Clone)]
pub struct Cells {
    family: Family,
    /// The scene without the values of the axes.
    pub scene: Scene,
    keys: Vec<String>,
    sigma: f64,
    /// Largest number of periods that a cell is followed.
    pub periods: usize,
}

/// The scene of a cell, its detuning and its dimensionless numbers.
#[derive(Debug)]
pub struct Cell {
    /// The scene.
    pub scene: Scene,
    /// Detuning.
    pub sigma: f64,
    /// Dimensionless numbers, whose G is not rounded.
    pub numbers: Dimensionless,
}

impl Cells {
    /// Cells in which the numbers under `keys` vary: `section.key` of a scene, or [`SIGMA`]. If it does not vary, the detuning is `sigma` or,
    /// without it, the detuning of the scene's stable phase-resonant orbit, or 0. A cell is followed for at most `periods`.
    ///
    /// # Errors
    /// A key that the scene does not have, or a value that is not allowed.
    pub fn new(mut family: Family, keys: &[String], sigma: Option<f64>, periods: usize) -> Result<Self, CellError> {
        let scene = family.scene(&[])?;
        if let Some(n) = (1..keys.len()).find(|n| keys[..*n].contains(&keys[*n])) {
            return Err(CellError::Twice(keys[n].clone()));
        }
        let varies = keys.iter().any(|key| key == SIGMA);
        let sigma = match sigma {
            Some(_) if varies => return Err(CellError::ConstantAxis),
            Some(sigma) if !sigma.is_finite() => return Err(CellError::Sigma(sigma)),
            Some(sigma) => sigma,
            None if varies => 0.0,
            None => stable_resonant(&scene.dimensionless()).map_or(0.0, |orbit| orbit.sigma),
        };
        if !(PERIODS_ALLOWED[0]..=PERIODS_ALLOWED[1]).contains(&periods) {
            return Err(CellError::Periods(periods));
        }
        for key in keys.iter().filter(|key| *key != SIGMA) {
            family.vary(key)?;
        }
        Ok(Self { family, scene, keys: keys.into(), sigma, periods })
    }

    /// The detuning, unless it varies.
    pub fn sigma(&self) -> Option<f64> {
        (!self.keys.iter().any(|key| key == SIGMA)).then_some(self.sigma)
    }

    /// The cell with these values, one per key.
    ///
    /// # Errors
    /// A value that the scene refuses, or a frequency that is not positive.
    pub fn at(&self, values: &[f64]) -> Result<Cell, CellError> {
        let (mut sigma, mut g) = (self.sigma, None);
        let mut of_scene = Vec::with_capacity(values.len());
        for (key, value) in self.keys.iter().zip(values) {
            if key == SIGMA {
                sigma = *value;
                continue;
            }
            of_scene.push(*value);
            if key == "excitation.G" {
                // The base amplitude that a scene keeps instead of G rounds it.
                g = Some(*value);
            }
        }
        let scene = self.family.scene(&of_scene)?;
        let mut numbers = scene.dimensionless();
        numbers.g = g.unwrap_or(numbers.g);
        match 1.0 + numbers.epsilon * sigma {
            omega if omega.is_finite() && omega > 0.0 => Ok(Cell { scene, sigma, numbers }),
            omega => Err(CellError::Frequency { sigma, omega }),
        }
    }
}
