//! Plant and controller coupled: a system in the format of SSP 1.0, System Structure and Parameterization.

mod parameters;

use super::archive::{self, File};
use super::{PackError, date};
use crate::scene::Scene;

use parameters::parameter_set;

/// The structure, but for what is `derived`: step size and end of the default experiment, and the date.
const STRUCTURE: &str = include_str!("system/SystemStructure.ssd");

/// The end of the default experiment, natural periods: the default scene has been locked for nearly a hundred by then.
const PERIODS: f64 = 400.0;

/// The system file of the FMUs, with the parameters of the scene.
pub(super) fn file(scene: &Scene, fmus: &[File]) -> Result<File, PackError> {
    let plant = parameter_set("plant", &parameters::plant(scene));
    let controller = parameter_set("controller", &parameters::controller(scene)?);
    // The communication step is the controller's.
    let step = scene.sample_time().to_string();
    let date = date::generation()?;
    let mut structure = STRUCTURE.to_owned();
    let stop = PERIODS * scene.dimensionless().natural_period();
    for (attribute, value) in [
        ("stopTime", Some(stop.to_string())),
        ("stepSize", Some(step.clone())),
        ("baseStepSize", Some(step)),
        ("generationDateAndTime", date),
    ] {
        let filled = value.map_or(String::new(), |value| format!(" {attribute}=\"{value}\""));
        structure = structure.replace(&format!(" {attribute}=\"derived\""), &filled);
    }

    let inside: Vec<String> = fmus.iter().map(|(name, _)| format!("resources/{name}")).collect();
    let mut entries = vec![
        ("SystemStructure.ssd", structure.as_bytes()),
        ("resources/plant.ssv", plant.as_bytes()),
        ("resources/controller.ssv", controller.as_bytes()),
    ];
    let fmus = inside.iter().zip(fmus);
    entries.extend(fmus.map(|(name, (_, content))| (name.as_str(), content.as_slice())));
    archive::file("bench.ssp".into(), &entries)
}
