//! The sections of the report: each computes its results and describes them.

mod curves;
mod experiment;
mod regimes;
mod theory;
mod tracking;

use lovines::InvalidValue;
use phase_lock::ConfigError;
use thiserror::Error;

use super::figure::FigureError;
use super::files::WriteError;
use super::section::Section;
use crate::map::{MapError, Range};
use crate::scene::Scene;

/// The subject of a report.
#[derive(Debug, Clone)]
pub struct Subject {
    /// The scene.
    pub scene: Scene,
    /// Axes of the regime map.
    pub map: [Range; 2],
}

/// Why a section could not be made.
#[derive(Debug, Error)]
#[error(transparent)]
#[expect(missing_docs, reason = "each is named by what it contains")]
pub enum SectionError {
    Plant(#[from] InvalidValue),
    Controller(#[from] ConfigError),
    Map(#[from] MapError),
    Write(#[from] WriteError),
}

impl From<FigureError> for SectionError {
    fn from(error: FigureError) -> Self {
        Self::Write(error.into())
    }
}

/// Computes one section; calls the callback with the fraction done, from 0 to 1.
pub type Maker = fn(&Subject, &(dyn Fn(f64) + Sync)) -> Result<Section, SectionError>;

/// All sections in order, each with the name under which it is cached.
pub const SECTIONS: [(&str, Maker); 5] = [
    ("experiment", experiment::make),
    ("tracking", tracking::make),
    ("theory", theory::make),
    ("curves", curves::make),
    ("regimes", regimes::make),
];
