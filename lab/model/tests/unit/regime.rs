//! Tests of `regime`.

use std::f64::consts::TAU;

use super::*;

fn impacts(pattern: &[(f64, f64)], periods: usize, repeats: usize) -> Vec<Impact> {
    (0..repeats)
        .flat_map(|n| {
            pattern.iter().map(move |(phase, wall)| Impact {
                time: phase + TAU * (n * periods) as f64,
                velocity: 1.5 * wall,
            })
        })
        .collect()
}

#[test]
fn captures_are_long_runs_in_step() {
    let even = impacts(&[(0.3, 1.0), (0.3 + PI, -1.0)], 1, 10);
    assert_eq!(synchrony(&even), 1.0);
    // Of twelve impacts in step and eight on the same wall, the first count.
    let mut mixed = impacts(&[(0.3, 1.0), (0.3 + PI, -1.0)], 1, 6);
    mixed.extend((0..8).map(|n| Impact { time: 40.0 + 0.7 * f64::from(n), velocity: 0.2 }));
    assert!((synchrony(&mixed) - 0.6).abs() < 1e-12);
    assert_eq!(synchrony(&[]), 0.0);
}

#[test]
fn even_intervals_are_symmetric_and_uneven_ones_are_not() {
    let even = impacts(&[(0.3, 1.0), (0.3 + PI, -1.0)], 1, 20);
    assert_eq!(one_to_one(&even, 2.0, MEASURED), Regime::Symmetric);
    let uneven = impacts(&[(0.3, 1.0), (0.5 + PI, -1.0)], 1, 20);
    assert_eq!(one_to_one(&uneven, 2.0, MEASURED), Regime::Asymmetric);
}

#[test]
fn three_impacts_or_one_wall_are_not_one_to_one() {
    let even = impacts(&[(0.3, 1.0), (0.3 + PI, -1.0)], 1, 20);
    assert_eq!(one_to_one(&even, 3.0, MEASURED), Regime::Other);
    let same = impacts(&[(0.3, 1.0), (0.3 + PI, 1.0)], 1, 20);
    assert_eq!(one_to_one(&same, 2.0, MEASURED), Regime::Other);
}

#[test]
fn synchrony_ends_at_the_first_interval_that_jumps() {
    let mut sequence = impacts(&[(0.0, 1.0), (PI, -1.0)], 1, 5);
    assert_eq!(end_of_synchrony(&sequence, PI), Some(9.0 * PI));
    sequence[6].time += 1.0;
    assert_eq!(end_of_synchrony(&sequence, PI), Some(5.0 * PI));
    assert_eq!(end_of_synchrony(&[], PI), None);
}
