//! Tests of the loop filter.

use super::*;

const FILTER: LoopFilter = LoopFilter {
    gains: Gains { proportional: 1.0, integral: 5.0 },
    omega_min: 9.0,
    omega_max: 11.0,
    max_change: f64::INFINITY,
    sample_time: 0.01,
};

#[test]
fn a_saturated_loop_recovers_within_one_sample() {
    let mut frequency = Frequency::at(10.0);
    for _ in 0..100_000 {
        FILTER.follow(&mut frequency, 2.0);
        assert!(frequency.omega <= 11.0 && frequency.integral.get() <= 11.0);
    }
    assert_eq!(frequency.omega, 11.0);
    FILTER.follow(&mut frequency, -0.5);
    assert!(frequency.omega < 11.0 - 0.4, "{frequency:?}");
}

#[test]
fn a_limited_rate_causes_no_windup() {
    let filter = LoopFilter { max_change: 1e-3, ..FILTER };
    let mut frequency = Frequency::at(10.0);
    for _ in 0..100 {
        let before = frequency.omega;
        filter.follow(&mut frequency, 0.8);
        assert!((frequency.omega - before).abs() <= 1e-3 + 1e-15);
    }
    assert_eq!(frequency.integral.get(), 10.0);
}

#[test]
fn a_negative_error_lowers_the_frequency() {
    let mut frequency = Frequency::at(10.0);
    FILTER.follow(&mut frequency, -0.1);
    assert!(frequency.omega < 10.0 && frequency.integral.get() < 10.0);
}
