//! Partial and time derivatives against difference quotients.

use fmi2_boundary::{Fmu, Interface, Master};
use fmi2_component::Status;

/// Value references of the plant: parameters, start values and inputs, outputs, and the derivatives of the states.
const PARAMETERS: [u32; 6] = [0, 1, 2, 3, 4, 5];
const INPUTS: [u32; 3] = [6, 7, 8];
const STARTS: [u32; 4] = [9, 10, 11, 12];
const OUTPUTS: [u32; 13] = [9, 10, 11, 12, 13, 14, 15, 16, 17, 19, 20, 22, 23];
const STATES: [u32; 5] = [9, 11, 24, 26, 17];
const DERIVATIVES: [u32; 5] = [10, 12, 25, 27, 28];

/// A rig with no two numbers alike.
const VALUES: [(u32, f64); 13] = [
    (0, 2.0),
    (1, 300.0),
    (2, 7.5),
    (3, 0.5),
    (4, 0.2),
    (5, 0.7),
    (6, 0.013),
    (7, 0.021),
    (8, 12.0),
    (9, 0.05),
    (10, -0.3),
    (11, -0.02),
    (12, 0.4),
];

fn partial(m: &Master, unknown: u32, known: u32) -> f64 {
    let mut answer = f64::NAN;
    let f = m.f.fmi2GetDirectionalDerivative;
    // SAFETY: one element each.
    m.well(unsafe { f(m.c, &unknown, 1, &known, 1, &2.0, &mut answer) });
    answer / 2.0
}

/// Compares the derivative with the symmetric difference quotient that `set` makes.
fn compare(m: &Master, unknown: u32, known: u32, set: impl Fn(f64)) {
    let value = m.real(known);
    let h = 1e-6 * value.abs().max(0.01);
    let at = |value: f64| {
        set(value);
        m.real(unknown)
    };
    let quotient = (at(value + h) - at(value - h)) / (2.0 * h);
    set(value);
    let derivative = partial(m, unknown, known);
    let error = (derivative - quotient).abs() / (1.0 + quotient.abs());
    assert!(error < 1e-7, "{unknown} by {known}: {derivative} is not {quotient}");
}

fn in_initialization_mode(interface: Interface) -> Master {
    let m = Master::new(&Fmu::plant(), interface);
    for (vr, value) in VALUES {
        m.well(m.set_real(vr, value));
    }
    m.enter_initialization();
    m
}

fn leave_initialization_mode(m: &Master) {
    // SAFETY: the instance is alive.
    m.well(unsafe { (m.f.fmi2ExitInitializationMode)(m.c) });
}

#[test]
fn initial_outputs_by_parameters_starts_and_inputs() {
    for interface in [Interface::CoSimulation, Interface::ModelExchange] {
        let m = in_initialization_mode(interface);
        let knowns = [&PARAMETERS[..], &INPUTS, &STARTS].concat();
        for known in knowns {
            for unknown in [&OUTPUTS[..], &DERIVATIVES, &[24, 26]].concat() {
                compare(&m, unknown, known, |value| m.well(m.set_real(known, value)));
            }
        }
    }
}

#[test]
fn outputs_between_steps_by_inputs() {
    let m = in_initialization_mode(Interface::CoSimulation);
    leave_initialization_mode(&m);
    m.well(m.step(0.0, 0.05));
    for known in INPUTS {
        for unknown in OUTPUTS {
            compare(&m, unknown, known, |value| m.well(m.set_real(known, value)));
        }
    }
}

#[test]
fn derivatives_in_the_first_event_mode_are_those_of_continuous_time() {
    let m = in_initialization_mode(Interface::ModelExchange);
    leave_initialization_mode(&m);
    for unknown in [&OUTPUTS[..], &DERIVATIVES, &[24, 26]].concat() {
        for known in INPUTS {
            compare(&m, unknown, known, |value| m.well(m.set_real(known, value)));
        }
    }
    // der(q1) = u1 + (c/M) base: the velocity follows the base while the state is held.
    assert_eq!(partial(&m, 10, 6), 7.5 / 2.0);
}

