//! Tests of the balance of power.

use super::*;

const SAMPLE_TIME: Real = 1e-3;
const BALANCE: Balance = Balance {
    gain: 0.03,
    damping: 3e-4,
    is_known: true,
    sample_time: SAMPLE_TIME,
    first: 1.0,
};

/// Samples until a response that grows by `factor` times the work of a drive of 1 contradicts the balance, within ten periods.
fn samples(factor: Real, base: Real, cosine: Real) -> Option<usize> {
    let (mut state, mut response) = (BalanceState::default(), 0.0);
    (0..1000).position(|_| {
        response += BALANCE.gain * factor - BALANCE.damping * response;
        let seen = Powers {
            reading: 0.0,
            turn: 0.01 * TAU,
            drive: 1.0,
            lagging: 1.0,
            base,
            response,
            cosine,
        };
        BALANCE.contradicts(&mut state, &seen)
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
