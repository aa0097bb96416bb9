//! What holds for every rig, start and excitation.

#[path = "common/balance.rs"]
mod balance;
mod common;

use balance::walk;
use common::scene;
use lovines::{Drive, Event, Parameters, Plant, State, Wall};
use proptest::prelude::*;

const STEPS: usize = 30;

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(500) })]

    #[test]
    fn the_particle_never_leaves_its_cavity_and_nothing_is_ever_nan(s in scene(true)) {
        let mut plant = Plant::new(s.parameters, s.start).unwrap();
        for _ in 0..STEPS {
            plant.advance_with(s.drive, s.step, |event| if let Event::Impact { wall, velocity, .. } = event {
                assert!(wall.sign() * velocity > 0.0, "an impact from behind the wall");
            }).unwrap();
            let state = plant.state();
            prop_assert!([state.q1, state.dq1, state.q2, state.dq2].iter().all(|x| x.is_finite()));
            prop_assert!(plant.relative_displacement().abs() <= 1.0);
        }
    }

    #[test]
    fn inside_steps_the_particle_stays_in_its_cavity_and_damper_and_base_account_for_the_energy(
        s in any::<bool>().prop_flat_map(scene),
    ) {
        let found = walk(&s, 200);
        prop_assert!(found.outside <= 1e-12, "outside by {:e} half-widths", found.outside);
        prop_assert!(found.imbalance <= 1e-12, "the energy balance misses {:e}", found.imbalance);
    }

    #[test]
    fn without_excitation_energy_never_grows_and_impacts_account_for_their_share(s in scene(false)) {
        let mut plant = Plant::new(s.parameters, s.start).unwrap();
        let at_start = plant.energy(0.0);
        let mut before = at_start;
        for _ in 0..STEPS {
            plant.advance(s.drive, s.step).unwrap();
            let (now, dissipated) = (plant.energy(0.0), plant.totals().dissipated);
            prop_assert!(now <= before + 1e-13 * at_start, "{before} -> {now}");
            prop_assert!(now + dissipated <= at_start * (1.0 + 1e-12));
            if s.parameters.damping == 0.0 {
                prop_assert!((now + dissipated - at_start).abs() <= 1e-12 * at_start);
            }
            before = now;
        }
    }

    #[test]
    fn the_same_run_gives_the_same_bits(s in scene(true)) {
        let run = || {
            let mut plant = Plant::new(s.parameters, s.start).unwrap();
            for _ in 0..STEPS {
                plant.advance(s.drive, s.step).unwrap();
            }
            let x = plant.state();
            [x.q1, x.dq1, x.q2, x.dq2].map(f64::to_bits)
        };
        prop_assert_eq!(run(), run());
    }
}

#[test]
fn one_long_step_and_many_short_ones_end_in_the_same_state() {
    let parameters = Parameters::dimensionless(0.0084, 1.43, 0.65);
    let start = State { q1: -0.42, dq1: 0.01, q2: -0.99, dq2: -0.86 };
    let drive = Drive::harmonic(0.0084 * 1.1, 0.990_417);
    // 2^-4 is exact, so that both runs mean the same instant: a thousand periods, 100 steps each.
    let (step, steps) = (0.0625, 101_504);
    let mut long = Plant::new(parameters, start).unwrap();
    let outcome = long.advance(drive, step * f64::from(steps)).unwrap();
    let mut short = Plant::new(parameters, start).unwrap();
    for _ in 0..steps {
        short.advance(drive, step).unwrap();
    }
    assert_eq!(outcome.impacts, short.totals().impacts);
    let (a, b) = (long.state(), short.state());
    let worst = [a.q1 - b.q1, a.dq1 - b.dq1, a.q2 - b.q2, a.dq2 - b.dq2]
        .iter()
        .fold(0.0f64, |worst, x| worst.max(x.abs()));
    println!("{} impacts, difference {worst:.2e}", outcome.impacts);
    assert!(worst < 1e-12, "{worst:e}");
}

#[test]
fn a_grazing_overshoot_of_1e_13_is_caught_and_an_undershoot_is_not_reported() {
    // Undamped and unforced: q1 = A cos t, the particle at rest at the centre; the first extreme is at t = π.
    let parameters = Parameters { damping: 0.0, ..Parameters::dimensionless(0.01, 0.0, 0.65) };
    for exponent in 2..=13 {
        let delta = 10f64.powi(-exponent);
        let impacts = |amplitude: f64, step: f64| {
            let start = State { q1: 0.0, dq1: amplitude, q2: 0.0, dq2: 0.0 };
            let mut plant = Plant::new(parameters, start).unwrap();
            for _ in 0..(2.0 / step) as usize {
                plant.advance(Drive::default(), step).unwrap();
            }
            plant.totals().impacts
        };
        for step in [2.0, 0.5, 0.01] {
            assert!(impacts(1.0 + delta, step) > 0, "overshoot {delta:e} in steps of {step}");
            assert_eq!(impacts(1.0 - delta, step), 0, "undershoot {delta:e} in steps of {step}");
        }
    }
}

