//! Guards how fast the phase locks on the default plant, over the one tuning parameter; `studies/lock_times.rs` writes the table.

use vines_testbench::rig::{BuiltIn, Controller, Rig, Simulated};
use vines_testbench::scene::Scene;

/// Periods until `ends` says so of a settled loop, at most 800.
fn run(rig: &mut Simulated, scene: &Scene, ends: impl Fn(bool) -> bool) -> f64 {
    let mut controller = BuiltIn::new(&scene.controller_config()).unwrap();
    let (step, mut periods) = (scene.sample_time(), 0.0);
    while periods < 800.0 {
        let command = controller.sample(rig.sense().unwrap(), true).unwrap();
        if ends(command.settled) {
            break;
        }
        rig.advance(command.drive, step).unwrap();
        periods += command.drive.omega * step / std::f64::consts::TAU;
    }
    periods
}

#[test]
fn the_phase_of_a_steady_motion_locks_as_fast_as_reported_and_faster_the_wider_the_detector() {
    let settings = [
        "controller.phase_tolerance=2.0",
        "controller.dwell_periods=20",
        // Only the phase is to settle.
        "controller.frequency_tolerance=0.22",
        "controller.amplitude_tolerance=27.0",
        // The largest bandwidth needs more than a hundred samples per period.
        "controller.samples_per_period=200",
    ];
    let settings = settings.map(|one| one.parse().unwrap());
    let mut scene = Scene::load(None, &settings).unwrap();
    let start = Simulated::new(scene.plant, scene.start).unwrap();
    let mut motion = start.clone();
    run(&mut motion, &scene, |_| false);
    let mut before = f64::INFINITY;
    // Bandwidths over omega0, and the periods that are published for this rule of gains on such a plant.
    for (bandwidth, published) in [(0.02, 234.0), (0.05, 102.0), (0.1, 55.0), (0.2, 35.0), (0.5, 25.0)] {
        scene.controller.bandwidth = bandwidth;
        let [from_start, from_motion] = [&start, &motion].map(|rig| run(&mut rig.clone(), &scene, |settled| settled));
        println!("{bandwidth}: {from_start:.0} periods from the start, {from_motion:.0} from the motion");
        // The criterion counts whole periods.
        assert!(from_motion.round() <= published + 1.0 && from_motion < before);
        // From rest the response grows and the impacts find their rhythm first, for about 15 periods.
        assert!((0.0..=20.0).contains(&(from_start - from_motion)));
        before = from_motion;
    }
}
