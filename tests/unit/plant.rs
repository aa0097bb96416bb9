//! Tests of `plant`.

use crate::plant::Saved;
use crate::{Cavity, Drive, Parameters, Plant, State};
use proptest::prelude::*;

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Steps of few lengths, so that all caches are used, under a drive that stays, changes or has a slope, in an ideal or a real cavity.
    #[test]
    fn a_workspace_dropped_at_any_time_changes_no_bit(
        steps in prop::collection::vec((0usize..5, any::<bool>()), 300),
        wobble in prop_oneof![Just(0.0), 1e-6..1e-2f64],
        slope in prop_oneof![3 => Just(0.0), 1 => 0.0..1e-3f64],
        g in 0.5..3.0f64,
        real in any::<bool>(),
        (mu, tilt, scatter) in (0.0..0.003f64, -0.002..0.002f64, 0.0..0.1f64),
    ) {
        let start = State { q1: -0.42, dq1: 0.01, q2: -0.99, dq2: -0.86 };
        let mut parameters = Parameters::dimensionless(0.0084, 1.43, 0.65);
        if real {
            parameters.cavity = Cavity { kinetic_friction: mu, tilt, scatter, ..Cavity::IDEAL };
        }
        let mut plant = Plant::new(parameters, start).unwrap();
        let mut other = plant;
        let mut n = 0;
        for (length, drop) in steps {
            let step = [0.063, 0.3, 1.7, 6.3, 6.344][length];
            // Equal steps in a row, as masters make them.
            for _ in 0..3 {
                n += 1;
                let omega = 0.990_417 + wobble * f64::from(n % 7);
                let drive = Drive { signal: [0.0, slope, 0.0, 0.0], ..Drive::harmonic(0.0084 * g, omega) };
                if drop {
                    // All that is not state is lost on the way.
                    let saved = postcard::to_stdvec(&other).unwrap();
                    other = postcard::from_bytes(&saved).unwrap();
                }
                prop_assert_eq!(plant.advance(drive, step), other.advance(drive, step));
                prop_assert_eq!(plant.state(), other.state(), "step {}", n);
            }
        }
        prop_assert!(plant.totals().impacts > 10);
        prop_assert_eq!(plant.totals(), other.totals());
    }
}

#[test]
fn plants_that_take_turns_in_one_workspace_have_the_bits_of_plants_of_their_own() {
    let start = State { q1: -0.42, dq1: 0.01, q2: -0.99, dq2: -0.86 };
    let mut plants: Vec<Plant> = (0..12)
        .map(|n| {
            let parameters = Parameters::dimensionless(0.0084, 1.43 + f64::from(n / 4), 0.5 + 0.04 * f64::from(n));
            Plant::new(parameters, start).unwrap()
        })
        .collect();
    let mut saved: Vec<Saved> = plants.iter().map(Plant::save).collect();
    let mut workspace = plants[0];
    for step in 0..400 {
        let duration = [0.063, 0.063, 0.063, 6.3, 1.7][step % 5];
        for (n, (plant, saved)) in plants.iter_mut().zip(&mut saved).enumerate() {
            let drive = Drive::harmonic(
                0.0084 * (1.0 + 0.2 * n as f64),
                0.99 + 0.03 * (step / 50 * (n % 3)) as f64,
            );
            workspace.restore(saved);
            assert_eq!(plant.advance(drive, duration), workspace.advance(drive, duration));
            *saved = workspace.save();
            assert_eq!(plant.state(), workspace.state(), "plant {n}, step {step}");
        }
    }
    assert!(plants.iter().all(|plant| plant.totals().impacts > 10));
    assert!(size_of::<Saved>() <= 704, "{}", size_of::<Saved>());
}

#[test]
fn a_state_that_was_set_has_the_bits_of_a_start_from_it() {
    let drive = Drive::held(0.0);
    let start = State { q1: 0.3, dq1: -0.4, q2: -0.7, dq2: 0.2 };
    let parameters = Parameters::dimensionless(0.0084, 1.43, 0.65);
    let mut plant = Plant::new(parameters, State { dq2: 0.5, ..State::default() }).unwrap();
    for step in [0.063, 6.3, 100.0] {
        plant.advance(drive, 50.0).unwrap();
        plant.set_state(start).unwrap();
        let mut other = Plant::new(parameters, start).unwrap();
        plant.advance(drive, step).unwrap();
        other.advance(drive, step).unwrap();
        assert_eq!(plant.state(), other.state());
    }
    let before = plant.state();
    assert!(plant.set_state(State { q1: 3.0, ..State::default() }).is_err());
    assert_eq!(plant.state(), before);
}
