//! Interface parity: the FMU's `modelDescription.xml` and the header of the C interface against the core's tables.

use phase_lock::{Config, INPUTS, MOVE, OUTPUTS, PARAMETERS, Range, Value};

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
        name => name.trim_start_matches("lock."),
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
    assert_eq!(names("PhaseLockConfig"), spelled(PARAMETERS.iter().map(|one| one.name)));
    assert_eq!(names("PhaseLockOutput"), spelled(OUTPUTS.iter().map(|one| one.name)));
    assert_eq!(names("PhaseLockInput"), spelled(INPUTS.map(|one| one.0)));
    assert_eq!(names("PhaseLockMove"), spelled(MOVE.map(|one| one.0)));
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
        let name = name.trim_start_matches("lock.");
        fields(structure)
            .iter()
            .any(|field| field.1 == name && field.0.ends_with("PhaseLockOptional"))
    };
    for parameter in &PARAMETERS {
        let expected = parameter.range == Range::Optional;
        assert_eq!(
            is_optional("PhaseLockConfig", parameter.name),
            expected,
            "{}",
            parameter.name
        );
    }
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

fn number(element: &str, name: &str) -> Option<f64> {
    attribute(element, name).map(|text| text.parse().expect("a number"))
}

#[test]
fn the_parameters_of_the_fmu_are_those_of_the_core_in_the_same_order() {
    let described = names("parameter");
    let in_core: Vec<_> = PARAMETERS.iter().map(|parameter| parameter.name).collect();
    assert_eq!(described, in_core);
}

#[test]
fn types_and_units_of_the_fmu_are_those_of_the_core() {
    let config = Config::for_resonance(1.0, 1.0);
    for parameter in &PARAMETERS {
        let element = variable(parameter.name);
        let (kind, unit) = match parameter.get(&config) {
            // FMI writes the unit of a pure number as 1.
            Value::Real(_) if parameter.unit.is_empty() => ("<Real ", Some("1")),
            Value::Real(_) => ("<Real ", Some(parameter.unit)),
            Value::Integer(_) => ("<Integer ", None),
            Value::Boolean(_) => ("<Boolean ", None),
        };
        assert!(element.contains(kind), "{}", parameter.name);
        assert_eq!(attribute(element, "unit"), unit, "{}", parameter.name);
    }
}

#[test]
fn the_fmu_starts_as_the_core_would_for_the_same_resonance() {
    let start = |name| number(variable(name), "start").expect("a start value");
    let (omega, amplitude) = (start("omega_start"), start("amplitude"));
    assert!((omega - (11.68e3_f64 / 3.807).sqrt()).abs() < 1e-12);
    let config = Config::for_resonance(omega, amplitude);
    for parameter in &PARAMETERS {
        let name = parameter.name;
        let expected = match parameter.get(&config) {
            Value::Real(expected) => expected,
            Value::Integer(expected) => expected.into(),
            Value::Boolean(expected) => {
                let start = attribute(variable(name), "start");
                assert_eq!(start, Some(if expected { "true" } else { "false" }), "{name}");
                continue;
            }
        };
        let value = start(name);
        assert!(
            (value - expected).abs() <= 1e-12 * expected.abs(),
            "{name}: {value}, {expected}"
        );
    }
}

#[test]
fn start_values_lie_in_the_ranges_of_the_core() {
    for parameter in &PARAMETERS {
        if parameter.range == Range::Boolean {
            continue;
        }
        let start = number(variable(parameter.name), "start").expect("a start value");
        assert!(parameter.range.contains(start), "{} = {start}", parameter.name);
    }
}
