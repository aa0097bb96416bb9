//! Guards the bench without its fit. Each file has the tests of one part; what several of them need is here.

#[path = "../../../../studies/common.rs"]
mod common;
mod faults;
mod loop_check;
mod measuring;
mod scenes;

use vines_testbench::backbone::{Tracked, track};
use vines_testbench::experiment::{ExperimentError, run};
use vines_testbench::record::Record;
use vines_testbench::rig::{BuiltIn, Rig};
use vines_testbench::scene::{LinearResponse, Scene};

/// The default scene with these settings.
fn paper(settings: &[&str]) -> Scene {
    common::scene("", settings).unwrap()
}

/// The default scene with these settings, and a linear response as a loop check finds it.
fn checked(settings: &[&str]) -> Scene {
    let mut scene = paper(settings);
    scene.measured = Some(LinearResponse::of(&scene));
    scene
}

/// The record of an experiment.
fn record(rig: &mut dyn Rig, scene: &Scene) -> Result<Record, ExperimentError> {
    let mut controller = BuiltIn::new(&scene.controller_config()).unwrap();
    run(rig, &mut controller, scene, |_, _, _| {})
}

/// The tracked backbone.
fn tracked(rig: &mut dyn Rig, scene: &Scene) -> Result<Tracked, ExperimentError> {
    let mut controller = BuiltIn::new(&scene.backbone_config()).unwrap();
    track(rig, &mut controller, scene, |_, _| {})
}
