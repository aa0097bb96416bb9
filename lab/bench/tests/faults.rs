//! Guards that every fault of a rig, of its connection and of a controller ends the run with a drive of zero, and how soon, and that a record with
//! a fault which no longer matters to the drive is refused; `studies/faults.rs` takes more instants.

#[path = "../../../studies/common.rs"]
mod common;

use std::cell::Cell;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::rc::Rc;

use vines_testbench::backbone::{Tracked, track};
use vines_testbench::experiment::{self, ExperimentError, Plan};
use vines_testbench::identification::{IdentificationError, identify};
use vines_testbench::record::Record;
use vines_testbench::rig::{
    BuiltIn, Command, Controller, ControllerError, Drive, Rig, RigError, RigFault, SensorFault, Sensors, Simulated,
    faulty,
};
use vines_testbench::scene::{LinearResponse, Scene};

/// The default scene with these settings, and a linear response as a loop check finds it.
fn scene(settings: &[&str]) -> Scene {
    let mut scene = common::scene("", settings).unwrap();
    scene.measured = Some(LinearResponse::of(&scene));
    scene
}

/// The record of an experiment.
fn record(rig: &mut dyn Rig, scene: &Scene) -> Result<Record, ExperimentError> {
    let mut controller = BuiltIn::new(&scene.controller_config()).unwrap();
    experiment::run(rig, &mut controller, &Plan::of(scene), |_, _, _| {})
}

/// The tracked backbone.
fn tracked(rig: &mut dyn Rig, scene: &Scene) -> Result<Tracked, ExperimentError> {
    let mut controller = BuiltIn::new(&scene.backbone_config()).unwrap();
    track(rig, &mut controller, scene, |_, _| {})
}

/// Time from a fault to a drive of zero, s, and whether the run ended early.
fn injected(scene: &Scene, fault: RigFault, seconds: f64, tracks: bool) -> (Option<f64>, bool) {
    let zero = Rc::new(Cell::new(None));
    let told = Rc::clone(&zero);
    let mut rig = faulty(scene, fault, seconds, move |time| told.set(time)).unwrap();
    let ended = if tracks {
        tracked(&mut rig, scene).map_or(true, |tracked| tracked.ended.is_some())
    } else {
        record(&mut rig, scene).is_err()
    };
    drop(rig);
    (zero.get(), ended)
}

/// Injects every fault at `instants` phases while the loop locks, holds, tracks and releases. The drive must be zero within `limit`
/// seconds and the ramp.
fn inject(settings: &[&str], instants: usize, limit: f64) {
    let scene = scene(&[settings, &["phase_lock.release_rate=4.1e-4", "record.decay_periods=6"]].concat());
    let healthy = || Simulated::of(&scene).unwrap();
    let record = record(&mut *healthy(), &scene).unwrap();
    let (step, period) = (record.sample_time, scene.dimensionless().natural_period());
    let [settled, released] = [record.settled, record.released].map(|sample| sample as f64 * step);
    let tracked = tracked(&mut *healthy(), &scene).unwrap();
    let tracking = (tracked.periods_to_lock + 40.0) * period;
    let config = scene.controller_config();
    let ramp = config
        .ramp_rate
        .map_or(0.0, |rate| config.amplitude_max.unwrap_or(config.amplitude) / rate);
    for (name, fault) in RigFault::ALL {
        let is_wrong_sign = name.contains("reversed") || name.contains("swapped");
        let limit = if is_wrong_sign { 0.03 } else { limit } + ramp;
        for n in 0..instants {
            // The phases of the instants fill the period evenly.
            let phase = (0.618 * n as f64) % 1.0 * period;
            for (begins, tracks) in [(settled / 3.0, false), (settled, false), (tracking, true)] {
                let (zero, ended) = injected(&scene, fault, begins + phase, tracks);
                assert!(
                    ended && zero.is_some_and(|time| time <= limit),
                    "{name} at {begins} + {phase} s: {zero:?}"
                );
            }
            // The drive ramps down in two periods whatever happens.
            let (zero, _) = injected(&scene, fault, released + step, false);
            assert!(
                zero.is_some_and(|time| time <= 2.0 * period),
                "{name} at the release: {zero:?}"
            );
        }
    }
}

#[test]
fn every_fault_switches_the_drive_off_within_its_ramp() {
    inject(&[], 2, 0.06);
}

#[test]
fn every_fault_is_found_through_noise_and_12_bits() {
    inject(
        &["chain.snr=40", "chain.adc_bits=12", "phase_lock.ramp_rate=1.6e-3"],
        1,
        0.07,
    );
}

#[test]
fn faults_in_the_first_periods_of_the_drive_are_found_within_a_second() {
    let scene = scene(&["start.dq2=0"]);
    for fault in [
        RigFault::Response(SensorFault::Reversed),
        RigFault::Base(SensorFault::Reversed),
        RigFault::Both(SensorFault::Dead),
        RigFault::Response(SensorFault::Dead),
        RigFault::Base(SensorFault::Dead),
        RigFault::Response(SensorFault::Gain(0.3)),
        RigFault::Response(SensorFault::Gain(3.0)),
        RigFault::Shaker(0.0),
        RigFault::Swapped,
    ] {
        // A gain that is wrong from the start is found by the loop check, which compares it with the drive.
        let from_the_start = matches!(fault, RigFault::Response(SensorFault::Gain(gain)) if gain > 1.0);
        for seconds in [0.0, 0.25, 0.6, 0.9, 1.3, 2.0]
            .into_iter()
            .skip(usize::from(from_the_start))
        {
            let (zero, ended) = injected(&scene, fault, seconds, false);
            assert!(
                ended && zero.is_some_and(|time| time < 1.0),
                "{fault:?} at {seconds} s: {zero:?}"
            );
        }
    }
}

