//! Impacts, rest, release and jumps of the base in chosen scenes: a graze of 1e-13, a wall that holds, lets go and catches again, a drive
//! that pulls a wall away, rest for a million periods. What holds for random scenes is in tests/stress.

use lovines::{Drive, Event, Parameters, Plant, State, Wall};

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
