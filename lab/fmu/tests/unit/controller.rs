//! Whether the lock of a foreign controller has settled.

use super::*;

#[test]
fn a_lock_has_settled_after_a_dwell_without_a_change() {
    let config = Config { sample_time: 0.01 * TAU, ..Config::for_resonance(1.0, 1.0) };
    let mut judge = Judge::new(&config);
    let periods = config.lock.dwell as usize;
    let mut count = |omega: f64, error: f64, locked: bool| {
        (0..100 * (periods + 1)).position(|_| judge.sample(omega, error, locked))
    };
    assert_eq!(count(1.0, 0.0, false), None);
    assert_eq!(count(1.0, 0.1, true), None, "not in phase");
    let first = count(1.0, 0.0, true).unwrap();
    assert!(first.abs_diff(100 * periods) <= 2, "{first}");
    // Another frequency starts anew.
    let again = count(1.01, 0.0, true).unwrap();
    assert!(again.abs_diff((100.0 * periods as f64 / 1.01) as usize) <= 2, "{again}");
    let mut drifting = Judge::new(&config);
    assert!((0..100 * (periods + 1)).all(|n| !drifting.sample(1.0 + 1e-5 * n as f64, 0.0, true)));
}
