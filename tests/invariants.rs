//! Guards chosen scenes: a wall that holds, lets go and catches again, a drive that pulls a wall away, rest for a million
//! periods, no loss, other units, invalid values, steps that are cut short, the fast path
//! against the plain solver. What holds for random scenes is in tests/stress.

use lovines::plant::MOST_IMPACTS;
use lovines::{Drive, Event, Parameters, Plant, State, Wall};
use std::f64::consts::TAU;
use std::ops::ControlFlow;

/// A start near the 1:1 motion of the default rig.
const LOCK: State = State { q1: -0.42, dq1: 0.01, q2: -0.99, dq2: -0.86 };

/// The default rig, dimensionless.
fn default_rig() -> Parameters {
    Parameters::dimensionless(0.0084, 1.43, 0.65)
}

/// The events of a step.
fn events(plant: &mut Plant, drive: Drive, duration: f64) -> Vec<Event> {
    let mut events = Vec::new();
    plant.advance_with(drive, duration, |event| events.push(event)).unwrap();
    events
}

#[test]
fn a_particle_at_rest_on_the_wall_is_held_let_go_and_caught_again() {
    // The base is dragged: the wall pushes the particle, then draws away from it.
    let parameters = Parameters::dimensionless(0.1, 1.0, 0.3);
    let start = State { q1: 0.0, dq1: 0.0, q2: -1.0, dq2: 0.0 };
    let mut plant = Plant::new(parameters, start).unwrap();
    let events = events(&mut plant, Drive::held(2.0), 60.0);
    let [
        Event::Stuck { t: 0.0, wall: Wall::Plus },
        Event::Released { t, wall: Wall::Plus },
        Event::Impact { .. },
        ..,
    ] = events[..]
    else {
        panic!("{events:?}");
    };
    // Undamped it would let go when the acceleration of the joint mass is 0, a quarter of its period on; damping delays that.
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
        let released = Event::Released { t: 0.0, wall: Wall::Plus };
        assert_eq!(events(&mut plant, after, 0.25), [released], "{after:?}");
        assert_eq!(plant.state().dq2, speed, "the particle flies on: {after:?}");
    }
}

#[test]
fn a_release_at_the_very_end_of_a_step_says_nothing_about_another_drive_or_other_parameters() {
    let parameters = Parameters { damping: 4.0, ..Parameters::dimensionless(0.1, 0.0, 0.5) };
    let start = pressed(parameters, Drive::held(2.0), 0.0);
    let mut ahead = events(&mut start.clone(), Drive::held(2.0), 60.0).into_iter();
    let end = ahead
        .find(|event| matches!(event, Event::Released { .. }))
        .unwrap()
        .time();
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
    for q2 in [0.0, 1.0, -1.0] {
        let start = State { q2, ..State::default() };
        let mut plant = Plant::new(default_rig(), start).unwrap();
        plant.advance(Drive::default(), 6.3e6).unwrap();
        assert_eq!(plant.state(), start);
        assert_eq!(plant.totals().impacts, 0);
    }
}

/// A particle without loss on a wall that presses on it, leaving it at `speed`.
fn elastic(speed: f64) -> Plant {
    let parameters = Parameters { damping: 0.0, ..Parameters::dimensionless(0.01, 0.0, 1.0) };
    // The base is displaced, so that the spring pulls the wall at w = +b against the particle.
    let start = State { q1: 0.0, dq1: 0.0, q2: -1.0, dq2: -speed };
    let mut plant = Plant::new(parameters, start).unwrap();
    plant.begin(Drive::held(1.0)).unwrap();
    plant
}

#[test]
fn without_loss_the_particle_never_sticks_and_nothing_is_dissipated() {
    for speed in [1.0, 1e-2, 1e-4, 1e-5] {
        let mut plant = elastic(speed);
        let before = plant.energy(1.0);
        let outcome = plant.advance(Drive::held(1.0), 3.0).unwrap();
        assert_eq!((outcome.stuck, plant.totals().dissipated), (0, 0.0), "{speed}");
        assert!(outcome.impacts > 0, "{speed}");
        let drift = (plant.energy(1.0) - before).abs() / before;
        assert!(drift < 1e-11, "{speed}: {drift:e}");
    }
}

