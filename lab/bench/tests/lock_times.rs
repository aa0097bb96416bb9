//! How fast the phase locks on the default plant, over the one tuning parameter; `vines check --lock-times` prints the table.

use vines_testbench::loop_check::lock_times;
use vines_testbench::scene::Scene;

#[test]
fn the_phase_of_a_steady_motion_locks_as_fast_as_reported_and_faster_the_wider_the_detector() {
    let mut before = f64::INFINITY;
    for time in lock_times(&Scene::load(None, &[]).unwrap()).unwrap() {
        println!("{time:?}");
        let (from_start, from_motion) = (time.from_start.unwrap(), time.from_motion.unwrap());
        // The criterion counts whole periods.
        assert!(from_motion.round() <= time.reported + 1.0, "{time:?}");
        assert!(from_motion < before);
        // From rest the response grows and the impacts find their rhythm first, for about 15 periods.
        assert!((0.0..=20.0).contains(&(from_start - from_motion)), "{time:?}");
        before = from_motion;
    }
}
