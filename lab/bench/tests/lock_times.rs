//! How fast the phase locks on the default plant, over the one tuning knob.

use vines_testbench::rig::{BuiltIn, Controller, Rig, Simulated};
use vines_testbench::scene::{Override, Scene};

/// Bandwidths, in units of omega0, and periods to a phase lock that are reported for this rule of gains on such a plant, twenty of
/// them dwell (the tolerance of the phase is not).
const REPORTED: [(f64, f64); 5] = [(0.02, 234.0), (0.05, 102.0), (0.1, 55.0), (0.2, 35.0), (0.5, 25.0)];

/// Periods until the phase has stayed within `tolerance` degrees for twenty of them, whatever the amplitude does.
fn periods(bandwidth: f64, tolerance: f64) -> f64 {
    let settings = [
        format!("controller.bandwidth={bandwidth:?}"),
        format!("controller.phase_tolerance={tolerance:?}"),
        "controller.frequency_tolerance=0.32".into(),
        "controller.amplitude_tolerance=27.0".into(),
        "controller.approach_gain=0.0".into(),
        // The largest bandwidth needs more than a hundred samples a period.
        "controller.samples_per_period=200.0".into(),
    ];
    let overrides: Vec<Override> = settings.iter().map(|s| s.parse().unwrap()).collect();
    let scene = Scene::load(None, &overrides).unwrap();
    let mut rig = Simulated::new(scene.plant, scene.start).unwrap();
    let mut controller = BuiltIn::new(&scene.controller_config()).unwrap();
    let step = scene.sample_time();
    let mut turns = 0.0;
    while turns < 400.0 {
        let command = controller.sample(rig.sense().unwrap(), true).unwrap();
        if command.settled {
            return turns;
        }
        rig.advance(command.drive, step).unwrap();
        turns += command.drive.omega * step / std::f64::consts::TAU;
    }
    panic!("no phase lock at {bandwidth}");
}

#[test]
fn the_phase_locks_about_as_fast_as_reported_and_faster_the_wider_the_detector() {
    println!("wLP/omega0  reported  within 2 deg  within 5 deg");
    let mut before = f64::INFINITY;
    for (bandwidth, reported) in REPORTED {
        let (narrow, wide) = (periods(bandwidth, 2.0), periods(bandwidth, 5.0));
        println!("{bandwidth:10} {reported:9} {narrow:13.0} {wide:13.0}");
        // A detector faster than the response grows from rest cannot lock before that has grown.
        assert!(narrow <= reported.max(30.0) * 1.4, "{bandwidth}: {narrow}");
        assert!(narrow < before);
        before = narrow;
    }
}
