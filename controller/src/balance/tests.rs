//! Tests of the balance of power.

use super::*;

/// Samples of the tests are a hundredth of a period long; the response grows by 0.03 per sample and drive, and loses 3e-4 of itself.
fn config() -> Config {
    Config {
        sample_time: 1e-3,
        response_gain: 30.0,
        damping_rate: Some(0.3),
        ..Config::for_resonance(10.0 * TAU, 1.0)
    }
}

/// Samples until a response that grows by `factor` times the work of a drive of 1 contradicts the balance, within ten periods.
fn samples(factor: Real, base: Real, cosine: Real) -> Option<usize> {
    let (mut state, mut response) = (Balance::default(), 0.0);
    (0..1000).position(|_| {
        response += 0.03 * factor - 3e-4 * response;
        let seen = Powers {
            reading: 0.0,
            turn: 0.01 * TAU,
            drive: 1.0,
            lagging: 1.0,
            base,
            response,
            cosine,
        };
        state.contradicts(&config(), &seen)
    })
}

#[test]
fn a_linear_response_and_one_with_impacts_agree() {
    assert_eq!(samples(1.0, 1.0, 1.0), None);
    assert_eq!(samples(0.7, 1.0, 1.0), None);
    assert_eq!(samples(1.3, 1.0, 1.0), None);
}

#[test]
fn a_reversed_a_dead_and_an_exchanged_sensor_contradict_within_two_periods() {
    assert!(samples(1.0, 1.0, -1.0).is_some_and(|n| n < 100));
    assert!(samples(0.0, 1.0, 1.0).is_some_and(|n| n < 100));
    assert!(samples(1.0, 0.0, 1.0).is_some_and(|n| n < 250));
}

#[test]
fn a_factor_of_three_or_of_a_third_contradicts_in_the_first_periods() {
    assert!(samples(3.0, 1.0, 1.0).is_some_and(|n| n < 800));
    assert!(samples(0.3, 1.0, 1.0).is_some_and(|n| n < 300));
}
