//! Unit tests of the regime of a sequence of impacts.

use std::f64::consts::TAU;

use super::*;

/// Impacts at phases of a period, rad, on walls, repeated.
fn impacts(pattern: [(f64, f64); 2], repeats: usize) -> Vec<Impact> {
    let period = |n: usize| pattern.map(|(phase, wall)| Impact { time: phase + TAU * n as f64, velocity: 1.5 * wall });
    (0..repeats).flat_map(period).collect()
}

#[test]
fn captures_are_long_runs_in_step() {
    let even = [(0.3, 1.0), (0.3 + PI, -1.0)];
    assert_eq!(synchrony(&impacts(even, 10)), 1.0);
    // Of twelve impacts in step and eight on the same wall, the first count.
    let mut mixed = impacts(even, 6);
    mixed.extend((0..8).map(|n| Impact { time: 40.0 + 0.7 * f64::from(n), velocity: 0.2 }));
    assert!((synchrony(&mixed) - 0.6).abs() < 1e-12);
    assert_eq!(synchrony(&[]), 0.0);
}

#[test]
fn one_to_one_is_two_impacts_per_period_on_both_walls_and_symmetric_at_even_intervals() {
    for (second, wall, per_period, regime) in [
        (0.3, -1.0, 2.0, Regime::Symmetric),
        (0.5, -1.0, 2.0, Regime::Asymmetric),
        (0.3, -1.0, 3.0, Regime::Other),
        (0.3, 1.0, 2.0, Regime::Other),
    ] {
        let impacts = impacts([(0.3, 1.0), (second + PI, wall)], 20);
        assert_eq!(one_to_one(&impacts, per_period, MEASURED), regime);
    }
}

#[test]
fn synchrony_ends_at_the_first_interval_that_jumps() {
    let mut sequence = impacts([(0.0, 1.0), (PI, -1.0)], 5);
    assert_eq!(end_of_synchrony(&sequence, PI), Some(9.0 * PI));
    sequence[6].time += 1.0;
    assert_eq!(end_of_synchrony(&sequence, PI), Some(5.0 * PI));
    assert_eq!(end_of_synchrony(&[], PI), None);
}
