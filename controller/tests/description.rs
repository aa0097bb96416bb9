//! The FMU's `modelDescription.xml` against the core's table of parameters.

use phase_lock::{Config, PARAMETERS, Range, Value};

const DESCRIPTION: &str = include_str!("../fmu/modelDescription.xml");

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
    let described: Vec<_> = variables()
        .filter(|text| attribute(text, "causality") == Some("parameter"))
        .map(|text| {
            let (name, _) = text["name=\"".len()..].split_once('"').expect("a name");
            name
        })
        .collect();
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
