//! The sections of the report: each runs what it needs and says what was found.

mod curves;
mod experiment;
mod regimes;
mod theory;

use super::section::Section;
use crate::map::Range;
use crate::scene::Scene;

/// What a report is about.
#[derive(Debug, Clone)]
pub struct Subject {
    /// The scene.
    pub scene: Scene,
    /// Axes of the regime map.
    pub map: [Range; 2],
}

/// Makes one section; the callback is told how much of it is done, from 0 to 1.
pub type Maker = fn(&Subject, &(dyn Fn(f64) + Sync)) -> Result<Section, String>;

/// All sections in order, each with the name that its results are kept under.
pub const SECTIONS: [(&str, Maker); 4] = [
    ("experiment", experiment::make),
    ("theory", theory::make),
    ("curves", curves::make),
    ("regimes", regimes::make),
];
