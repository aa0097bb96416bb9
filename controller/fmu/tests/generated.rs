//! The parameters in `modelDescription.xml` follow from the controller's table of settings: names, types, units, limits, start values.

use std::fmt::Write;
use std::path::Path;

use phase_lock::{Config, NONE, Number, PARAMETERS, Parameter, Range, Value};

/// Parameters that may change while the loop runs: the arguments of `PhaseLock::retune`.
const TUNABLE: [&str; 2] = ["amplitude", "phase_target"];

/// Start values for the default rig: resonance sqrt(k/M), and base amplitude b epsilon G.
fn start() -> Config {
    let config = Config::for_resonance((11.68e3_f64 / 3.807).sqrt(), 0.01 * 0.032 / 3.807 * 1.1);
    // The limit of the response depends on the rig.
    Config { response_max: None, ..config }
}

/// Type and unit of a real parameter. The declared type holds the quantity; it also makes 0 the lowest value, or -1 that of a rate.
fn unit(parameter: &Parameter) -> &'static str {
    match parameter.unit {
        "s" => r#"declaredType="Duration" unit="s" displayUnit="ms""#,
        "m" => r#"declaredType="Amplitude" unit="m" displayUnit="mm""#,
        "m/s" => r#"declaredType="AmplitudeRate" unit="m/s" displayUnit="mm/s""#,
        "rad" => r#"declaredType="Angle" unit="rad" displayUnit="deg""#,
        "rad/s" => r#"declaredType="Frequency" unit="rad/s" displayUnit="Hz""#,
        "rad/s2" => r#"unit="rad/s2" quantity="AngularAcceleration" displayUnit="Hz/s""#,
        "1/s" => r#"unit="1/s" quantity="Frequency""#,
        "" => r#"declaredType="Ratio" unit="1""#,
        unit => panic!("{}: choose the declared type of the unit {unit}", parameter.name),
    }
}

/// The limits that the declared type does not have.
fn limits(parameter: &Parameter) -> &'static str {
    match parameter.range {
        Range::Optional if parameter.unit != "m/s" => r#" min="-1""#,
        Range::Positive | Range::NotNegative if ["rad", "1/s"].contains(&parameter.unit) => r#" min="0""#,
        Range::Share => r#" max="1""#,
        Range::Detector => r#" min="1" max="2""#,
        Range::Harmonics => r#" declaredType="Number" max="8""#,
        Range::Dwell => r#" declaredType="Number" max="1000000""#,
        _ => "",
    }
}

/// The variables of all parameters.
fn variables() -> String {
    let mut text = String::new();
    for (reference, parameter) in PARAMETERS.iter().enumerate() {
        let name = parameter.name;
        let limits = limits(parameter);
        let value = match parameter.get(&start()) {
            Value::Real(value) => format!(r#"<Real {}{limits} start="{}"/>"#, unit(parameter), Number(value)),
            Value::Integer(value) => format!(r#"<Integer{limits} start="{value}"/>"#),
            Value::Boolean(value) => format!(r#"<Boolean start="{value}"/>"#),
        };
        let variability = if TUNABLE.contains(&name) { "tunable" } else { "fixed" };
        // As for the other variables: no capital, no full stop. The number for an absent option is -1.
        let description = parameter.description().trim_end_matches('.');
        let description = description[..1].to_lowercase() + &description[1..];
        let description = description.replace("; none: ", &format!("; {NONE}: "));
        write!(
            text,
            r#"    <ScalarVariable name="{name}" valueReference="{reference}" causality="parameter" variability="{variability}" initial="exact"
      description="{description}">
      {value}</ScalarVariable>
"#
        )
        .unwrap();
    }
    text
}

/// The variables after the parameters, and the structure of the model, for parameters that were those of `present`: value references, and
/// indices, which count from 1.
fn renumbered(text: &str, present: &[&str]) -> String {
    let number = |text: &str, first: usize| {
        let n: usize = text.parse().unwrap();
        let new = match present.get(n.wrapping_sub(first)) {
            Some(name) => PARAMETERS.iter().position(|parameter| parameter.name == *name).unwrap() + first,
            None => n + PARAMETERS.len() - present.len(),
        };
        new.to_string()
    };
    let mut new = String::new();
    let mut parts = text.split('"');
    while let (Some(name), Some(value)) = (parts.next(), parts.next()) {
        let value = if name.ends_with(" valueReference=") {
            number(value, 0)
        } else if name.ends_with(" index=") || name.ends_with(" dependencies=") {
            let all: Vec<String> = value.split_whitespace().map(|index| number(index, 1)).collect();
            all.join(" ")
        } else {
            value.to_owned()
        };
        write!(new, "{name}\"{value}\"").unwrap();
    }
    new + text.rsplit('"').next().unwrap()
}

#[test]
fn the_parameters_of_the_model_description_follow_from_the_settings() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../modelDescription.xml");
    let present = std::fs::read_to_string(&path).unwrap();
    let (before, rest) = present.split_once("  <ModelVariables>\n").unwrap();
    let (parameters, after) = rest.split_once("    <ScalarVariable name=\"response\"").unwrap();
    let names = parameters.split("<ScalarVariable name=\"").skip(1);
    let names: Vec<&str> = names.map(|rest| rest.split('"').next().unwrap()).collect();
    let (ours, after) = (variables(), renumbered(after, &names));
    let text = format!("{before}  <ModelVariables>\n{ours}    <ScalarVariable name=\"response\"{after}");
    if std::env::var_os("UPDATE").is_some() {
        std::fs::write(&path, &text).unwrap();
    }
    let present = std::fs::read_to_string(&path).unwrap();
    assert!(
        present == text,
        "modelDescription.xml is out of date: run this test with UPDATE=1"
    );
}
