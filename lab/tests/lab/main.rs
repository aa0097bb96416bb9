//! Guards the lab as its users meet it. Each file has the tests of one part; what several of them need is here.

mod backbone;
mod command_line;
mod endpoints;
mod experiment;
mod packing;
mod pair;
mod report;
mod sweep;
mod watch;

use std::process::{Command, Output};

use vines::rig::{BuiltIn, Measured, Simulated};
use vines::scene::{Override, Scene};

const PROGRAM: &str = env!("CARGO_BIN_EXE_vines");

fn vines(arguments: &[&str]) -> Output {
    Command::new(PROGRAM)
        .args(arguments)
        .current_dir(std::env::temp_dir())
        .output()
        .expect("the program runs")
}

/// The error must be one message on stderr, with nothing on stdout.
fn fails(arguments: &[&str], code: i32, part: &str) {
    let output = vines(arguments);
    let message = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(code), "{arguments:?}: {message}");
    assert!(
        message.contains("error: ") && !message.contains("panicked"),
        "{message}"
    );
    assert!(message.contains(part), "`{part}` is not in: {message}");
    assert!(output.stdout.is_empty());
}

/// The dimensionless scene with other settings.
fn scene(settings: &[&str]) -> Scene {
    let overrides: Vec<Override> = settings.iter().map(|s| s.parse().unwrap()).collect();
    let text = include_str!("../../../scenes/dimensionless.toml");
    Scene::parse("dimensionless.toml", text, &overrides).unwrap()
}

fn plant(scene: &Scene) -> Measured<Simulated> {
    let plant = Simulated::new(scene.plant, scene.start).unwrap();
    plant.with_sensors(scene.resonance)
}

fn built_in(scene: &Scene) -> BuiltIn {
    BuiltIn::new(&scene.controller_config()).unwrap()
}