#[test]
fn a_particle_at_rest_on_the_wall_is_held_let_go_and_caught_again() {
    // The base is dragged: the wall pushes the particle, then draws away from it.
    let parameters = Parameters::dimensionless(0.1, 1.0, 0.3);
    let start = State { q1: 0.0, dq1: 0.0, q2: -1.0, dq2: 0.0 };
    let mut plant = Plant::new(parameters, start).unwrap();
    let mut events = Vec::new();
    plant
        .advance_with(Drive::held(2.0), 60.0, |event| events.push(event))
        .unwrap();
    assert!(matches!(events[0], Event::Stuck { t: 0.0, wall: Wall::Plus }));
    assert!(matches!(events[1], Event::Released { wall: Wall::Plus, .. }));
    assert!(matches!(events[2], Event::Impact { .. }));
    // Undamped it would let go when the acceleration of the joint mass is 0, a quarter of its period on; damping delays that.
    let Event::Released { t, .. } = events[1] else {
        unreachable!()
    };
    assert!(t > 1.5 && t < 2.0, "released at {t}");
}

/// A particle at rest on the wall at w = +b, and the wall as the drive leaves it.
fn pressed(parameters: Parameters, drive: Drive, duration: f64) -> Plant {
    let mut plant = Plant::new(parameters, State { q2: -1.0, ..State::default() }).unwrap();
    plant.advance(drive, duration).unwrap();
    assert_eq!(plant.contact(), Some(Wall::Plus));
    plant
}

#[test]
fn a_wall_that_a_changed_drive_pulls_away_without_a_jump_lets_go_at_once() {
    let parameters = Parameters { damping: 4.0, ..Parameters::dimensionless(0.1, 0.0, 0.5) };
    let drive = |signal, amplitude, omega| Drive { signal, amplitude, omega };
    let ramp = drive([0.0, 1.0, 0.0, 0.0], 0.0, 0.0);
    // The base stops; it curves downwards as well; its oscillator, passing through 0, slows down. In each case the wall draws away,
    // and ever more slowly.
    for (before, after, since) in [
        (ramp, drive([1.0, 0.0, 0.0, 0.0], 0.0, 0.0), 1.0),
        (ramp, drive([1.0, -0.3, 0.2, 0.1], 0.0, 0.0), 1.0),
        (drive([0.0; 4], 1.0, 1.0), drive([0.0; 4], 1.0, 0.1), 0.25),
    ] {
        let mut plant = pressed(parameters, before, since);
        let speed = plant.state().dq2;
        let mut events = Vec::new();
        (plant.advance_with(after, 0.25, |event| events.push(event))).unwrap();
        assert_eq!(events, [Event::Released { t: 0.0, wall: Wall::Plus }], "{after:?}");
        assert_eq!(plant.state().dq2, speed, "the particle flies on: {after:?}");
    }
}

#[test]
fn a_release_at_the_very_end_of_a_step_says_nothing_about_another_drive_or_other_parameters() {
    let parameters = Parameters { damping: 4.0, ..Parameters::dimensionless(0.1, 0.0, 0.5) };
    let start = pressed(parameters, Drive::held(2.0), 0.0);
    let mut end = f64::NAN;
    let mut longer = start;
    let until = |event| {
        if let Event::Released { t, .. } = event {
            end = end.min(t);
        }
    };
    longer.advance_with(Drive::held(2.0), 60.0, until).unwrap();
    let released = || {
        let mut plant = start;
        assert_eq!(plant.advance(Drive::held(2.0), end).unwrap().released, 1);
        plant
    };
    // The base moves up, so that the wall presses, and curves down.
    let mut driven = released();
    let curved = Drive { signal: [2.0, 0.5, -2.0, 0.0], ..Drive::default() };
    driven.advance(curved, 0.02).unwrap();
    // With less damping the spring presses the wall on the particle.
    let mut eased = released();
    eased.set_parameters(Parameters { damping: 3.9, ..parameters }).unwrap();
    eased.advance(Drive::held(2.0), 0.02).unwrap();
    for plant in [driven, eased] {
        assert_eq!((plant.contact(), plant.relative_velocity()), (Some(Wall::Plus), 0.0));
    }
}

#[test]
fn at_rest_nothing_happens_for_a_million_periods() {
    let parameters = Parameters::dimensionless(0.0084, 1.43, 0.65);
    for q2 in [0.0, 1.0, -1.0] {
        let start = State { q2, ..State::default() };
        let mut plant = Plant::new(parameters, start).unwrap();
        plant.advance(Drive::default(), 6.3e6).unwrap();
        assert_eq!(plant.state(), start);
        assert_eq!(plant.totals().impacts, 0);
    }
}

#[test]
fn a_jump_of_the_base_kicks_the_primary_mass_by_c_over_m_times_the_jump() {
    let parameters = Parameters::dimensionless(0.1, 2.0, 0.65);
    let mut plant = Plant::new(parameters, State::default()).unwrap();
    plant.advance(Drive::held(0.25), 0.0).unwrap();
    assert_eq!(plant.state().dq1, 0.0, "where the base starts is no jump");
    plant.advance(Drive::held(0.75), 0.0).unwrap();
    assert!((plant.state().dq1 - 0.2 * 0.5).abs() < 1e-16);
}