#[test]
fn discrete_outputs_have_no_slope() {
    let m = in_initialization_mode(Interface::ModelExchange);
    leave_initialization_mode(&m);
    // Some masters ask for the slopes of all outputs, the Integers `impacts` and `contact` among them.
    let unknowns = [9, 18, 16, 21];
    let mut answers = [f64::NAN; 4];
    let f = m.f.fmi2GetDirectionalDerivative;
    // SAFETY: arrays of four and one element each.
    m.well(unsafe { f(m.c, unknowns.as_ptr(), 4, &6, 1, &1.0, answers.as_mut_ptr()) });
    assert_eq!(answers, [0.0, 0.0, 1.0, 0.0]);
    // An Integer is not a known, and an unknown reference stays an error.
    for (unknown, known) in [(16, 18), (99, 6)] {
        // SAFETY: one element each.
        let status = unsafe { f(m.c, &unknown, 1, &known, 1, &1.0, &mut 0.0) };
        assert_eq!(status, Status::Error);
    }
}

#[test]
fn derivatives_and_outputs_by_states_and_inputs() {
    let m = in_initialization_mode(Interface::ModelExchange);
    leave_initialization_mode(&m);
    let f = m.f;
    let mut x = [0.0; 5];
    // SAFETY: arrays of five.
    unsafe {
        m.well((f.fmi2NewDiscreteStates)(m.c, &mut Default::default()));
        m.well((f.fmi2EnterContinuousTimeMode)(m.c));
        m.well((f.fmi2GetContinuousStates)(m.c, x.as_mut_ptr(), 5));
        x[4] = 0.7;
        m.well((f.fmi2SetContinuousStates)(m.c, x.as_ptr(), 5));
    }
    for unknown in [&OUTPUTS[..], &DERIVATIVES].concat() {
        for known in INPUTS {
            compare(&m, unknown, known, |value| m.well(m.set_real(known, value)));
        }
        for (place, known) in STATES.into_iter().enumerate() {
            compare(&m, unknown, known, |value| {
                let mut x = x;
                x[place] = value;
                // SAFETY: an array of five.
                m.well(unsafe { (f.fmi2SetContinuousStates)(m.c, x.as_ptr(), 5) });
            });
        }
    }
}

#[test]
fn what_is_no_unknown_and_no_known_is_refused() {
    let m = Master::ready(&Fmu::plant());
    for (unknown, known, word) in [(0, 6, "not an unknown"), (9, 13, "not a known")] {
        let f = m.f.fmi2GetDirectionalDerivative;
        // SAFETY: one element each.
        let status = unsafe { f(m.c, &unknown, 1, &known, 1, &1.0, &mut 0.0) };
        assert_eq!(status, Status::Error);
        assert!(m.heard()[0].text.contains(word));
    }
}

fn time_derivative(m: &Master, vr: u32, order: i32) -> f64 {
    let mut answer = f64::NAN;
    // SAFETY: one element each.
    m.well(unsafe { (m.f.fmi2GetRealOutputDerivatives)(m.c, &vr, 1, &order, &mut answer) });
    answer
}

#[test]
fn output_derivatives_are_those_of_the_motion() {
    let m = in_initialization_mode(Interface::CoSimulation);
    leave_initialization_mode(&m);
    let h = 1e-4;
    let look = |n: i32| {
        m.well(m.step(f64::from(n) * h, h));
        OUTPUTS.map(|vr| {
            [
                m.real(vr),
                time_derivative(&m, vr, 1),
                time_derivative(&m, vr, 2),
                time_derivative(&m, vr, 3),
            ]
        })
    };
    let (before, now, after) = (look(0), look(1), look(2));
    for (place, vr) in OUTPUTS.into_iter().enumerate() {
        for order in 0..3 {
            let quotient = (after[place][order] - before[place][order]) / (2.0 * h);
            let derivative = now[place][order + 1];
            let error = (derivative - quotient).abs() / (1.0 + quotient.abs());
            assert!(
                error < 1e-4,
                "{vr}, order {}: {derivative} is not {quotient}",
                order + 1
            );
        }
    }
    let mut answer = 0.0;
    // SAFETY: one element each.
    let status = unsafe { (m.f.fmi2GetRealOutputDerivatives)(m.c, &9, 1, &4, &mut answer) };
    assert_eq!(status, Status::Error);
}
