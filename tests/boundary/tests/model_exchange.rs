//! Guards the life of an instance for model exchange, and jumps at its events.

use fmi2_boundary::{Fmu, Interface, Master, call};
use fmi2_component::Status;
use fmi2_component::abi::EventInfo;

const DQ1: u32 = 10;
const DQ2: u32 = 12;
const E: u32 = 6;

fn event_mode(values: &[(u32, f64)]) -> Master {
    let m = Master::with(&Fmu::plant(), Interface::ModelExchange, values);
    m.start();
    m
}

fn resolve(m: &Master) -> EventInfo {
    let mut info = EventInfo::default();
    m.well(call!(m.fmi2NewDiscreteStates(&mut info)));
    info
}

fn go_on(m: &Master) {
    m.well(call!(m.fmi2EnterContinuousTimeMode()));
}

fn indicators(m: &Master) -> [f64; 5] {
    let mut z = [0.0; 5];
    m.well(call!(m.fmi2GetEventIndicators(z.as_mut_ptr(), 5)));
    z
}

fn states(m: &Master) -> [f64; 5] {
    let mut x = [0.0; 5];
    m.well(call!(m.fmi2GetContinuousStates(x.as_mut_ptr(), 5)));
    x
}

#[test]
fn each_mode_has_its_own_functions() {
    let m = event_mode(&[]);
    assert_eq!(m.step(0.0, 0.1), Status::Error);
    assert!(m.heard()[0].text.contains("one of co-simulation"));
    assert_eq!(call!(m.fmi2CompletedIntegratorStep(1, &mut 0, &mut 0)), Status::Error);
    assert!(m.heard()[0].text.contains("legal in Continuous-Time Mode"));
    m.well(call!(m.fmi2EnterEventMode()));
    resolve(&m);
    go_on(&m);
    m.well(call!(m.fmi2CompletedIntegratorStep(1, &mut 0, &mut 0)));
    assert_eq!(call!(m.fmi2NewDiscreteStates(&mut EventInfo::default())), Status::Error);
    let _ = m.heard();
    m.well(call!(m.fmi2Terminate()));
    let _ = states(&m);
}

#[test]
fn co_simulation_has_none_of_them() {
    for fmu in [Fmu::plant(), Fmu::controller()] {
        let m = Master::ready(&fmu);
        assert_eq!(call!(m.fmi2SetTime(0.0)), Status::Error);
        assert!(m.heard()[0].text.contains("one of model exchange"));
    }
}

#[test]
fn a_parameter_is_not_tuned_while_the_integrator_runs() {
    let m = event_mode(&[]);
    m.well(m.set_real(2, 3.0));
    go_on(&m);
    assert_eq!(m.set_real(2, 4.0), Status::Error);
    let _ = m.heard();
    m.well(m.set_real(E, 1e-3));
}

#[test]
fn a_particle_at_the_wall_rebounds_and_keeps_momentum() {
    // w = b, approaching.
    let m = event_mode(&[(0, 3.0), (3, 0.5), (9, 0.01), (DQ1, 0.4), (DQ2, -0.2)]);
    assert_eq!(resolve(&m).values_of_continuous_states_changed, 1);
    let (v1, v2) = (m.real(DQ1), m.real(DQ2));
    assert!((3.0 * v1 + 0.5 * v2 - (3.0 * 0.4 - 0.5 * 0.2)).abs() < 1e-15);
    assert!((v1 - v2 + 0.65 * 0.6).abs() < 1e-15);
    assert_eq!((m.integer(18), m.integer(21)), (1, 0));
    assert!(indicators(&m).iter().all(|&z| z > 0.0));
    assert_eq!(resolve(&m).values_of_continuous_states_changed, 0, "once");
}

#[test]
fn a_jump_of_the_base_is_the_velocity_jump_that_the_damper_makes() {
    let m = event_mode(&[(0, 3.0), (2, 6.0)]);
    resolve(&m);
    go_on(&m);
    m.well(call!(m.fmi2EnterEventMode()));
    m.well(m.set_real(E, 0.01));
    resolve(&m);
    assert!((m.real(DQ1) - 6.0 / 3.0 * 0.01).abs() < 1e-16);
}