#[test]
fn a_held_drive_that_does_not_reach_the_rig_is_found() {
    let scene = scene(&["chain.hold=true"]);
    let (zero, ended) = injected(&scene, RigFault::Shaker(0.0), 10.0, false);
    assert!(ended && zero.is_some_and(|time| time < 0.06), "{zero:?}");
}

/// A rig that fails outside at a sample; it keeps the amplitude of the last drive, m.
struct Lost {
    rig: Simulated,
    left: usize,
    fails: fn() -> Result<(), RigError>,
    last: f64,
}

impl Rig for Lost {
    fn sense(&mut self) -> Result<Sensors, RigError> {
        self.left = self.left.saturating_sub(1);
        if self.left == 0 {
            (self.fails)()?;
        }
        self.rig.sense()
    }

    fn advance(&mut self, drive: Drive, step: f64) -> Result<(), RigError> {
        self.last = drive.amplitude;
        self.rig.advance(drive, step)
    }
}

/// A controller that fails at a sample.
struct Broken(BuiltIn, usize, fn(Command) -> Result<Command, ControllerError>);

impl Controller for Broken {
    fn sample(&mut self, sensors: Sensors, active: bool) -> Result<Command, ControllerError> {
        self.1 = self.1.saturating_sub(1);
        let command = self.0.sample(sensors, active)?;
        if self.1 == 0 { (self.2)(command) } else { Ok(command) }
    }
}

#[test]
fn the_drive_is_zero_at_once_when_rig_or_controller_is_lost_or_the_lab_panics() {
    let scene = scene(&[]);
    let ends = |fails: fn() -> Result<(), RigError>, breaks: fn(Command) -> Result<Command, ControllerError>| {
        let plant = Simulated::new(scene.plant, scene.start).unwrap();
        let mut rig = Lost { rig: plant, left: 2000, fails, last: f64::NAN };
        let mut controller = Broken(BuiltIn::new(&scene.controller_config()).unwrap(), 2000, breaks);
        let run = || experiment::run(&mut rig, &mut controller, &Plan::of(&scene), |_, _, _| {});
        let ended = catch_unwind(AssertUnwindSafe(run));
        assert_eq!(rig.last, 0.0);
        ended
    };
    let ended = ends(|| Err(RigError::Failed("the connection is lost".into())), Ok);
    assert!(matches!(ended, Ok(Err(ExperimentError::Rig(_)))));
    assert!(ends(|| panic!("injected"), Ok).is_err());
    let ended = ends(
        || Ok(()),
        |_| Err(ControllerError::Failed("the connection is lost".into())),
    );
    assert!(matches!(ended, Ok(Err(ExperimentError::Controller(_)))));
    let nan = |command: Command| {
        Ok(Command {
            drive: Drive { amplitude: f64::NAN, ..command.drive },
            ..command
        })
    };
    assert!(matches!(ends(|| Ok(()), nan), Ok(Err(ExperimentError::NotANumber(_)))));
}

/// The record of a rig with a fault after some seconds.
fn with(scene: &Scene, fault: RigFault, seconds: f64) -> Record {
    record(&mut faulty(scene, fault, seconds, |_| {}).unwrap(), scene).unwrap()
}

#[test]
fn a_sensor_that_dies_after_the_release_is_an_error() {
    for settings in [&[][..], &["chain.adc_bits=14"], &["chain.snr=40"]] {
        let scene = scene(settings);
        let healthy = record(&mut *Simulated::of(&scene).unwrap(), &scene).unwrap();
        identify(&healthy, &scene).unwrap();
        let release = healthy.released as f64 * healthy.sample_time;
        for fault in [
            RigFault::Response(SensorFault::Dead),
            RigFault::Response(SensorFault::Frozen),
            RigFault::Response(SensorFault::Value(f64::NAN)),
            RigFault::Base(SensorFault::Value(f64::NAN)),
        ] {
            let failed = with(&scene, fault, release + 0.5);
            let refused = identify(&failed, &scene);
            let is_named = matches!(refused, Err(IdentificationError::SensorAfterRelease { seconds, .. }) if (seconds - 0.5).abs() < 0.25);
            assert!(is_named, "{settings:?}, {fault:?}");
        }
    }
}

#[test]
fn a_base_that_becomes_late_while_the_lock_is_held_is_an_error() {
    let scene = scene(&[]);
    let healthy = record(&mut *Simulated::of(&scene).unwrap(), &scene).unwrap();
    let settled = (healthy.settled + 2) as f64 * healthy.sample_time;
    let late = with(&scene, RigFault::Base(SensorFault::Late(3)), settled);
    let refused = identify(&late, &scene).unwrap_err();
    assert!(matches!(refused, IdentificationError::OffTarget { .. }), "{refused}");
}
