//! Records that look complete and are useless.

use vines_testbench::experiment::{self, Plan};
use vines_testbench::identification::{IdentificationError, identify};
use vines_testbench::record::Record;
use vines_testbench::rig::{BuiltIn, RigFault, SensorFault, faulty};
use vines_testbench::scene::{LinearResponse, PAPER, Scene};

fn scene(settings: &[&str]) -> Scene {
    let overrides: Vec<_> = settings.iter().map(|one| one.parse().unwrap()).collect();
    let mut scene = Scene::parse("paper.toml", PAPER, &overrides).unwrap();
    scene.measured = Some(LinearResponse::of(&scene));
    scene
}

/// The record of a rig with a fault after some seconds.
fn record(scene: &Scene, fault: RigFault, seconds: f64) -> Record {
    let mut rig = faulty(scene, fault, seconds, |_| {}).unwrap();
    let mut controller = BuiltIn::new(&scene.controller_config()).unwrap();
    experiment::run(&mut rig, &mut controller, &Plan::of(scene), |_, _, _| {}).unwrap()
}

#[test]
fn a_sensor_that_dies_after_the_release_is_an_error() {
    for settings in [&[][..], &["chain.adc_bits=14"], &["chain.snr=40"]] {
        let scene = scene(settings);
        let healthy = record(&scene, RigFault::Swapped, f64::INFINITY);
        identify(&healthy, &scene).unwrap();
        let release = healthy.released as f64 * healthy.sample_time;
        for fault in [
            RigFault::Response(SensorFault::Dead),
            RigFault::Response(SensorFault::Frozen),
            RigFault::Response(SensorFault::Value(f64::NAN)),
            RigFault::Base(SensorFault::Value(f64::NAN)),
        ] {
            let failed = record(&scene, fault, release + 0.5);
            let refused = identify(&failed, &scene);
            let is_named = matches!(refused, Err(IdentificationError::SensorAfterRelease { seconds, .. }) if (seconds - 0.5).abs() < 0.25);
            assert!(is_named, "{settings:?}, {fault:?}");
        }
    }
}

#[test]
fn a_base_that_becomes_late_while_the_lock_is_held_is_an_error() {
    let scene = scene(&[]);
    let healthy = record(&scene, RigFault::Swapped, f64::INFINITY);
    let settled = (healthy.settled + 2) as f64 * healthy.sample_time;
    let late = record(&scene, RigFault::Base(SensorFault::Late(3)), settled);
    let refused = identify(&late, &scene).unwrap_err();
    assert!(matches!(refused, IdentificationError::OffTarget { .. }), "{refused}");
    println!("{refused}");
}
