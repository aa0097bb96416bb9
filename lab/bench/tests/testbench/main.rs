//! Guards the bench without its fit. Each file has the tests of one part; what several of them need is here.

#[path = "../../../../studies/common.rs"]
mod common;
mod controllers;
mod faults;
mod loop_check;
mod measuring;
mod scenes;
mod shakers;
mod structures;
mod units;

use vines_bench::backbone::{Tracked, track};
use vines_bench::experiment::{ExperimentError, run};
use vines_bench::identification::{Identification, IdentificationError, identify};
use vines_bench::linear::LinearResponse;
use vines_bench::plan::Plan;
use vines_bench::record::Record;
use vines_bench::rig::{BuiltIn, Drive, Rig, RigError, RigStage, Sensors, Simulated};
use vines_bench::scene::Scene;

/// The default scene with these settings.
fn paper(settings: &[&str]) -> Scene {
    common::scene("", settings).unwrap()
}

/// The experiment on a rig whose linear response is known as a loop check finds it.
fn checked(scene: &Scene) -> Plan {
    scene.plan_on(scene.knowledge().measured(LinearResponse::of(&scene.plant)))
}

/// A rig whose readings, and whose drives with the time to the next sample, s, pass a function each.
struct Altered<'a> {
    rig: Box<dyn Rig>,
    read: Box<dyn FnMut(Sensors) -> Result<Sensors, RigError> + 'a>,
    drive: Box<dyn FnMut(Drive, f64) -> (Drive, f64) + 'a>,
}

impl RigStage for Altered<'_> {
    fn inner(&mut self) -> &mut dyn Rig {
        &mut *self.rig
    }

    fn sense(&mut self) -> Result<Sensors, RigError> {
        (self.read)(self.rig.sense()?)
    }

    fn advance(&mut self, drive: Drive, step: f64) -> Result<(), RigError> {
        let (drive, step) = (self.drive)(drive, step);
        self.rig.advance(drive, step)
    }
}

/// The record of an experiment.
fn record(rig: &mut dyn Rig, scene: &Scene) -> Result<Record, ExperimentError> {
    let mut controller = BuiltIn::new(&scene.controller_config()).unwrap();
    run(rig, &mut controller, &scene.plan(), |_, _, _| {})
}

/// What is identified on the simulated rig of a scene.
fn identified(scene: &Scene) -> Result<Identification, IdentificationError> {
    identify(
        &record(&mut *Simulated::of(scene).unwrap(), scene).unwrap(),
        &scene.plan(),
    )
}

/// The tracked backbone.
fn tracked(rig: &mut dyn Rig, scene: &Scene) -> Result<Tracked, ExperimentError> {
    let mut controller = BuiltIn::new(&scene.backbone_config()).unwrap();
    track(rig, &mut controller, &checked(scene), |_, _| {})
}
