//! Arguments that make no sense to plant and controller: each is refused with one line that says so, and changes nothing. Random
//! sequences of calls, of which `scripts/stress` makes many more. The exported symbols. What holds for every component is tested in
//! `fmi2-component/tests/`.

use std::ptr::null;

use fmi2_boundary::{Fmu, Functions, Interface, Master, fuzz};
use fmi2_component::Status;
use object::{Object, ObjectSymbol};

const E: u32 = 6;
const OMEGA: u32 = 8;
const Q1: u32 = 9;

/// Asserts that `call` on a plant ready to step is an error with a reason that holds `word`, and does no harm.
#[track_caller]
fn refused(word: &str, call: impl Fn(&Master) -> Status) {
    let master = Master::ready(&Fmu::plant());
    let before = master.bytes();
    master.heard();
    let status = call(&master);
    let heard = master.heard();
    assert_eq!(status, Status::Error, "{heard:?}");
    assert_eq!(heard.len(), 1, "{heard:?}");
    assert!(heard[0].text.contains(word), "{heard:?}");
    assert_eq!(heard[0].category, "logStatusError");
    assert_eq!(master.bytes(), before);
}

#[test]
fn where_one_of_several_values_is_refused_none_is_set() {
    // Stiffness and restitution are tunable: the first value is fine, the second is refused by the component itself.
    refused("at most 1", |m| {
        let (vr, values) = ([1, E, 5], [9000.0, 0.5, 1.5]);
        unsafe { (m.f.fmi2SetReal)(m.c, vr.as_ptr(), 3, values.as_ptr()) }
    });
    refused("finite", |m| {
        let (vr, values) = ([E, OMEGA], [0.5, f64::NAN]);
        unsafe { (m.f.fmi2SetReal)(m.c, vr.as_ptr(), 2, values.as_ptr()) }
    });
    refused("cannot be set", |m| {
        let (vr, values) = ([E, Q1], [0.5, 0.5]);
        unsafe { (m.f.fmi2SetReal)(m.c, vr.as_ptr(), 2, values.as_ptr()) }
    });
    refused("orders 1 to 3", |m| {
        let (vr, orders, values) = ([E, E], [1, 4], [0.5, 0.5]);
        let f = m.f.fmi2SetRealInputDerivatives;
        unsafe { f(m.c, vr.as_ptr(), 2, orders.as_ptr(), values.as_ptr()) }
    });
}

#[test]
fn a_controller_tuned_to_nonsense_takes_no_part_of_it() {
    let m = Master::ready(&Fmu::controller());
    m.well(m.step(0.0, 1e-3));
    let before = m.bytes();
    // amplitude is fine, phase_target is not.
    let (vr, values) = ([5, 10], [1e-5, 7.0]);
    // SAFETY: arrays of two.
    let status = unsafe { (m.f.fmi2SetReal)(m.c, vr.as_ptr(), 2, values.as_ptr()) };
    assert_eq!(status, Status::Error);
    assert!(m.heard()[0].text.contains("between -pi and pi"));
    assert_eq!(m.bytes(), before);
}

#[test]
fn a_reference_of_another_type_is_refused() {
    refused("type Integer", |m| unsafe { (m.f.fmi2GetInteger)(m.c, &Q1, 1, &mut 0) });
    refused("no variables of type Boolean", |m| unsafe {
        (m.f.fmi2SetBoolean)(m.c, &E, 1, &1)
    });
    refused("no variables of type String", |m| unsafe {
        (m.f.fmi2GetString)(m.c, &E, 1, &mut null())
    });
}

#[test]
fn of_a_reference_given_twice_the_last_value_counts() {
    let m = Master::ready(&Fmu::plant());
    let (vr, values) = ([E, E], [0.25, 0.5]);
    // SAFETY: arrays of two.
    m.well(unsafe { (m.f.fmi2SetReal)(m.c, vr.as_ptr(), 2, values.as_ptr()) });
    let mut read = [0.0; 2];
    // SAFETY: as above.
    m.well(unsafe { (m.f.fmi2GetReal)(m.c, vr.as_ptr(), 2, read.as_mut_ptr()) });
    assert_eq!(read, [0.5, 0.5]);
}

#[test]
fn a_controller_is_not_asked_for_endless_samples() {
    let m = Master::ready(&Fmu::controller());
    assert_eq!(m.step(0.0, 1e300), Status::Error);
    assert!(m.heard()[0].text.contains("samples"));
    m.well(m.step(0.0, 0.1));
}

#[test]
fn an_interface_that_is_not_there_is_refused() {
    let (plant, controller) = (Fmu::plant(), Fmu::controller());
    for (fmu, kind) in [(&plant, 2), (&plant, -1), (&controller, 0)] {
        let m = Master::at(fmu, kind, &fmu.guid(), None);
        assert!(m.c.is_null());
        assert!(m.heard()[0].text.contains("fmuType"));
    }
    assert!(!Master::new(&plant, Interface::ModelExchange).c.is_null());
}

#[test]
fn calls_in_any_order_are_answered_and_every_error_has_a_reason() {
    for fmu in [Fmu::plant(), Fmu::controller(), Fmu::tank()] {
        let tally = (0..400)
            .map(|seed| fuzz::sequence(&fmu, seed))
            .fold(fuzz::Tally::default(), |sum, one| sum.and(&one));
        let [ok, _, _, error, fatal, _] = tally.statuses;
        assert_eq!(fatal, 0);
        assert!(ok > tally.calls() / 10 && error > tally.calls() / 10);
        assert!(tally.harmless > 100);
    }
}

#[test]
fn exactly_the_functions_of_the_standard_are_exported() {
    for name in ["LoViNes", "PhaseLock", "Tank"] {
        let bytes = std::fs::read(Fmu::path(name)).unwrap();
        let library = object::File::parse(&*bytes).unwrap();
        let defined = library.dynamic_symbols().filter(|s| s.is_definition());
        let mut found: Vec<_> = defined.map(|s| s.name().unwrap().to_owned()).collect();
        found.sort();
        let mut expected = Functions::NAMES.to_vec();
        expected.sort_unstable();
        assert_eq!(found, expected, "{name}");
    }
}