#[test]
fn an_event_can_end_its_step() {
    let mut plant = elastic(1e-9);
    let mut left = 3;
    let ended = plant.advance_until(Drive::held(1.0), 1.0, |_| {
        left -= 1;
        match left {
            0 => ControlFlow::Break(()),
            _ => ControlFlow::Continue(()),
        }
    });
    let ended = ended.unwrap();
    assert_eq!((ended.cut_short, ended.impacts, left), (true, 3, 0));
    assert!(plant.time() == ended.elapsed && ended.elapsed < 1e-6);
}

#[test]
fn a_step_that_is_cut_short_reports_how_far_it_came() {
    // Hops of 2e-9 of the natural time: more of them than a step may follow.
    let mut plant = elastic(1e-9);
    let mut last = 0.0;
    let outcome = plant
        .advance_with(Drive::held(1.0), 1.0, |event| last = event.time())
        .unwrap();
    assert_eq!((outcome.cut_short, outcome.impacts), (true, MOST_IMPACTS));
    assert_eq!((outcome.stuck, plant.totals().dissipated), (0, 0.0));
    // 10^7 hops of 2e-9, nearly.
    assert!((outcome.elapsed - 0.02).abs() < 1e-3, "{}", outcome.elapsed);
    assert_eq!([plant.time(), last], [outcome.elapsed; 2]);
    // The next step goes on from there.
    let more = plant.advance(Drive::held(1.0), 1e-3).unwrap();
    assert_eq!((more.elapsed, more.cut_short), (1e-3, false));
}

#[test]
fn an_invalid_drive_or_step_is_refused_and_changes_nothing() {
    let mut plant = Plant::new(default_rig(), State { dq2: 0.5, ..State::default() }).unwrap();
    let drive = Drive::harmonic(0.01, 1.0);
    plant.advance(drive, 1.0).unwrap();
    let before = plant.save();
    let signal = |signal| Drive { signal, ..Drive::default() };
    for (drive, duration, named) in [
        (Drive::harmonic(0.01, f64::INFINITY), 1.0, "omega"),
        (Drive::harmonic(0.01, 1e60), 1.0, "omega"),
        (Drive::harmonic(f64::NAN, 1.0), 1.0, "E (amplitude"),
        (signal([0.0, f64::NAN, 0.0, 0.0]), 1.0, "der(e)"),
        (signal([1e200, 0.0, 0.0, 0.0]), 1.0, "e (base"),
        (drive, -1.0, "duration"),
        (drive, f64::NAN, "duration"),
        (drive, f64::INFINITY, "duration"),
    ] {
        let message = plant.advance(drive, duration).unwrap_err().to_string();
        assert!(message.starts_with(named), "{message}");
    }
    assert_eq!(format!("{:?}", plant.save()), format!("{before:?}"));
}

#[test]
fn the_motion_is_the_same_in_any_units() {
    // Powers of two: every number is scaled without rounding.
    let run = |time: f64, length: f64, damping: f64, fast: bool| {
        let rate = 1.0 / time;
        let parameters = Parameters {
            stiffness: rate * rate,
            damping: damping * rate,
            half_width: length,
            ..Parameters::dimensionless(0.0084, 0.0, 0.65)
        };
        let (q1, q2, v) = (-0.42 * length, -0.99 * length, -0.86 * length * rate);
        let mut plant = Plant::new(parameters, State { q1, q2, dq2: v, dq1: 0.0 }).unwrap();
        plant.set_fast_path(fast);
        for n in 0..400 {
            let step = if n % 2 == 0 { 0.0625 } else { 1.5 } * time;
            plant
                .advance(Drive::harmonic(0.02 * length, 0.99 * rate), step)
                .unwrap();
        }
        let State { q1, dq1, q2, dq2 } = plant.state();
        [q1 / length, dq1 / length * time, q2 / length, dq2 / length * time]
    };
    let cases = [0.012, 2.0, 20.0]
        .into_iter()
        .flat_map(|damping| [(damping, false), (damping, true)]);
    for (damping, fast) in cases {
        let here = run(1.0, 1.0, damping, fast);
        let (small, large) = (2f64.powi(-35), 2f64.powi(290));
        for (time, length) in [
            (small, large),
            (small, 1.0 / large),
            (1.0 / small, large),
            (1.0 / small, 1.0 / large),
        ] {
            let there = run(time, length, damping, fast);
            assert_eq!(here, there, "time {time:e}, length {length:e}, {damping}, {fast}");
        }
    }
}

