//! Tests of the descent.

use super::*;

fn seen(response: Real, holding: Real) -> Descending {
    Descending {
        omega: 1.0,
        part: 0.25,
        response,
        holding,
        error: Some(0.0),
        repetitions: 1,
        highest: Real::INFINITY,
    }
}

fn descent(amplitude: Real) -> Descent {
    let config = Config::for_resonance(1.0, amplitude);
    Descent::new(&Config { captured_max: Some(0.7), ..config })
}

#[test]
fn the_drive_is_finite_and_within_its_limit_for_any_measurements() {
    for amplitude in [0.0, 1e-3] {
        let descent = descent(amplitude);
        for repetitions in [0, 3] {
            let mut state = DescentState::from(0.0);
            for n in 0..4000_i32 {
                let value = |step: i32| Real::from(n * step % 13 - 4) * 1e-3;
                let error = (n % 7 > 0).then_some(value(3));
                let response = value(5).max(0.0);
                let seen = Descending { error, repetitions, ..seen(response, value(8)) };
                descent.advance(&mut state, &seen);
                let drive = descent.drive(&state, value(8), value(3));
                assert!((0.0..=descent.amplitude_max).contains(&drive), "{state:?}");
                assert!(descent.observer_rate(response) > 0.0);
            }
        }
    }
}

/// The response at which a descent with this holding drive ends.
fn end(holding: impl Fn(Real) -> Real) -> Real {
    let descent = descent(1e-3);
    let mut state = DescentState::from(1.2);
    let responses = (0..).map(|n| 1.2 - 2e-4 * Real::from(n));
    let mut descended = responses.take_while(|response| *response > 0.0);
    let arrived =
        |response: &Real| descent.advance(&mut state, &seen(*response, 1e-3 * holding(*response))) == Progress::Arrived;
    descended.find(arrived).expect("an end")
}

#[test]
fn it_ends_where_the_holding_drive_falls_through_the_setpoint() {
    assert!((end(|response| 0.4 + response) - 0.6).abs() < 5e-3);
}

#[test]
fn it_passes_the_orbit_where_the_holding_drive_rises_and_ends_at_the_one_where_it_falls() {
    // 1 at 0.71, too large; at 0.5, rising; and, beyond a maximum of 1.2 at 0.38, at 0.292.
    let holding = |response: Real| {
        let x = (0.5 - response) / 0.12;
        1.0 + 0.1 * x * (3.0 - x * x)
    };
    let end = end(holding);
    assert!((end - 0.292).abs() < 5e-3, "{end}");
}
