//! No call is endless, whatever the values.

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
    let heard = &m.heard()[0].text;
    let expected = "there are 10000000 impacts within the first ";
    assert!(heard.contains(expected), "{heard}");
    // SAFETY: the instance is alive.
    m.well(unsafe { (m.f.fmi2Reset)(m.c) });
    m.start();
    m.well(m.step(0.0, 0.1));
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
    // k and c: the values themselves, and the rates that follow from them.
    for (values, what) in [
        (&[(1, 1e300)][..], "N/m is refused"),
        (&[(2, 1e300)], "N.s/m is refused"),
        (&[(0, 1e-90), (1, 1e100)], "rad/s is refused"),
        (&[(2, 1e60)], "rad/s is refused"),
        (&[(8, -1e300)], "rad/s is refused"),
    ] {
        refused_start(values, what);
    }
    // omega, with a step that is short beside it.
    let m = with(&[]);
    m.well(m.set_real(8, -1e300));
    assert_eq!(timed(&m, "an absurd rate", 1e-300), Status::Error);
    assert!(m.heard()[0].text.contains("rad/s is refused"));
    let m = with(&[(2, 1e12)]);
    assert_eq!(timed(&m, "a rate that is just allowed", 1e-7), Status::Ok);
}

#[test]
fn a_base_so_far_away_that_the_cavity_is_lost_in_rounding_is_not_followed() {
    let m = with(&[]);
    let beyond_doubles = "m is refused; allowed is a finite number from -1e100 to 1e100";
    let beyond_cavity = "2^52 half-widths";
    for (vr, value, what) in [
        (6, 1e300, beyond_doubles),
        (6, -1e14, beyond_cavity),
        (7, -1e300, beyond_doubles),
        (7, 5e13, beyond_cavity),
    ] {
        m.well(m.set_real(vr, value));
        let before = m.bytes();
        assert_eq!(timed(&m, "a base far away", 1e-3), Status::Error);
        let heard = &m.heard()[0].text;
        assert!(heard.contains(what), "{heard}");
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
    for (vr, name) in [(10, "der(q1)"), (12, "der(q2)")] {
        for (value, allowed) in [(1e300, "from -1e100 to 1e100"), (-1e90, "2^52 half-widths")] {
            let heard = refused_start(&[(vr, value)], allowed);
            assert!(heard.contains(name), "{heard}");
        }
    }
}

/// Start values with which the initialization fails; the message, which contains `what`.
fn refused_start(values: &[(u32, f64)], what: &str) -> String {
    let m = Master::new(&Fmu::plant(), Interface::CoSimulation);
    for &(vr, value) in values {
        m.well(m.set_real(vr, value));
    }
    // SAFETY: the instance is alive.
    unsafe {
        m.well((m.f.fmi2EnterInitializationMode)(m.c));
        assert_eq!((m.f.fmi2ExitInitializationMode)(m.c), Status::Error);
    }
    let heard = m.heard().swap_remove(0).text;
    assert!(heard.contains(what), "{heard}");
    heard
}
