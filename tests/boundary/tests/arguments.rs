//! Arguments that make no sense: each is refused with one line that says so, and changes nothing.

use std::ptr::{null, null_mut};

use fmi2_boundary::{Fmu, Interface, Master};
use fmi2_component::Status;

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
fn null_arrays_are_refused() {
    refused("vr is NULL", |m| unsafe { (m.f.fmi2GetReal)(m.c, null(), 1, &mut 0.0) });
    refused("value is NULL", |m| unsafe {
        (m.f.fmi2GetReal)(m.c, &Q1, 1, null_mut())
    });
    refused("value is NULL", |m| unsafe { (m.f.fmi2SetReal)(m.c, &E, 1, null()) });
    refused("FMUstate is NULL", |m| unsafe {
        (m.f.fmi2GetFMUstate)(m.c, null_mut())
    });
    refused("value is NULL", |m| unsafe {
        (m.f.fmi2GetRealStatus)(m.c, 2, null_mut())
    });
}

#[test]
fn no_elements_are_no_error_even_without_arrays() {
    let m = Master::ready(&Fmu::plant());
    // SAFETY: nothing is read or written.
    m.well(unsafe { (m.f.fmi2GetReal)(m.c, null(), 0, null_mut()) });
    // SAFETY: as above.
    m.well(unsafe { (m.f.fmi2SetReal)(m.c, null(), 0, null()) });
}

#[test]
fn absurd_counts_are_refused() {
    for count in [usize::MAX, isize::MAX as usize, 1 << 32, 1 << 21] {
        refused("count", |m| unsafe { (m.f.fmi2SetReal)(m.c, &E, count, &0.0) });
        refused("count", |m| unsafe { (m.f.fmi2GetReal)(m.c, &Q1, count, &mut 0.0) });
    }
}

#[test]
fn unknown_references_are_refused_before_anything_is_set() {
    for unknown in [1000, u32::MAX] {
        refused("is unknown", |m| {
            let (vr, values) = ([E, unknown], [0.5, 0.5]);
            unsafe { (m.f.fmi2SetReal)(m.c, vr.as_ptr(), 2, values.as_ptr()) }
        });
        refused("is unknown", |m| unsafe {
            (m.f.fmi2GetReal)(m.c, &unknown, 1, &mut 0.0)
        });
    }
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
fn numbers_that_are_none_are_refused() {
    for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        for vr in [E, OMEGA, 1] {
            refused("finite", |m| m.set_real(vr, value));
        }
    }
}

#[test]
fn what_is_computed_cannot_be_set() {
    refused("cannot be set", |m| m.set_real(Q1, 0.0));
    refused("cannot be set", |m| m.set_real(0, 1.0));
}

#[test]
fn a_parameter_tuned_to_nonsense_is_refused() {
    refused("at most 1", |m| m.set_real(5, 1.5));
    refused("from 1e-100 to 1e100", |m| m.set_real(1, -2.0));
}

#[test]
fn steps_without_sense_are_refused_and_the_next_one_is_fine() {
    for step in [f64::NAN, f64::INFINITY, -1e-9, -1e300, 1e300, 1e9] {
        refused("communicationStepSize", |m| m.step(0.0, step));
    }
    for time in [f64::NAN, 1.0, -1e-3] {
        refused("currentCommunicationPoint", |m| m.step(time, 0.1));
    }
    let m = Master::ready(&Fmu::plant());
    assert_eq!(m.step(0.0, -1.0), Status::Error);
    m.well(m.step(0.0, 0.0));
    m.well(m.step(0.0, f64::MIN_POSITIVE));
    m.well(m.step(0.0, 0.1));
}

#[test]
fn a_controller_is_not_asked_for_endless_samples() {
    let m = Master::ready(&Fmu::controller());
    assert_eq!(m.step(0.0, 1e300), Status::Error);
    assert!(m.heard()[0].text.contains("samples"));
    m.well(m.step(0.0, 0.1));
}

#[test]
fn text_that_is_no_utf_8_is_taken_as_text() {
    let m = Master::ready(&Fmu::plant());
    let names = [c"\xff\xfe%n%s".as_ptr(), null()];
    // SAFETY: two categories, one of them NULL.
    let status = unsafe { (m.f.fmi2SetDebugLogging)(m.c, 1, 2, names.as_ptr()) };
    assert_eq!(status, Status::Warning);
    for line in m.heard() {
        assert!(!line.text.replace("%%", "").contains('%'), "{line:?}");
    }
}

#[test]
fn every_spelling_of_the_resource_location_is_fine() {
    for fmu in [Fmu::plant(), Fmu::controller()] {
        let locations = [
            c"file:///tmp/fmu/resources",
            c"file:////tmp/fmu/resources",
            c"file:/tmp/fmu/resources",
            c"file://localhost/tmp/fmu/resources",
            c"/tmp/fmu/resources",
            c"C:\\fmu\\resources",
            c"file:///C:/f%20m%u/resources",
            c"\xff",
            c"",
        ];
        for location in locations.into_iter().map(Some).chain([None]) {
            let m = Master::at(&fmu, 1, &fmu.guid(), location);
            assert!(!m.c.is_null(), "{location:?}: {:?}", m.heard());
        }
    }
}

#[test]
fn another_guid_is_refused_by_name() {
    for guid in ["", "derived", "{00000000-0000-0000-0000-000000000000}", "%n%s"] {
        let m = Master::at(&Fmu::plant(), 1, guid, None);
        assert!(m.c.is_null());
        assert!(m.heard()[0].text.contains("do not belong together"));
    }
    let fmu = Fmu::plant();
    let m = Master::at(&fmu, 1, &format!("{{{}}}", fmu.guid()), None);
    assert!(!m.c.is_null(), "braces around it are fine");
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
fn null_is_no_instance_and_may_be_freed() {
    for fmu in [Fmu::plant(), Fmu::controller()] {
        let f = fmu.functions;
        // SAFETY: NULL is refused.
        unsafe {
            assert_eq!((f.fmi2DoStep)(null_mut(), 0.0, 0.1, 1), Status::Error);
            assert_eq!((f.fmi2GetReal)(null_mut(), &Q1, 1, &mut 0.0), Status::Error);
            assert_eq!((f.fmi2SetTime)(null_mut(), 0.0), Status::Error);
            (f.fmi2FreeInstance)(null_mut());
        }
    }
}
