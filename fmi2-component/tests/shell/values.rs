//! Guards setting and getting values through the C functions: when, what is refused, and that a refused call sets nothing.

use std::ffi::CStr;
use std::ptr::{null, null_mut};

use crate::{new, ready};
use fmi2_boundary::Master;
use fmi2_component::Status::{Error, Ok};

const AREA: u32 = 0;
const HEIGHT: u32 = 1;
const INFLOW: u32 = 2;
const LEVEL: u32 = 3;
const RATE: u32 = 4;
const VALVE: u32 = 0;
const FULL: u32 = 1;

#[test]
fn start_values_come_from_the_description() {
    let master = ready();
    assert_eq!(master.real(AREA), 2.0);
    assert_eq!(master.real(LEVEL), 0.5);
    let mut label = null();
    assert_eq!(unsafe { (master.f.fmi2GetString)(master.c, &0, 1, &mut label) }, Ok);
    assert_eq!(unsafe { CStr::from_ptr(label) }, c"A \"tank\"");
}

#[test]
fn outputs_are_right_in_initialization_mode_however_often_inputs_are_set() {
    let master = new();
    unsafe { (master.f.fmi2EnterInitializationMode)(master.c) };
    for (inflow, level) in [(1.0, 0.1), (3.0, 0.9)] {
        assert_eq!(master.set_real(INFLOW, inflow), Ok);
        assert_eq!(master.set_real(LEVEL, level), Ok);
        assert_eq!(master.real(RATE), inflow / 2.0);
        assert_eq!(master.real(LEVEL), level);
    }
    // What was set can be read back even where it makes no sense yet.
    assert_eq!(master.set_real(LEVEL, 7.0), Ok);
    assert_eq!(master.real(INFLOW), 3.0);
    assert_eq!(unsafe { (master.f.fmi2GetReal)(master.c, &LEVEL, 1, &mut 0.0) }, Error);
    master.heard_one(&["level = 7 m is refused", "height = 1 m"]);
    assert_eq!(unsafe { (master.f.fmi2ExitInitializationMode)(master.c) }, Error);
    master.heard_one(&["fmi2ExitInitializationMode: level = 7 m"]);
    assert_eq!(master.set_real(HEIGHT, 8.0), Ok);
    assert_eq!(unsafe { (master.f.fmi2ExitInitializationMode)(master.c) }, Ok);
    assert_eq!(master.real(LEVEL), 7.0);
}

#[test]
fn causality_and_variability_say_when_a_variable_may_be_set() {
    let master = new();
    for (vr, expected) in [(AREA, Ok), (HEIGHT, Ok), (INFLOW, Ok), (LEVEL, Ok), (RATE, Error)] {
        assert_eq!(master.set_real(vr, 0.5), expected);
    }
    master.heard_one(&[
        "der(level) cannot be set in state instantiated",
        "causality output, variability continuous, initial calculated",
    ]);
    unsafe { (master.f.fmi2EnterInitializationMode)(master.c) };
    for (vr, expected) in [(AREA, Ok), (HEIGHT, Ok), (INFLOW, Ok), (LEVEL, Ok), (RATE, Error)] {
        assert_eq!(master.set_real(vr, 0.5), expected);
    }
    unsafe { (master.f.fmi2ExitInitializationMode)(master.c) };
    for (vr, expected) in [(AREA, Error), (HEIGHT, Ok), (INFLOW, Ok), (LEVEL, Error)] {
        assert_eq!(master.set_real(vr, 0.5), expected);
    }
}

#[test]
fn a_number_that_is_not_finite_is_refused_by_name_and_unit() {
    let master = ready();
    for (wrong, text) in [(f64::NAN, "NaN"), (f64::INFINITY, "inf"), (f64::NEG_INFINITY, "-inf")] {
        assert_eq!(master.set_real(INFLOW, wrong), Error);
        master.heard_one(&["inflow", text, "m3/s", "finite"]);
    }
    assert_eq!(master.real(INFLOW), 0.0);
}