#[test]
fn a_particle_that_is_pressed_sticks_and_a_jump_of_the_base_frees_it() {
    // w = b at rest, the spring pushes towards +q2: the particle is carried along.
    let held = [(0, 3.0), (2, 6.0), (9, -0.005), (11, -0.015), (DQ2, 0.0)]; // to the last digit or so
    let m = event_mode(&held);
    resolve(&m);
    assert_eq!(m.integer(21), 1);
    let mut dx = [0.0; 5];
    m.well(call!(m.fmi2GetDerivatives(dx.as_mut_ptr(), 5)));
    assert_eq!(dx[2], dx[3], "both are accelerated alike");
    assert!((dx[2] - 11680.0 * 0.005 / 3.032).abs() < 1e-12);

    go_on(&m);
    m.well(call!(m.fmi2EnterEventMode()));
    m.well(m.set_real(E, -0.001));
    resolve(&m);
    assert_eq!(m.integer(21), 0);
    assert!(
        (m.real(DQ1) + 6.0 / 3.0 * 0.001).abs() < 1e-16,
        "the primary mass alone"
    );
    assert_eq!(m.real(DQ2), 0.0);
}

#[test]
fn a_step_that_has_led_behind_a_wall_asks_for_an_event() {
    let m = event_mode(&[]);
    resolve(&m);
    go_on(&m);
    let (mut event, mut end) = (0, 0);
    let mut x = states(&m);
    x[1] = -0.0100001;
    m.well(call!(m.fmi2SetContinuousStates(x.as_ptr(), 5)));
    m.well(call!(m.fmi2CompletedIntegratorStep(1, &mut event, &mut end)));
    assert_eq!((event, end), (1, 0));
    assert!(indicators(&m)[0] < 0.0);
}

#[test]
fn states_without_sense_are_refused() {
    let m = event_mode(&[]);
    go_on(&m);
    let x = [0.0, f64::NAN, 0.0, 0.0, 0.0];
    assert_eq!(call!(m.fmi2SetContinuousStates(x.as_ptr(), 5)), Status::Discard);
    assert_eq!(call!(m.fmi2SetContinuousStates(x.as_ptr(), 4)), Status::Error);
    let heard = m.heard();
    assert!(heard[0].text.contains("finite") && heard[1].text.contains("expected 5"));
    assert_eq!(states(&m)[1], 0.0);
}

#[test]
fn nominal_values_are_those_of_the_rig() {
    let m = event_mode(&[(0, 1.0), (1, 4.0), (4, 0.5)]);
    let mut nominals = [0.0; 5];
    m.well(call!(m.fmi2GetNominalsOfContinuousStates(nominals.as_mut_ptr(), 5)));
    assert_eq!(nominals, [0.5, 0.5, 1.0, 1.0, 1.0]);
}

#[test]
fn a_particle_on_a_rough_floor_slides_sticks_and_slips() {
    // A particle at rest, which friction holds: tilt, mu_k, mu_s.
    let m = event_mode(&[(35, 0.05), (36, 0.1), (37, 0.15), (DQ2, 0.0)]);
    let at = |t: f64| {
        m.well(call!(m.fmi2EnterContinuousTimeMode()));
        m.well(call!(m.fmi2SetTime(t)));
        m.well(call!(m.fmi2EnterEventMode()));
    };
    resolve(&m);
    assert_eq!(m.integer(44), 1);
    at(0.25);
    assert_eq!(m.real(45), 0.25, "time stuck");
    // A steeper slope lets it slip: der(w) < 0, because gravity pulls towards +q2.
    m.well(m.set_real(35, 0.3));
    resolve(&m);
    assert!(indicators(&m)[4] < 1e-11 && indicators(&m)[2..4] == [1.0; 2]);
    let pull = 9.80665 * (0.3f64.sin() - 0.1 * 0.3f64.cos());
    assert!((m.real(27) - pull).abs() < 1e-14, "der(u2)");
    let way = 1e-3;
    let mut x = [0.0, way, 0.0, 0.1, 0.0];
    m.well(call!(m.fmi2EnterContinuousTimeMode()));
    m.well(call!(m.fmi2SetContinuousStates(x.as_ptr(), 5)));
    let loss = 0.032 * 9.80665 * 0.1 * 0.3f64.cos() * way;
    assert!((m.real(46) / loss - 1.0).abs() < 1e-12, "energy lost to friction");
    // The particle has turned round: it sticks or slides the other way, at the next event.
    x[3] = -1e-6;
    m.well(call!(m.fmi2SetContinuousStates(x.as_ptr(), 5)));
    assert!(indicators(&m)[4] < 0.0);
    m.well(call!(m.fmi2EnterEventMode()));
    resolve(&m);
    assert!(indicators(&m).iter().all(|&z| z > 0.0));
    assert_eq!((m.integer(44), m.real(15)), (1, 0.0), "it slides on from rest");
}
