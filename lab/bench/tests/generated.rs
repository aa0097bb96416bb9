//! Guards that docs/controller-settings.md follows from the controller's table of settings and the keys of a scene.

use std::path::Path;

use phase_lock::{PARAMETERS, Parameter};
use vines_bench::scene::{KEYS, key};

/// The end of what stands above the rows.
const HEAD: &str = "|---|---|---|---|---|---|\n";

/// The initial value as a reader writes it. The compiler chooses the spaces.
fn initial(parameter: &Parameter) -> String {
    let text = parameter.initial().replace(" :: ", "::").replace("- ", "-");
    let text = text.trim_start_matches("Some(").trim_end_matches(')');
    match text {
        "None" => "none".into(),
        "Detector::Adaptive" => "1".into(),
        text => format!("`{}`", text.replace("FRAC_PI_2", "pi/2").replace("TAU", "(2 pi)")),
    }
}

/// The range; the bounds of all magnitudes stand above the table.
fn allowed(parameter: &Parameter) -> String {
    let text = parameter.range.allowed().replace(" (1e-30 to 1e30)", "");
    text.replace(", at most 1e30", "")
        .replace(", or -1 for none", " or none")
}

#[test]
fn the_page_of_the_settings_follows_from_the_table_and_the_keys_of_a_scene() {
    let rows = PARAMETERS.iter().map(|parameter| {
        let Parameter { name, unit, .. } = parameter;
        let (allowed, meaning) = (allowed(parameter), parameter.description().trim_end_matches('.'));
        let (initial, key) = (initial(parameter), key(name));
        let own = KEYS.iter().find(|(parameter, ..)| parameter == name);
        let own = own.map_or("", |(.., unit)| unit);
        let comma = if own.is_empty() { "" } else { ", " };
        format!("| `{name}` | {unit} | {allowed} | {initial} | `{key}`{comma}{own} | {meaning} |\n")
    });
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/controller-settings.md");
    let present = std::fs::read_to_string(&path).unwrap();
    let (head, _) = present.split_once(HEAD).unwrap();
    let text = format!("{head}{HEAD}{}", rows.collect::<String>());
    if std::env::var_os("UPDATE").is_some() {
        std::fs::write(&path, &text).unwrap();
        return;
    }
    assert!(
        present == text,
        "docs/controller-settings.md is out of date: run this test with UPDATE=1"
    );
}
