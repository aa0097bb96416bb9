//! The quick ways against the general search, and against each other.

mod common;

use common::scene;
use lovines::{Drive, Parameters, Plant, State};
use proptest::prelude::*;
use std::f64::consts::TAU;

/// The same drive, but for a slope too small to matter, which the quick way leaves to the general search.
fn slowly(drive: Drive) -> Drive {
    let [offset, ..] = drive.signal;
    Drive {
        signal: [offset, 0.0, 0.0, 1e-300],
        ..drive
    }
}

fn distance(a: &Plant, b: &Plant) -> f64 {
    let (a, b) = (a.state(), b.state());
    [a.q1 - b.q1, a.dq1 - b.dq1, a.q2 - b.q2, a.dq2 - b.dq2]
        .iter()
        .fold(0.0f64, |worst, x| worst.max(x.abs()))
}

#[test]
fn crossings_meet_the_impacts_of_the_general_search() {
    for (lambda, r, omega) in [
        (1.43, 0.65, 0.990_417),
        (0.8, 0.5, 0.994),
        (2.0, 0.8, 0.985),
    ] {
        let parameters = Parameters::dimensionless(0.0084, lambda, r);
        let start = State {
            q1: -0.42,
            dq1: 0.01,
            q2: -0.99,
            dq2: -0.86,
        };
        let drive = Drive::harmonic(0.0084 * 1.1, omega);
        let mut quick = Plant::new(parameters, start).unwrap();
        let mut general = quick;
        for _ in 0..200 {
            quick.advance(drive, TAU / omega);
            general.advance(slowly(drive), TAU / omega);
            let off = distance(&quick, &general);
            assert!(off < 1e-12, "{off:e} after {:?}", quick.tally());
        }
        assert_eq!(quick.tally().impacts, general.tally().impacts);
        assert!(quick.tally().impacts > 300);
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(1000) })]

    #[test]
    fn the_first_impacts_of_any_scene_are_those_of_the_general_search(s in scene(true)) {
        let mut quick = Plant::new(s.parameters, s.start).unwrap();
        let mut general = quick;
        // Impacts drive neighbours apart: only while there are few does a small distance mean agreement.
        let step = s.step.min(1.0);
        for _ in 0..20 {
            quick.advance(s.drive, step);
            general.advance(slowly(s.drive), step);
            if quick.tally().impacts.max(general.tally().impacts) > 3 {
                break;
            }
            prop_assert_eq!(quick.tally().impacts, general.tally().impacts);
            let state = general.state();
            let size = 1.0 + [state.q1, state.dq1, state.q2, state.dq2].iter().fold(0.0f64, |a, x| a.max(x.abs()));
            prop_assert!(distance(&quick, &general) <= 1e-10 * size, "{:e}", distance(&quick, &general));
        }
    }
}

#[cfg(feature = "batch")]
mod batch {
    use super::*;
    use lovines::batch::Batch;

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(20) })]

        #[test]
        fn a_batch_gives_the_same_bits_twice_and_agrees_with_each_plant_alone(
            scenes in proptest::collection::vec(scene(true), 50), step in 0.1..40.0f64,
        ) {
            let plants: Vec<_> = (scenes.iter())
                .map(|s| (Plant::new(s.parameters, s.start).unwrap(), s.drive))
                .collect();
            let mut batch = Batch::new(plants.iter().copied());
            let mut twin = batch.clone();
            let drives: Vec<_> = plants.iter().map(|(_, drive)| *drive).collect();
            for _ in 0..10 {
                // Impacts drive neighbours apart: each plant alone begins every step where the batch does.
                let mut alone: Vec<_> = batch.plants().copied().collect();
                batch.advance(step);
                twin.advance_on_one_core(step);
                for (n, (together, twin)) in batch.plants().zip(twin.plants()).enumerate() {
                    prop_assert_eq!(together.state(), twin.state());
                    let outcome = alone[n].advance(drives[n], step);
                    if outcome.impacts <= 3 {
                        let state = alone[n].state();
                        let size = 1.0 + state.dq1.abs() + state.q1.abs();
                        prop_assert!(distance(together, &alone[n]) <= 1e-12 * size);
                        prop_assert_eq!(together.tally().impacts, alone[n].tally().impacts);
                    }
                }
            }
        }
    }

    #[test]
    fn a_steady_batch_gives_each_plant_the_bits_it_would_get_alone() {
        let omega = 0.990_417;
        let plants = |n: u32| {
            (0..n).map(move |k| {
                let parameters =
                    Parameters::dimensionless(0.0084, 1.43 + 1e-3 * f64::from(k), 0.65);
                let start = State {
                    q1: -0.42,
                    dq1: 0.01,
                    q2: -0.99,
                    dq2: -0.86,
                };
                (
                    Plant::new(parameters, start).unwrap(),
                    Drive::harmonic(0.0084 * 1.1, omega),
                )
            })
        };
        let (mut all, mut one) = (Batch::new(plants(100)), Batch::new(plants(100)));
        all.advance(100.0 * TAU / omega);
        one.advance_on_one_core(100.0 * TAU / omega);
        for ((a, b), (mut alone, drive)) in all.plants().zip(one.plants()).zip(plants(100)) {
            alone.advance(drive, 100.0 * TAU / omega);
            assert_eq!(a.state(), b.state());
            assert_eq!(a.state(), alone.state());
            assert!(a.tally().impacts > 190);
        }
    }
}
