//! Plant and controller coupled: a system in the format of SSP 1.0, System Structure and Parameterization.

use std::fmt::Write;

use phase_lock::PARAMETERS;
use phase_lock::Value::{self, Boolean, Integer, Real};

use super::{File, PackError, archive};
use crate::scene::Scene;

/// The structure, but for what is `derived`: step size and end of the default experiment, and the date.
const STRUCTURE: &str = include_str!("SystemStructure.ssd");

/// The end of the default experiment, natural periods: the default scene has been locked for nearly a hundred by then.
const PERIODS: f64 = 400.0;

/// The system file of the FMUs, with the parameters of the scene and the date of generation.
pub(super) fn file(scene: &Scene, fmus: &[File], date: Option<String>) -> Result<File, PackError> {
    // The communication step is the controller's.
    let step = scene.sample_time().to_string();
    let stop = PERIODS * scene.dimensionless().natural_period();
    let mut structure = STRUCTURE.to_owned();
    for (attribute, value) in [
        ("stopTime", Some(stop.to_string())),
        ("stepSize", Some(step.clone())),
        ("baseStepSize", Some(step)),
        ("generationDateAndTime", date),
    ] {
        let filled = value.map_or(String::new(), |value| format!(" {attribute}=\"{value}\""));
        structure = structure.replace(&format!(" {attribute}=\"derived\""), &filled);
    }
    let mut entries = vec![
        ("SystemStructure.ssd".to_owned(), structure.into_bytes()),
        ("resources/plant.ssv".to_owned(), parameter_set("plant", plant(scene))),
        (
            "resources/controller.ssv".to_owned(),
            parameter_set("controller", controller(scene)?),
        ),
    ];
    entries.extend(
        fmus.iter()
            .map(|(name, content)| (format!("resources/{name}"), content.clone())),
    );
    archive("bench.ssp".into(), &entries)
}

/// Parameters and start of the plant. The start goes by its parameters: some masters set no start value of an output.
fn plant(scene: &Scene) -> impl Iterator<Item = (&str, Value)> {
    scene.start_values().into_iter().map(|(name, value)| {
        let parameter = match name {
            "q1" => "q1_start",
            "der(q1)" => "der_q1_start",
            "q2" => "q2_start",
            "der(q2)" => "der_q2_start",
            other => other,
        };
        (parameter, Real(value))
    })
}

/// Parameters of the controller, which is armed from the start.
fn controller(scene: &Scene) -> Result<impl Iterator<Item = (&str, Value)>, PackError> {
    let config = scene.controller_config();
    config.build()?;
    let parameters = PARAMETERS.iter();
    Ok(parameters
        .map(move |parameter| (parameter.name, parameter.get(&config)))
        .chain([("active", Boolean(true))]))
}

/// A file of parameter values. Each has a name of its own, since some masters merge sets of one name.
fn parameter_set<'a>(name: &str, values: impl Iterator<Item = (&'a str, Value)>) -> Vec<u8> {
    let mut text = format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<ssv:ParameterSet version=\"1.0\" name=\"{name}\" \
         generationTool=\"vines\"\n  xmlns:ssv=\"http://ssp-standard.org/SSP1/SystemStructureParameterValues\">\n  \
         <ssv:Parameters>\n",
    );
    for (name, value) in values {
        let value = match value {
            Real(number) => format!("<ssv:Real value=\"{number}\"/>"),
            Integer(number) => format!("<ssv:Integer value=\"{number}\"/>"),
            Boolean(truth) => format!("<ssv:Boolean value=\"{truth}\"/>"),
        };
        let _ = writeln!(text, "    <ssv:Parameter name=\"{name}\">{value}</ssv:Parameter>");
    }
    (text + "  </ssv:Parameters>\n</ssv:ParameterSet>\n").into_bytes()
}
