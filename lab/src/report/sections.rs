//! The sections of the report: each runs what it needs and says what was found.

mod curves;
mod experiment;
mod regimes;
mod theory;
mod tracking;

use super::section::Section;
use crate::map::Range;
use crate::rig::{Chain, Rig, Simulated};
use crate::scene::Scene;

/// What a report is about.
#[derive(Debug, Clone)]
pub struct Subject {
    /// The scene.
    pub scene: Scene,
    /// Axes of the regime map.
    pub map: [Range; 2],
}

impl Subject {
    /// The plant of the scene, behind its measurement chain where it has one.
    fn rig(&self) -> Result<Box<dyn Rig>, String> {
        let plant = Simulated::new(&self.scene).map_err(|error| error.to_string())?;
        let rig: Box<dyn Rig> = Box::new(plant);
        Ok(if self.scene.chain.is_on() {
            Box::new(Chain::new(rig, &self.scene))
        } else {
            rig
        })
    }
}

/// Makes one section; the callback is told how much of it is done, from 0 to 1.
pub type Maker = fn(&Subject, &(dyn Fn(f64) + Sync)) -> Result<Section, String>;

/// All sections in order, each with the name that its results are kept under.
pub const SECTIONS: [(&str, Maker); 5] = [
    ("experiment", experiment::make),
    ("tracking", tracking::make),
    ("theory", theory::make),
    ("curves", curves::make),
    ("regimes", regimes::make),
];
