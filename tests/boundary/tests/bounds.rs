//! No call is endless, whatever the values; a long step of an ordinary scene is done.

use std::f64::consts::TAU;
use std::time::{Duration, Instant};

use fmi2_boundary::{Fmu, Interface, Master};
use fmi2_component::Status;

/// No call may take longer, on a busy machine and with nothing optimised but the plant.
const PATIENCE: Duration = Duration::from_secs(60);

fn with(values: &[(u32, f64)]) -> Master {
    let m = Master::new(&Fmu::plant(), Interface::CoSimulation);
    for &(vr, value) in values {
        m.well(m.set_real(vr, value));
    }
    m.start();
    m
}

/// Takes a step; answers its status and says how long it took.
fn timed(m: &Master, what: &str, step: f64) -> Status {
    let began = Instant::now();
    let status = m.step(0.0, step);
    let took = began.elapsed();
    println!("{what}: {status:?} after {took:?}, {} impacts", m.impacts());
    assert!(took < PATIENCE, "{what}: {took:?}");
    status
}

#[test]
fn a_step_of_absurdly_many_impacts_ends_with_an_error_and_a_reset_helps() {
    let m = with(&[(4, 1e-9), (5, 1.0), (12, 1e8)]);
    let what = "a step of 1 s at 1e8 m/s in a gap of 1e-9 m";
    assert_eq!(timed(&m, what, 1.0), Status::Error);
    assert!(m.heard()[0].text.contains("more than 10000000 impacts"));
    // SAFETY: the instance is alive.
    m.well(unsafe { (m.f.fmi2Reset)(m.c) });
    m.start();
    m.well(m.step(0.0, 0.1));
}

#[test]
fn with_losses_the_same_ends_in_contact() {
    let m = with(&[(4, 1e-9), (12, 1e8)]);
    let what = "a step of 1 s at 1e8 m/s in a gap of 1e-9 m, r = 0.65";
    assert_eq!(timed(&m, what, 1.0), Status::Ok);
}

#[test]
fn a_step_of_a_million_periods_is_done() {
    let period = TAU / (11_680.0_f64 / 3.807).sqrt();
    let m = with(&[(7, 9.246e-5), (8, 54.9), (12, 0.5)]);
    assert_eq!(timed(&m, "a million periods", 1e6 * period), Status::Ok);
    assert!(m.impacts() > 1_900_000);
}

#[test]
fn a_step_that_could_not_end_is_not_begun() {
    let m = with(&[]);
    for step in [1e8, 1e300] {
        let before = m.bytes();
        assert_eq!(timed(&m, "an endless step", step), Status::Error);
        assert!(m.heard()[0].text.contains("rad of the fastest rate"));
        assert_eq!(m.bytes(), before);
    }
    m.well(m.step(0.0, 1.0));
}

#[test]
fn a_rate_whose_powers_are_no_numbers_is_not_followed() {
    // k, c and omega, with a step that is short beside any of them.
    for (vr, value) in [(1, 1e300), (2, 1e300), (8, -1e300)] {
        let m = with(&[(vr, value)]);
        assert_eq!(timed(&m, "an absurd rate", 1e-300), Status::Error);
        assert!(m.heard()[0].text.contains("rad/s is refused"));
    }
    let m = with(&[(2, 1e50)]);
    assert_eq!(timed(&m, "a rate that is just allowed", 1e-45), Status::Ok);
}

#[test]
fn a_base_so_far_away_that_the_cavity_is_lost_in_rounding_is_not_followed() {
    let m = with(&[]);
    for (vr, value) in [(6, 1e300), (6, -1e14), (7, -1e300), (7, 5e13)] {
        m.well(m.set_real(vr, value));
        let before = m.bytes();
        assert_eq!(timed(&m, "a base far away", 1e-3), Status::Error);
        assert!(m.heard()[0].text.contains("2^52 half-widths"));
        assert_eq!(m.bytes(), before);
        m.well(m.set_real(vr, 0.0));
    }
    // SAFETY: one reference, order and value.
    m.well(unsafe { (m.f.fmi2SetRealInputDerivatives)(m.c, &6, 1, &3, &1e30) });
    assert_eq!(timed(&m, "a base on its way there", 1.0), Status::Error);
    assert!(m.heard()[0].text.contains("2^52 half-widths"));
    // Nor by a step in which it does not get there.
    assert_eq!(timed(&m, "a base in a hurry", 1e-300), Status::Error);
    m.well(unsafe { (m.f.fmi2SetRealInputDerivatives)(m.c, &6, 1, &3, &1.0) });
    m.well(m.step(0.0, 1e-6));
}

#[test]
fn a_start_so_far_away_is_refused() {
    for (vr, value) in [(10, 1e300), (12, -1e300)] {
        let m = Master::new(&Fmu::plant(), Interface::CoSimulation);
        m.well(m.set_real(vr, value));
        // SAFETY: the instance is alive.
        unsafe {
            m.well((m.f.fmi2EnterInitializationMode)(m.c));
            assert_eq!((m.f.fmi2ExitInitializationMode)(m.c), Status::Error);
        }
        let heard = &m.heard()[0].text;
        assert!(
            heard.contains("der(q") && heard.contains("2^52 half-widths"),
            "{heard}"
        );
    }
}
