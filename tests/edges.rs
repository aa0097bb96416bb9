//! The edges: no loss, extreme values, other units, invalid values, steps that are cut short.

use lovines::plant::MOST_IMPACTS;
use lovines::{Drive, Event, Parameters, Plant, State};

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
fn a_step_that_is_cut_short_reports_how_far_it_came() {
    // Hops of 2e-9 of the natural time: more of them than a step may follow.
    let mut plant = elastic(1e-9);
    let mut last = 0.0;
    let outcome = plant
        .advance_with(Drive::held(1.0), 1.0, |event| {
            if let Event::Impact { t, .. } = event {
                last = t;
            }
        })
        .unwrap();
    assert!(outcome.cut_short);
    assert_eq!(outcome.impacts, MOST_IMPACTS);
    assert_eq!((outcome.stuck, plant.totals().dissipated), (0, 0.0));
    // 10^7 hops of 2e-9, nearly.
    assert!((outcome.elapsed - 0.02).abs() < 1e-3, "{}", outcome.elapsed);
    assert_eq!(plant.time(), outcome.elapsed);
    assert_eq!(last, outcome.elapsed);
    // The next step goes on from there.
    let more = plant.advance(Drive::held(1.0), 1e-3).unwrap();
    assert_eq!((more.elapsed, more.cut_short), (1e-3, false));
}

#[test]
fn an_invalid_drive_or_step_is_refused_and_changes_nothing() {
    let parameters = Parameters::dimensionless(0.0084, 1.43, 0.65);
    let start = State { dq2: 0.5, ..State::default() };
    let mut plant = Plant::new(parameters, start).unwrap();
    let drive = Drive::harmonic(0.01, 1.0);
    plant.advance(drive, 1.0).unwrap();
    let before = (plant.state(), *plant.totals(), plant.time(), plant.base());
    let signal = |signal| Drive { signal, ..Drive::default() };
    for (bad, named) in [
        (Drive::harmonic(0.01, f64::INFINITY), "omega"),
        (Drive::harmonic(0.01, 1e60), "omega"),
        (Drive::harmonic(f64::NAN, 1.0), "E (amplitude"),
        (signal([0.0, f64::NAN, 0.0, 0.0]), "der(e)"),
        (signal([1e200, 0.0, 0.0, 0.0]), "e (base"),
    ] {
        let message = plant.advance(bad, 1.0).unwrap_err().to_string();
        assert!(message.starts_with(named), "{message}");
    }
    for duration in [-1.0, f64::NAN, f64::INFINITY] {
        let message = plant.advance(drive, duration).unwrap_err().to_string();
        assert!(message.starts_with("duration"), "{message}");
    }
    assert_eq!((plant.state(), *plant.totals(), plant.time(), plant.base()), before);
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
            let drive = Drive::harmonic(0.02 * length, 0.99 * rate);
            plant
                .advance(drive, if n % 2 == 0 { 0.0625 } else { 1.5 } * time)
                .unwrap();
        }
        let State { q1, dq1, q2, dq2 } = plant.state();
        [q1 / length, dq1 / length * time, q2 / length, dq2 / length * time]
    };
    for (damping, fast) in [0.012, 2.0, 20.0]
        .into_iter()
        .flat_map(|damping| [(damping, false), (damping, true)])
    {
        let (small, large) = (2f64.powi(-35), 2f64.powi(290));
        for (time, length) in [
            (small, large),
            (small, 1.0 / large),
            (1.0 / small, large),
            (1.0 / small, 1.0 / large),
        ] {
            let (one, other) = (run(1.0, 1.0, damping, fast), run(time, length, damping, fast));
            assert_eq!(
                one, other,
                "time {time:e}, length {length:e}, damping {damping}, fast path {fast}"
            );
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
    assert!(
        plant.totals().impacts > 100_000 && worst < 2e-15,
        "{worst:e} {:?}",
        plant.totals()
    );
}
