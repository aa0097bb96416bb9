//! Guards the life of an instance for model exchange, its events and what they report. The motion itself is compared with the plant's in
//! fmu/src/model_exchange/hybrid.rs.

use fmi2_boundary::{Fmu, Interface, Master, call, refused};
use fmi2_component::Status;
use fmi2_component::abi::EventInfo;

const DQ1: u32 = 10;
const DQ2: u32 = 12;
const E: u32 = 6;

fn event_mode(values: &[(u32, f64)]) -> Master {
    Master::started(&Fmu::plant(), Interface::ModelExchange, values)
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
fn each_interface_and_each_mode_has_its_own_functions() {
    let m = event_mode(&[]);
    refused!(m.fmi2DoStep(0.0, 0.1, 1) => "one of co-simulation");
    refused!(m.fmi2CompletedIntegratorStep(1, &mut 0, &mut 0) => "legal in Continuous-Time Mode");
    m.well(call!(m.fmi2EnterEventMode()));
    m.well(m.set_real(2, 3.0));
    resolve(&m);
    go_on(&m);
    m.well(call!(m.fmi2CompletedIntegratorStep(1, &mut 0, &mut 0)));
    let mut numbers = [0.0; 6];
    refused!(m.fmi2GetEventIndicators(numbers.as_mut_ptr(), 6) => "ni = 6 is refused; expected 5");
    refused!(m.fmi2GetDerivatives(numbers.as_mut_ptr(), 4) => "nx = 4 is refused; expected 5");
    refused!(m.fmi2NewDiscreteStates(&mut EventInfo::default()));
    // A parameter is not tuned while the integrator runs.
    refused!(m.fmi2SetReal(&2, 1, &4.0));
    m.well(m.set_real(E, 1e-3));
    m.well(call!(m.fmi2Terminate()));
    let _ = states(&m);
    for fmu in [Fmu::plant(), Fmu::controller()] {
        let m = Master::ready(&fmu);
        refused!(m.fmi2SetTime(0.0) => "one of model exchange");
    }
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
fn a_particle_that_friction_holds_slips_when_the_slope_becomes_steeper() {
    // At rest: tilt, mu_k, mu_s.
    let m = event_mode(&[(35, 0.05), (36, 0.1), (37, 0.15), (DQ2, 0.0)]);
    resolve(&m);
    assert_eq!(m.integer(44), 1);
    go_on(&m);
    m.well(call!(m.fmi2SetTime(0.25)));
    m.well(call!(m.fmi2EnterEventMode()));
    assert_eq!(m.real(45), 0.25, "time stuck");
    // der(w) < 0, because gravity pulls towards +q2.
    m.well(m.set_real(35, 0.3));
    resolve(&m);
    assert!(indicators(&m)[4] < 1e-11 && indicators(&m)[2..4] == [1.0; 2]);
    let pull = 9.80665 * (0.3f64.sin() - 0.1 * 0.3f64.cos());
    assert!((m.real(27) - pull).abs() < 1e-14, "der(u2)");
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
fn a_master_whose_steps_resolve_no_impact_is_told_so_once() {
    let m = event_mode(&[]);
    m.well(call!(m.fmi2SetDebugLogging(1, 0, std::ptr::null())));
    resolve(&m);
    let mut warnings = Vec::new();
    for w in [0.0100000001, 0.0108, 0.0163, 0.0108] {
        go_on(&m);
        let mut x = states(&m);
        x[1] = x[0] - w;
        m.well(call!(m.fmi2SetContinuousStates(x.as_ptr(), 5)));
        m.well(call!(m.fmi2EnterEventMode()));
        resolve(&m);
        warnings.extend(m.heard().into_iter().filter(|line| line.category == "logStatusWarning"));
    }
    assert_eq!(warnings.len(), 1, "{warnings:?}");
    assert!(
        warnings[0]
            .text
            .contains("the master's steps resolve no impact: the particle is met at |w| = 1.08 b")
    );
}

#[test]
fn states_without_sense_are_refused() {
    let m = event_mode(&[]);
    go_on(&m);
    let x = [0.0, f64::NAN, 0.0, 0.0, 0.0];
    let status = call!(m.fmi2SetContinuousStates(x.as_ptr(), 5));
    m.expect(status, Status::Discard, &["finite"]);
    refused!(m.fmi2SetContinuousStates(x.as_ptr(), 4) => "expected 5");
    assert_eq!(states(&m)[1], 0.0);
}

#[test]
fn nominal_values_are_those_of_the_rig() {
    let m = event_mode(&[(0, 1.0), (1, 4.0), (4, 0.5)]);
    let mut nominals = [0.0; 5];
    m.well(call!(m.fmi2GetNominalsOfContinuousStates(nominals.as_mut_ptr(), 5)));
    assert_eq!(nominals, [0.5, 0.5, 1.0, 1.0, 1.0]);
}
