//! The sections of the report: each computes its results and describes them.

mod curves;
mod experiment;
mod regimes;
mod theory;
mod tracking;

use super::files::ReportError;
use super::section::Section;
use crate::map::Range;
use crate::scene::Scene;

/// The subject of a report.
#[derive(Debug, Clone)]
pub struct Subject {
    /// The scene.
    pub scene: Scene,
    /// Axes of the regime map.
    pub map: [Range; 2],
}

/// Computes one section; calls the callback with the fraction done, from 0 to 1.
pub type Maker = fn(&Subject, &(dyn Fn(f64) + Sync)) -> Result<Section, ReportError>;

/// All sections in order, each with the name under which it is cached.
pub const SECTIONS: [(&str, Maker); 5] = [
    ("experiment", experiment::make),
    ("tracking", tracking::make),
    ("theory", theory::make),
    ("curves", curves::make),
    ("regimes", regimes::make),
];
