//! Interface parity: inputs, outputs and operations in the FMU's `modelDescription.xml` and in the C header against the core. (Parameters are
//! generated: `controller/*/tests/generated.rs`.)

use phase_lock::{INPUTS, MOVE, OUTPUTS};

const DESCRIPTION: &str = include_str!("../fmu/modelDescription.xml");
const HEADER: &str = include_str!("../capi/include/phase_lock.h");

/// Names of the variables of a causality.
fn names(causality: &str) -> Vec<&'static str> {
    let of_it = variables().filter(|text| attribute(text, "causality") == Some(causality));
    of_it
        .filter_map(|text| text["name=\"".len()..].split('"').next())
        .collect()
}

/// Types and names of the fields of a structure of the header, sorted by name.
fn fields(structure: &str) -> Vec<(&'static str, &'static str)> {
    let from = format!("typedef struct {structure} {{");
    let (_, body) = HEADER.split_once(&from).expect("the structure");
    let (body, _) = body.split_once('}').expect("its end");
    let lines = body.lines().map(str::trim).filter(|line| line.ends_with(';'));
    let mut fields: Vec<_> = lines
        .filter_map(|line| line.trim_end_matches(';').rsplit_once(' '))
        .collect();
    fields.sort_by_key(|field| field.1);
    fields
}

/// The names of a table, sorted, as the C interface spells them.
fn spelled<'a>(names: impl IntoIterator<Item = &'a str>) -> Vec<&'a str> {
    let in_c = |name: &'a str| match name {
        "E" => "amplitude",
        name => name,
    };
    let mut names: Vec<_> = names.into_iter().map(in_c).collect();
    names.sort_unstable();
    names
}

#[test]
fn inputs_and_outputs_of_the_fmu_are_those_of_the_core() {
    let moves = MOVE.iter().map(|(name, _)| format!("move.{name}"));
    let mut inputs: Vec<String> = INPUTS.iter().map(|(name, _)| (*name).into()).collect();
    inputs.push("hold_response".into());
    inputs.extend(moves);
    assert_eq!(names("input"), inputs);
    let flags = OUTPUTS.iter().filter_map(|signal| signal.present);
    let mut outputs: Vec<_> = OUTPUTS.iter().map(|signal| signal.name).chain(flags).collect();
    let mut described = names("output");
    outputs.sort_unstable();
    described.sort_unstable();
    assert_eq!(described, outputs);
    let unit = |name: &str| attribute(variable(name), "unit").unwrap_or("");
    for signal in &OUTPUTS {
        assert_eq!(unit(signal.name).trim_end_matches('1'), signal.unit, "{}", signal.name);
    }
    for (name, expected) in INPUTS {
        assert_eq!(unit(name), expected, "{name}");
    }
    for (name, expected) in MOVE {
        assert_eq!(unit(&format!("move.{name}")), expected, "{name}");
    }
}

#[test]
fn the_structures_of_the_c_interface_are_the_tables_of_the_core() {
    let names = |structure| fields(structure).into_iter().map(|field| field.1).collect::<Vec<_>>();
    assert_eq!(
        names("PhaseLockOutput"),
        spelled(OUTPUTS.iter().map(|signal| signal.name))
    );
    assert_eq!(names("PhaseLockInput"), spelled(INPUTS.map(|input| input.0)));
    assert_eq!(names("PhaseLockMove"), spelled(MOVE.map(|field| field.0)));
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

#[test]
fn what_is_optional_in_the_core_is_optional_in_c_and_not_a_number_with_a_meaning() {
    let is_optional = |structure, name: &str| {
        fields(structure)
            .iter()
            .any(|field| field.1 == name && field.0.ends_with("PhaseLockOptional"))
    };
    for signal in &OUTPUTS {
        assert_eq!(
            is_optional("PhaseLockOutput", signal.name),
            signal.present.is_some(),
            "{}",
            signal.name
        );
    }
    assert!(is_optional("PhaseLockInput", "reference"));
}

/// The text of each variable's element.
fn variables() -> impl Iterator<Item = &'static str> {
    DESCRIPTION.split("<ScalarVariable ").skip(1)
}

fn attribute<'a>(element: &'a str, name: &str) -> Option<&'a str> {
    let from = element.find(&format!(" {name}=\""))? + name.len() + 3;
    element[from..].split('"').next()
}

/// The element of a variable.
fn variable(name: &str) -> &'static str {
    variables()
        .find(|text| text.starts_with(&format!("name=\"{name}\"")))
        .unwrap_or_else(|| panic!("no variable {name}"))
}
