//! Guards the shell against a component that panics and refuses at every opportunity, and a logger that calls back. Its table is written by hand.

use std::ffi::c_void;
use std::ptr::null_mut;
use std::sync::atomic::{AtomicPtr, AtomicU32, Ordering};

use fmi2_boundary::{Fmu, Master, call, callbacks, functions_of};
use fmi2_component::{Causality, Component, Initial, Key, Log, Model, Refusal, Status, Variability, Variable};

struct Moody;

impl Model for Moody {
    const NAME: &'static str = "Moody";
    const IDENTIFIER: &'static str = "Moody";
    const GUID: &'static str = "moody";
    const VERSION: &'static str = "0";
    const STATES: &'static [Self::Real] = &[];
    const DERIVATIVES: &'static [Self::Real] = &[];
    const EVENT_INDICATORS: usize = 0;
    const CATEGORIES: &'static [&'static str] = &["logAll"];
    type Real = Nothing<f64>;
    type Integer = Mood;
    type Boolean = Nothing<bool>;
    type String = Nothing<&'static str>;
}

/// No variable of type `T`.
#[derive(Clone, Copy)]
struct Nothing<T: 'static>(std::marker::PhantomData<T>);

impl<T: Copy + 'static> Key for Nothing<T> {
    type Value = T;
    const VARIABLES: &'static [Variable<T>] = &[];
    const ALL: &'static [Self] = &[];

    fn find(_: u32) -> Option<Self> {
        None
    }

    fn index(self) -> usize {
        unreachable!()
    }
}

/// The only variable: what the component is about to do.
#[derive(Clone, Copy)]
struct Mood;

impl Key for Mood {
    type Value = i32;
    const VARIABLES: &'static [Variable<i32>] = &[Variable {
        name: "mood",
        value_reference: 0,
        causality: Causality::Parameter,
        variability: Variability::Tunable,
        initial: Some(Initial::Exact),
        start: Some(0),
        min: None,
        max: None,
        nominal: None,
        unit: None,
        description: "",
    }];
    const ALL: &'static [Self] = &[Self];

    fn find(value_reference: u32) -> Option<Self> {
        (value_reference == 0).then_some(Self)
    }

    fn index(self) -> usize {
        0
    }
}

const PANIC_ON_GET: i32 = 1;
const PANIC_ON_STEP: i32 = 2;
const ERROR_ON_STEP: i32 = 3;
const FATAL_ON_STEP: i32 = 4;
const PANIC_ON_DROP: i32 = 5;

#[derive(Clone)]
struct Person(i32);

impl Drop for Person {
    fn drop(&mut self) {
        assert_ne!(self.0, PANIC_ON_DROP, "dropped 100%");
    }
}

impl Component for Person {
    type Model = Moody;

    fn new() -> Self {
        Self(0)
    }

    fn get_integer(&self, _: Mood) -> i32 {
        assert_ne!(self.0, PANIC_ON_GET, "got 100%");
        self.0
    }

    fn set_integer(&mut self, _: Mood, value: i32) -> Result<(), Refusal> {
        self.0 = value;
        Ok(())
    }

    fn initialise(&mut self, _: f64, _: &Log) -> Result<(), Refusal> {
        Ok(())
    }

    fn step(&mut self, _: f64, _: f64, _: &Log) -> Result<(), Refusal> {
        match self.0 {
            PANIC_ON_STEP => panic!("stepped"),
            ERROR_ON_STEP => Err(Refusal::error("cannot go on")),
            FATAL_ON_STEP => Err(Refusal::fatal("all is lost")),
            _ => Ok(()),
        }
    }
}

fmi2_component::export!(Person);

const PERSON: Fmu = Fmu {
    name: "Moody",
    functions: functions_of!(fmi2_functions),
    description: "",
};

fn in_mood(mood: i32) -> Master {
    let master = Master::at(&PERSON, 1, "moody", None);
    master.start();
    let status = call!(master.fmi2SetInteger(&0, 1, &mood));
    assert_eq!(status, Status::Ok);
    master
}

fn assert_fatal(master: &Master) {
    let (c, f) = (master.c, master.f);
    for call in [f.fmi2Reset, f.fmi2Terminate, f.fmi2EnterInitializationMode] {
        assert_eq!(unsafe { call(c) }, Status::Fatal);
        master.heard_one(&["only fmi2FreeInstance"]);
    }
    assert_eq!(unsafe { (f.fmi2GetInteger)(c, &0, 1, &mut 0) }, Status::Fatal);
}

