//! The amplitude loop around a structure of first order.

use super::*;

const DT: f64 = 0.01;
/// `A' = -delta A + g E` with a first-order detector.
struct Structure {
    a: f64,
    reading: f64,
}
const DELTA: f64 = 0.03;
const GAIN: f64 = 0.5;
const BANDWIDTH: f64 = 0.3;

fn amplitude_loop(amplitude_max: f64) -> AmplitudeLoop {
    let config = Config {
        bandwidth: BANDWIDTH,
        damping_rate: Some(DELTA),
        response_gain: GAIN,
        sample_time: DT,
        amplitude_max: Some(amplitude_max),
        ramp_rate: None,
        ..Config::for_resonance(1.0, 0.0)
    };
    AmplitudeLoop::new(&config)
}

impl Structure {
    fn advance(&mut self, drive: f64) {
        self.a += DT * (GAIN * drive - DELTA * self.a);
        self.reading += BANDWIDTH * DT * (self.a - self.reading);
    }
}

fn settled() -> (Structure, AmplitudeState) {
    let structure = Structure { a: 1.0, reading: 1.0 };
    (structure, AmplitudeState::constant(1.0, DELTA / GAIN))
}

/// Largest control error of the amplitude after `skipped` samples.
fn worst(to: Move, skipped: usize) -> f64 {
    let control = amplitude_loop(10.0);
    let (mut structure, mut state) = settled();
    state.start(to, DT);
    let mut worst = 0.0_f64;
    for n in 0..40_000 {
        let (drive, _) = control.follow(&mut state, 0.0, Some(structure.reading));
        structure.advance(drive);
        if n >= skipped {
            worst = worst.max((structure.a - state.setpoint).abs());
        }
    }
    assert!(state.has_arrived() && (structure.a - to.response).abs() < 1e-9);
    worst
}

#[test]
fn an_expected_change_of_the_drive_reduces_the_control_error() {
    let to = Move {
        response: 0.8,
        duration: 60.0,
        amplitude: -0.2 * DELTA / GAIN,
        ..Move::default()
    };
    let expected = worst(to, 0);
    let unexpected = worst(Move { amplitude: 0.0, ..to }, 0);
    assert!(
        expected < 2e-3 && unexpected > 4.0 * expected,
        "{expected} {unexpected}"
    );
}

#[test]
fn a_step_of_the_setpoint_settles_faster_than_the_structure_would() {
    let to = Move { response: 1.2, ..Move::default() };
    // 1/DELTA is 33 s.
    assert!(worst(to, 6_000) < 1e-2);
}

#[test]
fn the_drive_stays_within_its_limits_without_windup() {
    let control = amplitude_loop(0.1);
    let (mut structure, mut state) = settled();
    let mut go = |to: f64, samples: u32| {
        state.start(Move { response: to, ..Move::default() }, DT);
        for _ in 0..samples {
            let (drive, _) = control.follow(&mut state, 0.0, Some(structure.reading));
            assert!((0.0..=0.1).contains(&drive));
            structure.advance(drive);
        }
        structure.a
    };
    // 0.1 m of drive lead to a response of at most 1.67 m.
    assert!((go(5.0, 100_000) - 5.0 / 3.0).abs() < 1e-3);
    assert!((go(1.0, 20_000) - 1.0).abs() < 1e-2);
}

#[test]
fn a_move_with_a_growth_goes_on_at_that_rate_until_the_next_one() {
    let control = amplitude_loop(1.0);
    let (_, mut state) = settled();
    // Largest and smallest rate after some samples of a move.
    let mut go = |to: Move, skipped: usize, samples: usize| {
        state.start(to, DT);
        let mut rates = [f64::INFINITY, f64::NEG_INFINITY];
        for n in 0..samples {
            let before = state.setpoint;
            control.follow(&mut state, 0.0, Some(1.0));
            let rate = (state.setpoint - before) / DT;
            if n >= skipped {
                rates = [rates[0].min(rate), rates[1].max(rate)];
            }
        }
        rates
    };
    let is = |rates: [f64; 2], rate: f64| rates.iter().all(|one| (one - rate).abs() < 1e-9);
    let crossing = Move {
        response: 0.9,
        duration: 1.0,
        growth: -0.1,
        ..Move::default()
    };
    assert!(is(go(crossing, 100, 120), -0.1));
    assert!(is(go(Move { response: 0.78, ..crossing }, 0, 100), -0.1));
    assert!(is(
        go(Move { response: 0.75, duration: 1.0, ..Move::default() }, 101, 110),
        0.0
    ));
}

#[test]
fn the_shifts_of_the_frequency_add_up_to_the_expected_change() {
    let control = amplitude_loop(1.0);
    let (_, mut state) = settled();
    state.start(
        Move { response: 1.1, duration: 3.0, omega: -0.7, ..Move::default() },
        DT,
    );
    let shifted: f64 = (0..400).map(|_| control.follow(&mut state, 0.0, Some(1.0)).1).sum();
    assert!((shifted + 0.7).abs() < 1e-12);
}
