//! Guards the fast path against the plain solver: impacts, states, and the work near a wall.

mod common;

use common::{Scene, scene};
use lovines::{Drive, Parameters, Plant, State};
use proptest::prelude::*;
use std::f64::consts::TAU;

/// The same plant without its fast path.
fn plain(plant: &Plant) -> Plant {
    let mut plain = *plant;
    plain.set_fast_path(false);
    plain
}

fn distance(a: &Plant, b: &Plant) -> f64 {
    let (a, b) = (a.state(), b.state());
    [a.q1 - b.q1, a.dq1 - b.dq1, a.q2 - b.q2, a.dq2 - b.dq2]
        .iter()
        .fold(0.0f64, |worst, x| worst.max(x.abs()))
}

#[test]
fn crossings_meet_the_impacts_of_the_plain_search() {
    for (lambda, r, omega) in [(1.43, 0.65, 0.990_417), (0.8, 0.5, 0.994), (2.0, 0.8, 0.985)] {
        let parameters = Parameters::dimensionless(0.0084, lambda, r);
        let start = State { q1: -0.42, dq1: 0.01, q2: -0.99, dq2: -0.86 };
        let drive = Drive::harmonic(0.0084 * 1.1, omega);
        let mut fast = Plant::new(parameters, start).unwrap();
        let mut searched = plain(&fast);
        for _ in 0..200 {
            fast.advance(drive, TAU / omega).unwrap();
            searched.advance(drive, TAU / omega).unwrap();
            let off = distance(&fast, &searched);
            assert!(off < 1e-12, "{off:e} after {:?}", fast.totals());
        }
        assert_eq!(fast.totals().impacts, searched.totals().impacts);
        assert!(fast.totals().impacts > 300);
    }
}

#[test]
fn a_wall_that_is_nearly_touched_makes_only_a_short_part_of_a_long_flight_costly() {
    let omega = 1.0 - 0.0084 * 4.4;
    let drive = Drive::harmonic(0.0084 * 1.4, omega);
    let start = State { q1: -0.0233, dq1: 0.1524, q2: -0.8405, dq2: 5.8e-4 };
    let mut fast = Plant::new(Parameters::dimensionless(0.0084, 1.43, 0.65), start).unwrap();
    let mut searched = plain(&fast);
    let periods = 200.0;
    let outcome = fast.advance(drive, periods * TAU / omega).unwrap();
    let all = searched.advance(drive, periods * TAU / omega).unwrap();
    assert!(distance(&fast, &searched) < 1e-13 && outcome.impacts == 0);
    let evaluations = (outcome.evaluations, all.evaluations);
    assert!(
        (evaluations.0 as f64) < 0.5 * periods && evaluations.1 as f64 > 2.0 * periods,
        "{evaluations:?}"
    );
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(1000) })]

    #[test]
    fn the_first_impacts_of_any_scene_are_those_of_the_plain_search(s in scene(true)) {
        agree(&s, 20, s.step.min(1.0), |_| s.drive)?;
    }

    #[test]
    fn a_drive_that_changes_at_every_sample_meets_the_impacts_of_the_plain_search(
        s in scene(true), step in 0.005..0.12f64, change in -6.0..0.5f64, what in 1..16u8,
    ) {
        // Any selection of offset, slope, amplitude and frequency changes.
        let changed = |n: u32, which: u8| {
            let part = (f64::from(n * 4 + u32::from(which)) * 0.618_033_988_749_895).fract() - 0.5;
            if what >> which & 1 == 1 { 10f64.powf(change) * part } else { 0.0 }
        };
        agree(&s, 60, step, |n| Drive {
            signal: [s.drive.signal[0] + 0.1 * changed(n, 0), 0.1 * changed(n, 1), 0.0, 0.0],
            amplitude: s.drive.amplitude * (1.0 + changed(n, 2)),
            omega: s.drive.omega * (1.0 + changed(n, 3)),
        })?;
    }
}

/// Follows a scene with and without the fast path. Impacts drive neighbours apart: only while there are few does a small distance mean
/// agreement.
fn agree(s: &Scene, steps: u32, step: f64, drive: impl Fn(u32) -> Drive) -> Result<(), TestCaseError> {
    let mut fast = Plant::new(s.parameters, s.start).unwrap();
    let mut searched = plain(&fast);
    for n in 0..steps {
        fast.advance(drive(n), step).unwrap();
        searched.advance(drive(n), step).unwrap();
        if fast.totals().impacts.max(searched.totals().impacts) > 3 {
            break;
        }
        prop_assert_eq!(fast.totals().impacts, searched.totals().impacts);
        let state = searched.state();
        let size = 1.0
            + [state.q1, state.dq1, state.q2, state.dq2]
                .iter()
                .fold(0.0f64, |a, x| a.max(x.abs()));
        prop_assert!(
            distance(&fast, &searched) <= 1e-10 * size,
            "{:e}",
            distance(&fast, &searched)
        );
    }
    Ok(())
}

#[test]
fn equal_steps_follow_a_drive_that_becomes_fast() {
    let parameters = Parameters::dimensionless(0.0084, 1.43, 0.65);
    let start = State { q1: 0.3, dq1: 0.1, q2: 0.2, dq2: 0.0 };
    let mut fast = Plant::new(parameters, start).unwrap();
    let mut searched = plain(&fast);
    for omega in [1.0, 1.1, 40.0, 0.9, 300.0] {
        for _ in 0..5 {
            let drive = Drive::harmonic(0.01, omega);
            fast.advance(drive, 0.06).unwrap();
            searched.advance(drive, 0.06).unwrap();
            assert!(
                distance(&fast, &searched) < 1e-13,
                "{omega}: {:e}",
                distance(&fast, &searched)
            );
        }
    }
}

#[test]
fn steps_whose_lengths_have_rounding_errors_are_as_exact_as_equal_ones() {
    let parameters = Parameters::dimensionless(0.0084, 1.43, 0.65);
    let start = State { q1: -0.42, dq1: 0.01, q2: -0.99, dq2: -0.86 };
    let signals = [
        [0.0; 4],
        [0.01, 0.0, 0.0, 0.0],
        [0.01, -0.002, 0.0, 0.0],
        [0.01, -0.002, 1e-4, 0.0],
    ];
    for (signal, error) in signals
        .into_iter()
        .flat_map(|signal| [1e-15, 1e-12, 9e-10].map(|error| (signal, error)))
    {
        let drive = Drive { signal, ..Drive::harmonic(0.0084 * 1.1, 0.990_417) };
        let mut fast = Plant::new(parameters, start).unwrap();
        let mut searched = plain(&fast);
        for n in 0..400 {
            let step = 0.06 * (1.0 + error * f64::from(n % 5 - 2));
            fast.advance(drive, step).unwrap();
            searched.advance(drive, step).unwrap();
            assert!(
                distance(&fast, &searched) < 1e-12,
                "{signal:?} {error:e}: {:e}",
                distance(&fast, &searched)
            );
        }
        assert_eq!(fast.totals().impacts, searched.totals().impacts);
    }
}