#[test]
fn a_panic_is_logged_and_ends_the_instance_only() {
    let other = in_mood(0);
    let master = in_mood(PANIC_ON_STEP);
    assert_eq!(master.step(0.0, 1.0), Status::Fatal);
    master.heard_one(&["fmi2DoStep: the component has panicked (stepped)"]);
    assert_fatal(&master);

    let master = in_mood(PANIC_ON_GET);
    assert_eq!(call!(master.fmi2GetInteger(&0, 1, &mut 0)), Status::Fatal);
    master.heard_one(&["fmi2GetInteger", "got 100%%"]);
    assert_fatal(&master);
    assert_eq!(other.step(0.0, 1.0), Status::Ok);
}

#[test]
fn a_panic_on_being_dropped_goes_no_further() {
    drop(in_mood(PANIC_ON_DROP));
}

#[test]
fn a_fatal_refusal_leaves_nothing_but_to_free_the_instance() {
    let master = in_mood(FATAL_ON_STEP);
    assert_eq!(master.step(0.0, 1.0), Status::Fatal);
    master.heard_one(&["all is lost"]);
    assert_fatal(&master);
}

#[test]
fn after_an_error_in_a_step_values_can_be_read_and_the_instance_reset() {
    let master = in_mood(ERROR_ON_STEP);
    assert_eq!(master.step(0.0, 1.0), Status::Error);
    master.heard_one(&["cannot go on"]);
    assert_eq!(call!(master.fmi2GetInteger(&0, 1, &mut 0)), Status::Ok);
    assert_eq!(master.step(0.0, 1.0), Status::Error);
    master.heard_one(&["illegal in state error"]);
    assert_eq!(call!(master.fmi2Reset()), Status::Ok);
    assert_eq!(call!(master.fmi2EnterInitializationMode()), Status::Ok);
}

#[test]
fn what_a_component_does_not_provide_is_refused() {
    let master = in_mood(0);
    let (mut state, mut size) = (null_mut(), 0);
    assert_eq!(call!(master.fmi2GetFMUstate(&mut state)), Status::Ok);
    assert_eq!(
        call!(master.fmi2SerializedFMUstateSize(state, &mut size)),
        Status::Error
    );
    master.heard_one(&["cannot be serialised"]);
    assert_eq!(call!(master.fmi2GetReal(&0, 1, &mut 0.0)), Status::Error);
    master.heard_one(&[
        "value reference 0 is unknown",
        "the model has no variables of type Real",
    ]);
}

#[test]
fn a_logger_cannot_call_back_into_its_instance() {
    static INSTANCE: AtomicPtr<c_void> = AtomicPtr::new(null_mut());
    static REFUSED: AtomicU32 = AtomicU32::new(0);
    unsafe extern "C" fn call_back(
        _: *mut c_void,
        _: *const std::ffi::c_char,
        _: Status,
        _: *const std::ffi::c_char,
        _: *const std::ffi::c_char,
    ) {
        let (c, f) = (INSTANCE.load(Ordering::Relaxed), PERSON.functions);
        unsafe { (f.fmi2FreeInstance)(c) };
        if unsafe { (f.fmi2Reset)(c) } == Status::Error {
            REFUSED.fetch_add(1, Ordering::Relaxed);
        }
    }
    let mut functions = callbacks(null_mut());
    let call_back: unsafe extern "C" fn(_, _, _, _, _) = call_back;
    // SAFETY: as for the logger of `master`.
    functions.logger =
        Some(unsafe { std::mem::transmute::<*const (), fmi2_component::Logger>(call_back as *const ()) });
    unsafe {
        let (name, guid) = (c"one".as_ptr(), c"moody".as_ptr());
        let f = PERSON.functions;
        let c = (f.fmi2Instantiate)(name, 1, guid, std::ptr::null(), &functions, 0, 0);
        INSTANCE.store(c, Ordering::Relaxed);
        assert_eq!((f.fmi2DoStep)(c, 0.0, 1.0, 1), Status::Error);
        assert_eq!(REFUSED.load(Ordering::Relaxed), 1);
        (f.fmi2FreeInstance)(c);
    }
}
