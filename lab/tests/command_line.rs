//! The program as its users meet it: output, exit codes and messages.

use std::process::{Command, Output};

use serde_json::Value;

fn vines(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_vines"))
        .args(arguments)
        .current_dir(std::env::temp_dir())
        .output()
        .expect("the program runs")
}

fn json(arguments: &[&str]) -> Value {
    let output = vines(arguments);
    assert!(output.status.success(), "{output:?}");
    serde_json::from_slice(&output.stdout).expect("JSON")
}

/// The error must be one message on stderr, with nothing on stdout.
fn fails(arguments: &[&str], code: i32, part: &str) {
    let output = vines(arguments);
    let message = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(code), "{arguments:?}: {message}");
    assert!(message.starts_with("error: "), "{message}");
    assert!(message.contains(part), "`{part}` is not in: {message}");
    assert!(!message.contains("panicked"), "{message}");
    assert!(output.stdout.is_empty());
}

#[test]
fn orbits_come_as_a_json_array() {
    let orbits = json(&["orbit", "--json"]);
    let stable: Vec<_> = orbits
        .as_array()
        .expect("an array")
        .iter()
        .filter(|orbit| orbit["stable"] == true)
        .collect();
    assert_eq!(stable.len(), 1);
    for key in ["sigma", "C", "B", "Omega", "G", "impact_velocity"] {
        assert!(stable[0][key].is_f64(), "{key}: {}", stable[0]);
    }
    assert_eq!(stable[0]["multipliers"].as_array().map(Vec::len), Some(4));
}

#[test]
fn theory_comes_as_json_with_as_many_samples_as_asked_for() {
    let theory = json(&["theory", "--json", "--points", "50"]);
    assert_eq!(theory["backbone"].as_array().map(Vec::len), Some(50));
    assert_eq!(theory["solutions"].as_array().map(Vec::len), Some(2));
    assert!(theory["manifold"]["C_min"].as_f64().unwrap() > 0.1);
}

#[test]
fn a_person_gets_tables() {
    for command in ["orbit", "theory"] {
        let output = vines(&[command]);
        let text = String::from_utf8(output.stdout).unwrap();
        assert!(text.contains("sigma") && text.contains("stable"), "{text}");
    }
    let none = vines(&["orbit", "--set", "excitation.G=0"]).stdout;
    assert!(
        String::from_utf8(none)
            .unwrap()
            .contains("without excitation")
    );
}

#[test]
fn bad_input_ends_with_code_two_and_one_message() {
    fails(&["orbit", "--set", "plant.r=1.5"], 2, "plant.r = 1.5");
    fails(&["orbit", "--set", "plant.rr=0.5"], 2, "`rr`");
    fails(&["orbit", "--set", "nonsense"], 2, "section.key=value");
    fails(&["theory", "--scene", "no-such.toml"], 2, "no-such.toml");
    fails(&["theory", "--points", "1"], 2, "--points");
    fails(&["dance"], 2, "dance");
}

#[test]
fn packing_without_libraries_says_what_is_missing() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().to_str().unwrap();
    fails(
        &["pack", "--out", path, "--libraries", path],
        2,
        "cargo build --release",
    );
    assert_eq!(
        std::fs::read_dir(folder.path()).unwrap().count(),
        0,
        "nothing is left behind"
    );
}

#[test]
fn packing_refuses_what_it_cannot_pack_before_it_writes() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let out = out.to_str().unwrap();
    let pack = |option: &[&'static str]| [&["pack", "--out", out], option].concat();
    fails(&pack(&["--binary", "win64"]), 2, "PLATFORM=PATH");
    fails(&pack(&["--binary", "amiga=x.so"]), 2, "amiga");
    fails(&pack(&["--set", "plant.r=2"]), 2, "plant.r = 2");
    fails(&pack(&["--portable"]), 2, "--portable cannot be done");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
}