#[test]
fn all_values_of_a_call_are_set_or_none() {
    let (fresh, started) = (new(), ready());
    let reals = |master: &Master, references: [u32; 2], values: [f64; 2], reason: &str| {
        let before = master.bytes();
        let status = unsafe { (master.f.fmi2SetReal)(master.c, references.as_ptr(), 2, values.as_ptr()) };
        assert_eq!(status, Error);
        master.heard_one(&[reason]);
        assert_eq!(master.bytes(), before);
    };
    let reason = "fmi2SetReal: area = -1 m2 is refused; allowed is a number above 0";
    reals(&fresh, [HEIGHT, AREA], [5.0, -1.0], reason);
    reals(&started, [INFLOW, 99], [1.0, 1.0], "value reference 99 is unknown");
    reals(&started, [INFLOW, AREA], [1.0, 1.0], "area cannot be set");
    reals(&started, [INFLOW, INFLOW], [1.0, f64::NAN], "finite");

    let booleans = |references: [u32; 2], values: [i32; 2]| {
        let f = started.f.fmi2SetBoolean;
        unsafe { f(started.c, references.as_ptr(), 2, values.as_ptr()) }
    };
    let before = started.bytes();
    for (second, reason) in [(99, "value reference 99 is unknown"), (FULL, "full cannot be set")] {
        assert_eq!(booleans([VALVE, second], [0, 0]), Error);
        started.heard_one(&[reason]);
        assert_eq!(started.bytes(), before);
    }
    assert_eq!(booleans([VALVE, VALVE], [1, 0]), Ok);
    assert_ne!(started.bytes(), before);

    let strings = |references: [u32; 2], second| {
        let (f, values) = (fresh.f.fmi2SetString, [c"another".as_ptr(), second]);
        unsafe { f(fresh.c, references.as_ptr(), 2, values.as_ptr()) }
    };
    let (before, text) = (fresh.bytes(), c"\xff%s".as_ptr());
    for (references, second, reason) in [
        ([0, 99], text, "value reference 99 is unknown"),
        ([0, 0], null(), "label = NULL"),
        ([0, 0], c"".as_ptr(), "label = \"\" is refused"),
    ] {
        assert_eq!(strings(references, second), Error);
        fresh.heard_one(&[reason]);
        assert_eq!(fresh.bytes(), before);
    }
    // Anything that ends in NUL is a text.
    assert_eq!(strings([0, 0], text), Ok);
    let mut label = null();
    unsafe {
        (fresh.f.fmi2EnterInitializationMode)(fresh.c);
        assert_eq!((fresh.f.fmi2GetString)(fresh.c, &0, 1, &mut label), Ok);
        assert_eq!(CStr::from_ptr(label).to_str(), Result::Ok("\u{fffd}%s"));
    }
}

#[test]
fn an_unknown_value_reference_is_named_and_one_may_be_given_twice() {
    let master = ready();
    assert_eq!(master.set_real(4711, 1.0), Error);
    master.heard_one(&["value reference 4711 is unknown", "type Real; expected one of 0, 1, 2"]);
    assert_eq!(unsafe { (master.f.fmi2GetInteger)(master.c, &1, 1, &mut 0) }, Error);
    master.heard_one(&["value reference 1 is unknown", "type Integer; expected one of 0"]);
    let (references, mut values) = ([LEVEL, LEVEL], [0.0; 2]);
    let get = master.f.fmi2GetReal;
    assert_eq!(
        unsafe { get(master.c, references.as_ptr(), 2, values.as_mut_ptr()) },
        Ok
    );
    assert_eq!(values, [0.5, 0.5]);
}

#[test]
fn null_arrays_and_absurd_counts_are_refused() {
    let master = ready();
    let (c, f) = (master.c, master.f);
    unsafe {
        assert_eq!((f.fmi2GetReal)(c, null(), 0, null_mut()), Ok);
        assert_eq!((f.fmi2SetReal)(c, null(), 0, null()), Ok);
        assert_eq!((f.fmi2GetReal)(c, null(), 1, &mut 0.0), Error);
        master.heard_one(&["vr is NULL"]);
        assert_eq!((f.fmi2GetReal)(c, &LEVEL, 1, null_mut()), Error);
        master.heard_one(&["value is NULL"]);
        assert_eq!((f.fmi2SetReal)(c, &INFLOW, usize::MAX, &0.0), Error);
        master.heard_one(&["count of vr is 18446744073709551615"]);
        let askew = std::ptr::from_ref(&INFLOW).wrapping_byte_add(1);
        assert_eq!((f.fmi2GetReal)(c, askew, 1, &mut 0.0), Error);
        master.heard_one(&["vr is not aligned"]);
        assert_eq!((f.fmi2GetString)(c, &0, 1, null_mut()), Error);
        assert_eq!((f.fmi2GetInteger)(c, null(), 1, null_mut()), Error);
        assert_eq!((f.fmi2GetBoolean)(c, null(), 1, null_mut()), Error);
    }
}

#[test]
fn derivatives_have_orders_and_causalities() {
    let master = ready();
    let (c, f) = (master.c, master.f);
    master.set_real(INFLOW, 3.0);
    let mut value = f64::NAN;
    unsafe {
        assert_eq!((f.fmi2GetRealOutputDerivatives)(c, &LEVEL, 1, &1, &mut value), Ok);
        assert_eq!(value, 1.5);
        assert_eq!((f.fmi2GetRealOutputDerivatives)(c, &LEVEL, 1, &0, &mut value), Error);
        master.heard_one(&["derivative 0 of level is refused"]);
        assert_eq!((f.fmi2GetRealOutputDerivatives)(c, &INFLOW, 1, &1, &mut value), Error);
        master.heard_one(&["inflow", "expected an output"]);
        assert_eq!((f.fmi2SetRealInputDerivatives)(c, &INFLOW, 1, &1, &0.0), Error);
        master.heard_one(&["takes no input derivatives"]);
        assert_eq!((f.fmi2SetRealInputDerivatives)(c, &LEVEL, 1, &1, &0.0), Error);
        master.heard_one(&["level", "expected an input"]);

        let (unknown, known, along) = ([RATE, LEVEL], [INFLOW, AREA], [4.0, 0.0]);
        let mut answer = [f64::NAN; 2];
        let status = (f.fmi2GetDirectionalDerivative)(
            c,
            unknown.as_ptr(),
            2,
            known.as_ptr(),
            2,
            along.as_ptr(),
            answer.as_mut_ptr(),
        );
        assert_eq!((status, answer), (Ok, [2.0, 0.0]));
    }
}
