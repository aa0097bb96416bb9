//! The parameters of a scene, under the names of the FMUs' variables, as SSP writes them.

use std::fmt::Write;

use phase_lock::PARAMETERS;
use phase_lock::Value::{self, Boolean, Integer, Real};

use crate::{pack::PackError, scene::Scene};

type Named = (&'static str, Value);

/// Parameters and start of the plant. The start goes by its parameters: some masters set no start value of an output.
pub(super) fn plant(scene: &Scene) -> Vec<Named> {
    scene
        .start_values()
        .map(|(name, value)| {
            let parameter = match name {
                "q1" => "q1_start",
                "der(q1)" => "der_q1_start",
                "q2" => "q2_start",
                "der(q2)" => "der_q2_start",
                other => other,
            };
            (parameter, Real(value))
        })
        .to_vec()
}

/// Parameters of the controller, which is armed from the start.
pub(super) fn controller(scene: &Scene) -> Result<Vec<Named>, PackError> {
    let config = scene.controller_config();
    config.build()?;
    let parameters = PARAMETERS.iter();
    Ok(parameters
        .map(|parameter| (parameter.name, parameter.get(&config)))
        .chain([("active", Boolean(true))])
        .collect())
}

/// A file of parameter values. Each has a name of its own, since some masters merge sets of one name.
pub(super) fn parameter_set(name: &str, values: &[Named]) -> String {
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
    text + "  </ssv:Parameters>\n</ssv:ParameterSet>\n"
}
