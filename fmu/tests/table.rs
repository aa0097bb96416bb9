//! Guards that the parameters in modelDescription.xml and in docs/plant-parameters.md follow from the plant's table.
//! `UPDATE=1` writes both.

use lovines::table::{LAWS, PARAMETERS, Parameter, Range};
use std::path::{Path, PathBuf};

const END: &str = "</ScalarVariable>\n";

fn path(file: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(file)
}

/// Compares a file with its text, or writes it.
fn compare(file: &str, present: &str, text: &str) {
    if std::env::var_os("UPDATE").is_some() {
        std::fs::write(path(file), text).unwrap();
        return;
    }
    assert!(present == text, "{file} is out of date: run this test with UPDATE=1");
}

/// A number as a person writes it.
fn number(value: f64) -> String {
    format!("{value:?}").trim_end_matches(".0").into()
}

/// The attributes of the type, which say what programs show, and the unit.
fn attributes(row: &Parameter) -> &'static str {
    match (row.unit, row.has_zero_for_default()) {
        ("kg", _) if row.start < 0.1 => r#"declaredType="Mass" unit="kg" displayUnit="g" "#,
        ("kg", _) => r#"declaredType="Mass" unit="kg" "#,
        ("N/m", _) => r#"quantity="TranslationalSpringConstant" unit="N/m" "#,
        ("N.s/m", _) => r#"quantity="TranslationalDampingConstant" unit="N.s/m" "#,
        ("m", _) => r#"declaredType="Displacement" unit="m" displayUnit="mm" "#,
        ("rad", _) => r#"quantity="Angle" unit="rad" displayUnit="deg" "#,
        ("", _) if row.range.is_whole() || row.range == Range::NotNegative => "",
        ("", _) => r#"unit="1" "#,
        (unit, _) => panic!("{unit}: a unit with its UnitDefinition and a line here"),
    }
}

fn variable(row: &Parameter, value_reference: &str) -> String {
    let Parameter { symbol, meaning, start, tunable, .. } = *row;
    let variability = if tunable { "tunable" } else { "fixed" };
    let kind = if row.range.is_whole() { "Integer" } else { "Real" };
    let zero = row.default.filter(|_| row.has_zero_for_default());
    let zero = zero.map_or(String::new(), |default| format!("; 0: {default}"));
    let [low, high] = row.range.bounds();
    let low = if row.has_zero_for_default() { 0.0 } else { low };
    let [low, high, start] = [low, high, start].map(number);
    let attributes = attributes(row);
    format!(
        "    <ScalarVariable name=\"{symbol}\" valueReference=\"{value_reference}\" causality=\"parameter\" variability=\"{variability}\" initial=\"exact\"
      description=\"{meaning}{zero}\">
      <{kind} {attributes}min=\"{low}\" max=\"{high}\" start=\"{start}\"/>{END}"
    )
}

#[test]
fn the_parameters_of_the_description_follow_from_the_table() {
    let present = std::fs::read_to_string(path("modelDescription.xml")).unwrap();
    let mut text = present.clone();
    for row in &PARAMETERS {
        let head = format!("    <ScalarVariable name=\"{}\" valueReference=\"", row.symbol);
        match text.find(&head) {
            Some(at) => {
                let rest = &text[at + head.len()..];
                let reference = rest[..rest.find('"').unwrap()].to_string();
                let end = at + text[at..].find(END).unwrap() + END.len();
                text.replace_range(at..end, &variable(row, &reference));
            }
            // A new one comes last, so that no other is renumbered.
            None => {
                let at = text.find("  </ModelVariables>").unwrap();
                let reference = text.matches("<ScalarVariable ").count();
                text.insert_str(at, &variable(row, &reference.to_string()));
            }
        }
    }
    compare("modelDescription.xml", &present, &text);
}

#[test]
fn the_page_of_the_parameters_follows_from_the_table() {
    const FILE: &str = "docs/plant-parameters.md";
    const HEAD: &str = "|---|---|---|---|---|\n";
    let present = std::fs::read_to_string(path(FILE)).unwrap();
    let (head, _) = present.split_once(HEAD).unwrap();
    let rows = PARAMETERS.iter().map(|row| {
        let Parameter { symbol, unit, .. } = row;
        let default = row
            .default
            .map_or_else(|| "must be given".into(), |default| format!("`{default}`"));
        let allowed = match row.range {
            Range::Law => LAWS.map(|law| format!("`\"{law}\"`")).join(", "),
            range => range.allowed().trim_start_matches("a number ").into(),
        };
        let meaning = row.meaning.replace('|', "\\|");
        format!("| `{symbol}` | {unit} | {allowed} | {default} | {meaning} |\n")
    });
    let text = format!("{head}{HEAD}{}", rows.collect::<String>());
    compare(FILE, &present, &text);
}
