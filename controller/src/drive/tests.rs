//! Tests of the drive.

use super::*;

const DRIVE: Drive = Drive {
    amplitude_max: 2.0,
    ramp_step: 0.3,
    release_step: f64::INFINITY,
    control_step: 0.1,
};

#[test]
fn a_ramp_ends_exactly_at_its_setpoint() {
    let mut state = DriveState::default();
    let samples = (0..10).take_while(|_| !DRIVE.ramp(&mut state, 1.0)).count();
    assert_eq!((samples, state.amplitude), (3, 1.0));
}

#[test]
fn a_release_without_a_ramp_takes_one_sample() {
    let mut state = DriveState { amplitude: 1.0, trim: 0.2 };
    DRIVE.release(&mut state);
    assert_eq!(state, DriveState::default());
}

#[test]
fn the_control_corrects_a_shaker_of_low_gain() {
    let mut state = DriveState::default();
    for _ in 0..1000 {
        DRIVE.ramp(&mut state, 1.0);
        let measured = 0.8 * state.amplitude;
        DRIVE.control(&mut state, 1.0, measured);
    }
    assert!((state.amplitude - 1.25).abs() < 1e-9);
}

#[test]
fn the_control_stays_within_its_limit_if_the_base_does_not_move() {
    let mut state = DriveState::default();
    for _ in 0..1000 {
        DRIVE.ramp(&mut state, 1.0);
        DRIVE.control(&mut state, 1.0, 0.0);
        assert!(state.amplitude <= 2.0);
    }
}
