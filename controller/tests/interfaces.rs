//! Guards the parity of inputs, outputs and operations in the FMU's `modelDescription.xml` and in the C header with the core. (Parameters are
//! generated: `controller/*/tests/generated.rs`. The structures of the C interface are compared by the compiler: `controller/capi/src/types.rs`.)

use std::collections::BTreeSet;

use fmi2_description::{Causality, Description};
use phase_lock::{INPUTS, MOVE, OUTPUTS};

const DESCRIPTION: &str = include_str!("../fmu/modelDescription.xml");
const HEADER: &str = include_str!("../capi/include/phase_lock.h");

#[test]
fn inputs_and_outputs_of_the_fmu_are_those_of_the_core() {
    let description = Description::parse(DESCRIPTION).unwrap();
    // The unit of a number is 1.
    let pair = |name: &str, unit: &str| (name.to_owned(), unit.trim_end_matches('1').to_owned());
    let described = |causality| -> BTreeSet<_> {
        let variables = description.variables.iter().filter(|v| v.causality == causality);
        let unit = |v: &fmi2_description::ScalarVariable| v.content().unwrap().1.unit.clone().unwrap_or_default();
        variables.map(|v| pair(&v.name, &unit(v))).collect()
    };
    let inputs = INPUTS.iter().map(|(name, unit)| pair(name, unit));
    let moves = MOVE.iter().map(|(name, unit)| pair(&format!("move.{name}"), unit));
    let expected: BTreeSet<_> = inputs.chain(moves).chain([pair("hold_response", "")]).collect();
    assert_eq!(described(Causality::Input), expected);
    let values = OUTPUTS.iter().map(|signal| pair(signal.name, signal.unit));
    let flags = OUTPUTS.iter().filter_map(|signal| signal.present);
    let expected: BTreeSet<_> = values.chain(flags.map(|name| pair(name, ""))).collect();
    assert_eq!(described(Causality::Output), expected);
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
