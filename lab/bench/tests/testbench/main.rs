//! Guards the bench without its fit. Each file has the tests of one part; what several of them need is here.

mod backbone;
#[path = "../../../../studies/common.rs"]
mod common;
mod controllers;
mod faults;
mod identification;
mod loop_check;
mod measuring;
mod scenes;
mod shakers;
mod structures;
mod units;

use phase_lock::Config;
use vines_bench::backbone::{Tracked, track};
use vines_bench::comparison::ExactCurve;
use vines_bench::experiment::{ExperimentError, run};
use vines_bench::identification::{Identification, IdentificationError, ResonancePoint, identify};
use vines_bench::plan::Plan;
use vines_bench::record::Record;
use vines_bench::rig::{
    BuiltIn, Command, Controller, ControllerError, Drive, Rig, RigError, RigStage, Sensors, Simulated,
};
use vines_bench::scene::{Override, Scene, SceneError};

/// The default scene with these settings.
fn paper(settings: &[&str]) -> Scene {
    common::scene("", settings).unwrap()
}

/// The dimensionless scene with these settings, which spaces separate.
fn dimensionless(settings: &str) -> Scene {
    preset("dimensionless", &settings.split_whitespace().collect::<Vec<_>>()).unwrap()
}

/// A preset of `scenes/` with these settings.
fn preset(name: &str, settings: &[&str]) -> Result<Scene, SceneError> {
    // The default scene is a part of the program.
    let folder = if name == "paper" { "lab/scene" } else { "scenes" };
    let file = format!("{}/../../{folder}/{name}.toml", env!("CARGO_MANIFEST_DIR"));
    let settings: Vec<Override> = settings.iter().map(|one| one.parse().unwrap()).collect();
    Scene::load(Some(file.as_ref()), &settings)
}

/// Difference of a point from the exact curve of a scene with one oscillator: in sigma and in G at its response, and from the nearest point.
fn off_curve(scene: &Scene, at: &ResonancePoint) -> [f64; 3] {
    let exact = ExactCurve::of(&scene.dimensionless());
    let distance = exact.distance(at.c, at.sigma, at.g).unwrap();
    let [sigma, g] = [distance.sigma, distance.g].map(|off| off.map_or(f64::NAN, f64::abs));
    [sigma, g, distance.nearest]
}

/// A text with replacements of its parts: `text -> replacement ;; text -> replacement`.
fn changed(text: &str, changes: &str) -> String {
    let changes = changes.replace("\\n", "\n");
    let pairs = changes.split(" ;; ").filter_map(|pair| pair.split_once(" -> "));
    pairs.fold(text.to_string(), |text, (from, to)| {
        assert!(text.contains(from), "{from}");
        text.replace(from, to)
    })
}

/// A refusal has these parts, which `|` separates.
fn says(result: Result<Scene, SceneError>, parts: &str) -> String {
    let message = result.expect_err(parts).to_string();
    for part in parts.split(" | ") {
        assert!(message.contains(part), "`{part}` is not in: {message}");
    }
    message
}

/// The experiment on a rig whose linear response is known as a loop check finds it.
fn checked(scene: &Scene) -> Plan {
    scene.plan_on(scene.knowledge().measured(scene.knowledge().linear))
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

impl<'a> Altered<'a> {
    /// The rig of a scene whose readings pass a function.
    fn reading(scene: &Scene, mut read: impl FnMut(Sensors) -> Sensors + 'a) -> Self {
        let (rig, drive) = (Simulated::of(scene).unwrap(), Box::new(|drive, step| (drive, step)));
        Self { rig, read: Box::new(move |sensors| Ok(read(sensors))), drive }
    }

    /// The rig of a scene whose drives pass a function.
    fn driven(scene: &Scene, drive: impl FnMut(Drive, f64) -> (Drive, f64) + 'a) -> Self {
        Self {
            drive: Box::new(drive),
            ..Self::reading(scene, |sensors| sensors)
        }
    }
}

/// What a controller is asked for: whether to drive, and for how many samples it has been asked this.
type Asked = (bool, usize);

/// The built-in controller with another answer, and without the control of the response. It does not say whether it has locked.
struct Foreign<F>(BuiltIn, F, Asked);

impl<F> Foreign<F> {
    fn new(config: &Config, answer: F) -> Self {
        Self(BuiltIn::new(config).unwrap(), answer, (true, 0))
    }
}

impl<F: FnMut(&mut Command, Asked) -> Result<(), ControllerError>> Controller for Foreign<F> {
    fn sample(&mut self, sensors: Sensors, active: bool) -> Result<Command, ControllerError> {
        let (before, samples) = self.2;
        self.2 = (active, if before == active { samples + 1 } else { 0 });
        let command = self.0.sample(sensors, active)?;
        let mut command = Command { settled: None, state: None, ..command };
        (self.1)(&mut command, self.2)?;
        Ok(command)
    }
}

/// An experiment with a controller of this configuration with another answer; amplitude and displacement of the last drive that reached the rig, m, and
/// the largest amplitude.
fn foreign(
    scene: &Scene,
    config: &Config,
    mut change: impl FnMut(&mut Command, Asked),
) -> (Result<Record, ExperimentError>, [f64; 2], f64) {
    let (mut last, mut largest) = ([f64::NAN; 2], 0.0_f64);
    let mut rig = Altered::driven(scene, |drive, step| {
        last = [drive.amplitude, drive.displacement];
        largest = largest.max(drive.amplitude);
        (drive, step)
    });
    let mut controller = Foreign::new(config, |command: &mut Command, asked| {
        change(command, asked);
        Ok(())
    });
    let record = run(&mut Vec::new(), &mut rig, &mut controller, &scene.plan(), |_, _| {});
    drop(rig);
    (record, last, largest)
}

/// The record of an experiment.
fn record(rig: &mut dyn Rig, scene: &Scene) -> Result<Record, ExperimentError> {
    let mut controller = BuiltIn::new(&scene.plan().lock).unwrap();
    run(&mut Vec::new(), rig, &mut controller, &scene.plan(), |_, _| {})
}

/// The record of the rig of a scene.
fn record_of(scene: &Scene) -> Record {
    record(&mut *Simulated::of(scene).unwrap(), scene).unwrap()
}

/// What is identified on the simulated rig of a scene.
fn identified(scene: &Scene) -> Result<Identification, IdentificationError> {
    identify(&record_of(scene), &scene.plan())
}

/// The tracked backbone.
fn tracked(rig: &mut dyn Rig, scene: &Scene) -> Result<Tracked, ExperimentError> {
    let mut controller = BuiltIn::new(&scene.plan().tracking).unwrap();
    track(&mut Vec::new(), rig, &mut controller, &checked(scene), |_| {})
}

/// The tracked backbone of the rig of a scene.
fn tracked_of(scene: &Scene) -> Tracked {
    tracked(&mut *Simulated::of(scene).unwrap(), scene).unwrap()
}