#[test]
fn hops_by_the_hundred_thousand_keep_the_energy_without_the_fast_path() {
    // As in a stress scene that lost 1e-12 of it: every flight of the plain solver had rounded position and velocity.
    let parameters = Parameters { damping: 0.0, ..Parameters::dimensionless(0.3, 0.0, 1.0) };
    let start = State { q1: -1.3, dq1: 0.7, q2: -2.3 + 1e-12, dq2: 0.7 };
    let mut plant = Plant::new(parameters, start).unwrap();
    plant.set_fast_path(false);
    let before = plant.energy(0.0);
    let mut worst = 0.0f64;
    for _ in 0..50 {
        plant.advance(Drive::default(), 0.01).unwrap();
        worst = worst.max((plant.energy(0.0) + plant.totals().dissipated - before).abs() / before);
    }
    assert!(plant.totals().impacts > 100_000 && worst < 2e-15, "{worst:e}");
}

/// Follows the plant with its fast path and with the plain solver, which never differ by more than `most` after a step. Returns the
/// impacts of both, and their evaluations.
fn side_by_side(
    parameters: Parameters,
    start: State,
    steps: impl IntoIterator<Item = (Drive, f64)>,
    most: f64,
) -> [[u64; 2]; 2] {
    let mut plants = [Plant::new(parameters, start).unwrap(); 2];
    plants[1].set_fast_path(false);
    let mut evaluations = [0; 2];
    for (drive, step) in steps {
        for (plant, evaluations) in plants.iter_mut().zip(&mut evaluations) {
            *evaluations += plant.advance(drive, step).unwrap().evaluations;
        }
        let [a, b] = plants.each_ref().map(Plant::state);
        let off = [a.q1 - b.q1, a.dq1 - b.dq1, a.q2 - b.q2, a.dq2 - b.dq2];
        assert!(off.iter().all(|x| x.abs() < most), "{drive:?}: {off:?}");
    }
    [plants.map(|plant| plant.totals().impacts), evaluations]
}

#[test]
fn crossings_meet_the_impacts_of_the_plain_search() {
    for (lambda, r, omega) in [(1.43, 0.65, 0.990_417), (0.8, 0.5, 0.994), (2.0, 0.8, 0.985)] {
        let step = (Drive::harmonic(0.0084 * 1.1, omega), TAU / omega);
        let parameters = Parameters::dimensionless(0.0084, lambda, r);
        let [impacts, _] = side_by_side(parameters, LOCK, [step; 200], 1e-12);
        assert!(impacts[0] == impacts[1] && impacts[0] > 300, "{impacts:?}");
    }
}

#[test]
fn a_wall_that_is_nearly_touched_makes_only_a_short_part_of_a_long_flight_costly() {
    let (omega, periods) = (1.0 - 0.0084 * 4.4, 200.0);
    let start = State { q1: -0.0233, dq1: 0.1524, q2: -0.8405, dq2: 5.8e-4 };
    let step = (Drive::harmonic(0.0084 * 1.4, omega), periods * TAU / omega);
    let [impacts, evaluations] = side_by_side(default_rig(), start, [step], 1e-13);
    assert_eq!(impacts, [0, 0]);
    let [fast, plain] = evaluations.map(|n| n as f64);
    assert!(fast < 0.5 * periods && plain > 2.0 * periods, "{evaluations:?}");
}

#[test]
fn equal_steps_follow_a_drive_that_becomes_fast() {
    let start = State { q1: 0.3, dq1: 0.1, q2: 0.2, dq2: 0.0 };
    let steps = [1.0, 1.1, 40.0, 0.9, 300.0].map(|omega| [(Drive::harmonic(0.01, omega), 0.06); 5]);
    side_by_side(default_rig(), start, steps.concat(), 1e-13);
}

#[test]
fn steps_whose_lengths_have_rounding_errors_are_as_exact_as_equal_ones() {
    for (order, error) in (0..4).flat_map(|order| [1e-15, 1e-12, 9e-10].map(|error| (order, error))) {
        let mut drive = Drive::harmonic(0.0084 * 1.1, 0.990_417);
        drive.signal[..order].copy_from_slice(&[0.01, -0.002, 1e-4][..order]);
        let steps = (0..400).map(|n| (drive, 0.06 * (1.0 + error * f64::from(n % 5 - 2))));
        let [impacts, _] = side_by_side(default_rig(), LOCK, steps, 1e-12);
        assert_eq!(impacts[0], impacts[1]);
    }
}
