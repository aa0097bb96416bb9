use std::f64::consts::TAU;

use super::*;

/// A periodic motion with harmonics, whose amplitude and mean drift.
fn motion(n: u64) -> Sensors {
    let (turns, drift) = (0.0103 * n as f64, n as f64 / 1e5);
    let response = (1.0 + drift) * (TAU * turns).sin() + 0.2 * (3.0 * TAU * turns).cos() + drift;
    Sensors { response, reference: Some(0.1 * (TAU * turns).cos()) }
}

/// The largest errors of response and reference over a gap of `lost` readings after `known` ones.
fn errors(known: u64, lost: u64) -> [f64; 2] {
    let (mut bridge, mut worst) = (Bridge::default(), [0.0_f64; 2]);
    (0..known).for_each(|n| bridge.keep(0.0103 * n as f64, motion(n)));
    for n in known..known + lost {
        let (phase, ahead) = (0.0103 * n as f64, known + lost - n);
        let (filled, expected) = (bridge.fill(phase, &motion(known + lost), ahead, 0.0103), motion(n));
        worst[0] = worst[0].max((filled.response - expected.response).abs());
        worst[1] = worst[1].max((filled.reference.unwrap() - expected.reference.unwrap()).abs());
        bridge.keep(phase, filled);
    }
    worst
}

#[test]
fn a_gap_of_any_length_in_a_periodic_motion_is_bridged_with_its_harmonics() {
    for lost in [1, 4, 27, 90, 250] {
        let [response, reference] = errors(600, lost);
        assert!(response < 0.01 && reference < 1e-4, "{lost}: {response} {reference}");
    }
}

#[test]
fn without_a_period_before_it_a_gap_is_bridged_by_a_line() {
    let [response, reference] = errors(10, 4);
    assert!(response < 0.03 && reference < 1e-3, "{response} {reference}");
    // Nothing at all before the gap, and no frequency.
    let mut bridge = Bridge::default();
    assert_eq!(bridge.fill(0.0, &motion(7), 3, 0.0), motion(7));
    (0..5).for_each(|_| bridge.keep(0.0, Sensors { response: 1.0, reference: None }));
    let next = Sensors { response: 3.0, reference: None };
    assert_eq!(bridge.fill(0.0, &next, 1, 0.0).response, 2.0);
}
