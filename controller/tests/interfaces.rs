//! Guards the parity of inputs, outputs and operations in the FMU's `modelDescription.xml` and in the C header with the core. (Parameters are
//! generated: `controller/*/tests/generated.rs`. The structures of the C interface are compared by the compiler: `controller/capi/src/types.rs`.)

use phase_lock::{INPUTS, MOVE, OUTPUTS};

const DESCRIPTION: &str = include_str!("../fmu/modelDescription.xml");
const HEADER: &str = include_str!("../capi/include/phase_lock.h");

/// The value of an attribute in the text of an element.
fn attribute<'a>(element: &'a str, name: &str) -> Option<&'a str> {
    let (_, rest) = element.split_once(&format!(" {name}=\""))?;
    rest.split('"').next()
}

/// Names and units of the variables of a causality, sorted.
fn described(causality: &str) -> Vec<(String, String)> {
    let variables = DESCRIPTION.split("<ScalarVariable").skip(1);
    let of_it = variables.filter(|text| attribute(text, "causality") == Some(causality));
    let text = |element: &str, name| attribute(element, name).unwrap_or_default().to_owned();
    // The unit of a number is 1.
    let mut found: Vec<_> = of_it
        .map(|element| {
            (
                text(element, "name"),
                text(element, "unit").trim_end_matches('1').to_owned(),
            )
        })
        .collect();
    found.sort();
    found
}

#[test]
fn inputs_and_outputs_of_the_fmu_are_those_of_the_core() {
    let owned = |name: &str, unit: &str| (name.to_owned(), unit.trim_end_matches('1').to_owned());
    let inputs = INPUTS.iter().map(|(name, unit)| owned(name, unit));
    let moves = MOVE.iter().map(|(name, unit)| owned(&format!("move.{name}"), unit));
    let mut expected: Vec<_> = inputs.chain(moves).chain([owned("hold_response", "")]).collect();
    expected.sort();
    assert_eq!(described("input"), expected);
    let values = OUTPUTS.iter().map(|signal| owned(signal.name, signal.unit));
    let flags = OUTPUTS.iter().filter_map(|signal| signal.present);
    let mut expected: Vec<_> = values.chain(flags.map(|name| owned(name, ""))).collect();
    expected.sort();
    assert_eq!(described("output"), expected);
}

#[test]
fn the_c_interface_has_every_operation_of_the_core() {
    let core = include_str!("../src/controller.rs");
    let public = core.split("pub fn ").skip(1).filter_map(|rest| rest.split('(').next());
    // The configuration and what follows from it are in the hands of the caller; the output before the first sample is all zeros.
    for name in public.filter(|name| !["build", "config", "gains", "idle"].contains(name)) {
        let in_c = match name {
            "start" => "reset",
            "process" => "sample",
            name => name,
        };
        assert!(HEADER.contains(&format!("int phase_lock_{in_c}(")), "{name}");
    }
}
