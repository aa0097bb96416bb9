//! The derivative of the motion, against differences of the motion itself.

use lovines::{Cavity, Drive, Event, Parameters, Plant, Restitution, State, Variation};
use proptest::prelude::*;

/// Steps of the differences, over b, b omega0, omega0 and b.
const STEP: f64 = 1e-6;

/// The state after `duration` under the drive of the numbers `x`, the derivative there, and the events.
fn followed(p: Parameters, x: [f64; 6], duration: f64) -> (Variation, [f64; 4], Vec<Event>) {
    let [q1, dq1, q2, dq2, omega, amplitude] = x;
    let drive = Drive::harmonic(amplitude, omega);
    let mut plant = Plant::new(p, State { q1, dq1, q2, dq2 }).unwrap();
    plant.begin(drive).unwrap();
    let mut variation = Variation::of(&plant);
    let mut events = Vec::new();
    plant.advance_with(drive, duration, |event| events.push(event)).unwrap();
    for event in &events {
        variation.pass(event, 0.0);
    }
    variation.advance(duration - variation.elapsed());
    (variation, plant.state().into(), events)
}

/// What happens, without when. Impacts that accumulate until the particle rests count once.
fn kinds(events: &[Event]) -> Vec<(std::mem::Discriminant<Event>, bool)> {
    let side = |event: &Event| match *event {
        Event::Impact { wall, .. } | Event::Stuck { wall, .. } | Event::Released { wall, .. } => wall.sign() > 0.0,
        Event::Slip { direction, .. } | Event::Reversal { direction, .. } => direction > 0.0,
        Event::Sticking { .. } => false,
    };
    // Friction reverses the particle between them.
    let accumulates = |event: &&&Event| matches!(event, Event::Impact { .. } | Event::Reversal { .. });
    let mut kept: Vec<&Event> = Vec::new();
    for event in events {
        if matches!(event, Event::Stuck { .. }) {
            let last = kept
                .iter()
                .rev()
                .take_while(|last| accumulates(last) && side(last) == side(event));
            kept.truncate(kept.len() - last.count());
        }
        kept.push(event);
    }
    kept.into_iter()
        .map(|event| (std::mem::discriminant(event), side(event)))
        .collect()
}

fn cavity() -> impl Strategy<Value = Cavity> {
    let law = prop_oneof![
        Just([None; 2]),
        (0.1..0.6f64).prop_map(|k| [Some(Restitution::Viscoelastic(k)), None]),
        (0.05..0.5f64).prop_map(|y| [None, Some(Restitution::Plastic(y))]),
    ];
    let friction = prop_oneof![Just((0.0, 0.0)), (0.001..0.05f64, 1.0..2.0f64)];
    (friction, prop_oneof![Just(0.0), -0.02..0.02f64], law).prop_map(|((mu, ratio), tilt, restitution)| Cavity {
        kinetic_friction: mu,
        static_friction: (mu > 0.0).then_some(mu * ratio),
        tilt,
        restitution,
        ..Cavity::IDEAL
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, ..ProptestConfig::default() })]

    #[test]
    fn the_derivative_is_what_differences_of_the_motion_approach(
        cavity in cavity(),
        (epsilon, lambda, r) in (0.01..0.5f64, prop_oneof![Just(0.0), 0.0..3.0f64], prop_oneof![0.2..1.0f64, 0.02..0.2f64]),
        (q1, dq1, w, dw) in (-0.5..0.5f64, -0.5..0.5f64, -0.9..0.9f64, -1.0..1.0f64),
        (omega, amplitude, duration) in (prop_oneof![Just(1.0), 0.7..1.4f64], 0.0..1.0f64, 0.1..12.0f64),
    ) {
        let p = Parameters { cavity, ..Parameters::dimensionless(epsilon, lambda, r) };
        let x = [q1, dq1, q1 - w, dq1 - dw, omega, amplitude];
        let (variation, end, events) = followed(p, x, duration);
        let State { q1, dq1, q2, dq2 } = variation.state();
        for (led, end) in [q1, dq1, q2, dq2].into_iter().zip(end) {
            prop_assert!((led - end).abs() < 1e-9, "{led} {end} {events:?}");
        }
        for column in 0..6 {
            let moved = [-STEP, STEP].map(|step| {
                let mut x = x;
                x[column] += step;
                followed(p, x, duration)
            });
            // A neighbour with other events has no derivative in common.
            prop_assume!(moved.iter().all(|(_, _, other)| kinds(other) == kinds(&events)));
            for row in 0..4 {
                let [below, above] = [&moved[0], &moved[1]].map(|(variation, end, _)| (variation.derivatives()[row][column], end[row]));
                let difference = (above.1 - below.1) / (2.0 * STEP);
                let derivative = variation.derivatives()[row][column];
                // The derivatives of the neighbours tell how far the motion is from a straight line there.
                let curved = (above.0 - derivative).abs() + (below.0 - derivative).abs();
                let tolerance = 1e-6 * (1.0 + derivative.abs()) + curved;
                prop_assert!((difference - derivative).abs() < tolerance, "{row} {column}: {difference} {derivative} {events:?}");
            }
        }
    }
}
