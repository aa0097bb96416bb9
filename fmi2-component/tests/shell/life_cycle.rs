//! Guards calls in and out of order, through the C functions.

use crate::{new, ready};
use fmi2_boundary::{Fmu, Functions, Master, Raw};
use fmi2_component::Status;
use std::ptr::null_mut;

type Call = (&'static str, fn(&Functions, Raw) -> Status);

/// Every function that depends on the state, called with arguments that are in order.
fn calls() -> Vec<Call> {
    unsafe {
        vec![
            ("SetupExperiment", |f, c| {
                (f.fmi2SetupExperiment)(c, 0, 0.0, 0.0, 0, 0.0)
            }),
            ("EnterInitializationMode", |f, c| (f.fmi2EnterInitializationMode)(c)),
            ("ExitInitializationMode", |f, c| (f.fmi2ExitInitializationMode)(c)),
            ("Terminate", |f, c| (f.fmi2Terminate)(c)),
            ("DoStep", |f, c| (f.fmi2DoStep)(c, 0.0, 0.1, 1)),
            ("CancelStep", |f, c| (f.fmi2CancelStep)(c)),
            ("GetReal", |f, c| (f.fmi2GetReal)(c, &3, 1, &mut 0.0)),
            ("SetReal", |f, c| (f.fmi2SetReal)(c, &2, 1, &0.0)),
            ("GetInteger", |f, c| (f.fmi2GetInteger)(c, &0, 1, &mut 0)),
            ("GetBoolean", |f, c| (f.fmi2GetBoolean)(c, &0, 1, &mut 0)),
            ("SetBoolean", |f, c| (f.fmi2SetBoolean)(c, &0, 1, &1)),
            ("GetRealOutputDerivatives", |f, c| {
                (f.fmi2GetRealOutputDerivatives)(c, &3, 1, &1, &mut 0.0)
            }),
            ("GetStatus", |f, c| (f.fmi2GetStatus)(c, 0, &mut Status::Ok)),
            ("GetRealStatus", |f, c| (f.fmi2GetRealStatus)(c, 2, &mut 0.0)),
            ("GetBooleanStatus", |f, c| (f.fmi2GetBooleanStatus)(c, 3, &mut 0)),
            ("GetStringStatus", |f, c| {
                (f.fmi2GetStringStatus)(c, 1, &mut std::ptr::null())
            }),
            ("EnterEventMode", |f, c| (f.fmi2EnterEventMode)(c)),
            ("NewDiscreteStates", |f, c| (f.fmi2NewDiscreteStates)(c, null_mut())),
            ("EnterContinuousTimeMode", |f, c| (f.fmi2EnterContinuousTimeMode)(c)),
            ("CompletedIntegratorStep", |f, c| {
                (f.fmi2CompletedIntegratorStep)(c, 1, &mut 0, &mut 0)
            }),
            ("SetTime", |f, c| (f.fmi2SetTime)(c, 0.0)),
            ("SetContinuousStates", |f, c| (f.fmi2SetContinuousStates)(c, &0.0, 1)),
            ("GetDerivatives", |f, c| (f.fmi2GetDerivatives)(c, &mut 0.0, 1)),
            ("GetEventIndicators", |f, c| (f.fmi2GetEventIndicators)(c, &mut 0.0, 1)),
            ("GetContinuousStates", |f, c| {
                (f.fmi2GetContinuousStates)(c, &mut 0.0, 1)
            }),
            ("GetNominalsOfContinuousStates", |f, c| {
                (f.fmi2GetNominalsOfContinuousStates)(c, &mut 0.0, 1)
            }),
        ]
    }
}

#[track_caller]
fn legal_here(lead_there: impl Fn(&Master), expected: &[&str]) {
    for (name, call) in calls() {
        let master = new();
        lead_there(&master);
        let before = master.bytes();
        master.heard();
        let status = call(&master.f, master.c);
        if expected.contains(&name) {
            assert_eq!(status, Status::Ok, "{name}: {:?}", master.heard());
        } else {
            assert_eq!(status, Status::Error, "{name}");
            master.heard_one(&[&format!("fmi2{name} is illegal in state")]);
            assert_eq!(master.bytes(), before, "{name} did harm");
        }
    }
}

fn initialise(master: &Master) {
    unsafe { (master.f.fmi2EnterInitializationMode)(master.c) };
}

fn start(master: &Master) {
    initialise(master);
    unsafe { (master.f.fmi2ExitInitializationMode)(master.c) };
}

fn fail(master: &Master) {
    start(master);
    master.set_real(2, -100.0);
    assert_eq!(master.step(0.0, 1.0), Status::Discard);
}

const READ: [&str; 3] = ["GetReal", "GetInteger", "GetBoolean"];
const WRITE: [&str; 2] = ["SetReal", "SetBoolean"];
const ASK: [&str; 4] = ["GetStatus", "GetRealStatus", "GetBooleanStatus", "GetStringStatus"];

#[test]
fn an_instance_can_be_set_up() {
    let here = ["SetupExperiment", "EnterInitializationMode"];
    legal_here(|_| (), &[&here[..], &WRITE].concat());
}

#[test]
fn an_instance_in_initialization_mode_can_be_set_and_read() {
    let here = ["ExitInitializationMode"];
    legal_here(initialise, &[&here[..], &READ, &WRITE].concat());
}

#[test]
fn an_instance_between_steps_can_step() {
    let here = ["DoStep", "Terminate", "GetRealOutputDerivatives"];
    legal_here(start, &[&here[..], &READ, &WRITE, &ASK].concat());
}

#[test]
fn an_instance_whose_step_failed_can_be_read_and_terminated() {
    let here = ["Terminate", "GetRealOutputDerivatives"];
    legal_here(fail, &[&here[..], &READ, &ASK].concat());
}

#[test]
fn a_terminated_instance_can_be_read() {
    let terminate = |master: &Master| {
        start(master);
        unsafe { (master.f.fmi2Terminate)(master.c) };
    };
    legal_here(terminate, &[&["GetRealOutputDerivatives"][..], &READ, &ASK].concat());
}

#[test]
fn null_is_no_instance() {
    let f = Fmu::tank().functions;
    for (name, call) in calls() {
        assert_eq!(call(&f, null_mut()), Status::Error, "{name}");
    }
    unsafe { (f.fmi2FreeInstance)(null_mut()) };
}

#[test]
fn a_reset_instance_equals_a_fresh_one() {
    let (used, fresh) = (new(), new());
    used.set_real(0, 3.0);
    fail(&used);
    assert_eq!(unsafe { (used.f.fmi2Reset)(used.c) }, Status::Ok);
    assert_eq!(used.bytes(), fresh.bytes());
}

#[test]
fn a_discarded_step_changes_nothing_and_wants_to_end() {
    let master = ready();
    master.set_real(2, 0.1);
    assert_eq!(master.step(0.0, 1.0), Status::Ok);
    let level = master.real(3);
    master.set_real(2, -100.0);
    assert_eq!(master.step(1.0, 1.0), Status::Discard);
    master.heard_one(&["fmi2DoStep", "runs dry before 2 s"]);
    assert_eq!(master.real(3), level);
    let (mut time, mut wants_to_end, mut status) = (f64::NAN, 0, Status::Ok);
    unsafe {
        assert_eq!((master.f.fmi2GetRealStatus)(master.c, 2, &mut time), Status::Ok);
        assert_eq!(
            (master.f.fmi2GetBooleanStatus)(master.c, 3, &mut wants_to_end),
            Status::Ok
        );
        assert_eq!((master.f.fmi2GetStatus)(master.c, 0, &mut status), Status::Ok);
    }
    assert_eq!((time, wants_to_end, status), (1.0, 1, Status::Discard));
}

#[test]
fn a_status_of_the_wrong_type_is_discarded() {
    let master = ready();
    unsafe {
        assert_eq!((master.f.fmi2GetStatus)(master.c, 2, &mut Status::Ok), Status::Discard);
        assert_eq!((master.f.fmi2GetIntegerStatus)(master.c, 0, &mut 0), Status::Discard);
        assert_eq!((master.f.fmi2GetRealStatus)(master.c, 2, null_mut()), Status::Error);
    }
}

#[test]
fn steps_follow_each_other() {
    let master = ready();
    assert_eq!(master.step(0.0, 0.1), Status::Ok);
    assert_eq!(master.step(0.1 * (1.0 + 1e-12), 0.1), Status::Ok);
    assert_eq!(master.step(0.1, 0.1), Status::Error);
    master.heard_one(&["currentCommunicationPoint = 0.1 s", "ended at 0.2"]);
    for wrong in [-0.1, f64::NAN, f64::INFINITY] {
        assert_eq!(master.step(0.2, wrong), Status::Error);
        master.heard_one(&["communicationStepSize", "at least 0"]);
    }
    for wrong in [f64::NAN, f64::NEG_INFINITY] {
        assert_eq!(master.step(wrong, 0.1), Status::Error);
        master.heard();
    }
    assert_eq!(master.step(0.2, 0.0), Status::Ok);
    assert_eq!(master.step(0.2, 0.1), Status::Ok);
}

#[test]
fn a_step_may_lead_past_the_stop_time_by_rounding_only() {
    let master = new();
    unsafe { (master.f.fmi2SetupExperiment)(master.c, 1, 1e-6, 0.0, 1, 1.0) };
    start(&master);
    assert_eq!(master.step(0.0, 0.9), Status::Ok);
    assert_eq!(master.step(0.9, 0.3), Status::Error);
    master.heard_one(&["from 0.9 s to 1.2 s", "stopTime = 1 s"]);
    assert_eq!(master.step(0.9, 0.1 + 1e-8), Status::Error);
    master.heard_one(&["stopTime = 1 s"]);
    assert_eq!(master.step(0.9, 0.1 + 1e-12), Status::Ok);
    assert_eq!(master.step(1.0, 0.3), Status::Error);
    master.heard_one(&["stopTime = 1 s"]);
}

#[test]
fn an_experiment_without_sense_is_refused() {
    let master = new();
    for (start, stop) in [(f64::NAN, 1.0), (f64::INFINITY, 1.0), (0.0, f64::NAN), (2.0, 1.0)] {
        let status = unsafe { (master.f.fmi2SetupExperiment)(master.c, 0, 0.0, start, 1, stop) };
        assert_eq!(status, Status::Error);
        master.heard_one(&["is refused"]);
    }
    for tolerance in [f64::NAN, -1e-6, 1e300] {
        let status = unsafe { (master.f.fmi2SetupExperiment)(master.c, 1, tolerance, 0.0, 1, 1.0) };
        assert_eq!(status, Status::Error);
        master.heard_one(&[
            "tolerance = ",
            "is refused; allowed is a relative tolerance from 0 to 1",
        ]);
    }
    assert_eq!(
        unsafe { (master.f.fmi2SetupExperiment)(master.c, 0, f64::NAN, 5.0, 0, f64::NAN) },
        Status::Ok
    );
    start(&master);
    assert_eq!(master.step(5.0, 0.1), Status::Ok);
}
