//! Guards the shell against a component that panics and refuses at every opportunity, and a logger that calls back. Its table is written by
//! hand.

use std::ffi::{c_char, c_void};
use std::ptr::{null, null_mut};
use std::sync::atomic::{AtomicPtr, AtomicU32, Ordering};

use fmi2_boundary::{Functions, Master, call, callbacks, functions_of, refused};
use fmi2_component::abi::CallbackFunctions;
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

/// Its mood.
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

const PERSON: Functions = functions_of!(fmi2_functions);

fn in_mood(mood: i32) -> Master {
    let master = Master::instantiate(PERSON, 1, [c"one".as_ptr(), c"moody".as_ptr(), null()]);
    master.start();
    master.well(master.set_integer(0, mood));
    master
}

#[test]
fn a_panic_and_a_fatal_refusal_are_logged_and_leave_nothing_but_to_free_that_instance() {
    let other = in_mood(0);
    let get = |m: &Master| call!(m.fmi2GetInteger(&0, 1, &mut 0));
    let step = |m: &Master| m.step(0.0, 1.0);
    type Call = fn(&Master) -> Status;
    let calls: [(i32, Call, &[&str]); 3] = [
        (
            PANIC_ON_STEP,
            step,
            &["fmi2DoStep: the component has panicked (stepped)"],
        ),
        (PANIC_ON_GET, get, &["fmi2GetInteger", "got 100%%"]),
        (FATAL_ON_STEP, step, &["all is lost"]),
    ];
    for (mood, call, reason) in calls {
        let m = in_mood(mood);
        m.expect(call(&m), Status::Fatal, reason);
        for call in [m.f.fmi2Reset, m.f.fmi2Terminate, m.f.fmi2EnterInitializationMode] {
            m.expect(unsafe { call(m.c) }, Status::Fatal, &["only fmi2FreeInstance"]);
        }
        assert_eq!(get(&m), Status::Fatal);
    }
    other.well(other.step(0.0, 1.0));
    drop(in_mood(PANIC_ON_DROP));
}

#[test]
fn after_an_error_in_a_step_values_can_be_read_and_the_instance_reset() {
    let m = in_mood(ERROR_ON_STEP);
    refused!(m.fmi2DoStep(0.0, 1.0, 1) => "cannot go on");
    assert_eq!(m.integer(0), ERROR_ON_STEP);
    refused!(m.fmi2DoStep(0.0, 1.0, 1) => "illegal in state error");
    m.well(call!(m.fmi2Reset()));
    m.well(call!(m.fmi2EnterInitializationMode()));
}

#[test]
fn what_a_component_does_not_provide_is_refused() {
    let m = in_mood(0);
    let (mut state, mut size) = (null_mut(), 0);
    m.well(call!(m.fmi2GetFMUstate(&mut state)));
    refused!(m.fmi2SerializedFMUstateSize(state, &mut size) => "cannot be serialised");
    let absent = "the model has no variables of type Real";
    refused!(m.fmi2GetReal(&0, 1, &mut 0.0) => "value reference 0 is unknown", absent);
}

#[test]
fn a_logger_cannot_call_back_into_its_instance() {
    static INSTANCE: AtomicPtr<c_void> = AtomicPtr::new(null_mut());
    static REFUSED: AtomicU32 = AtomicU32::new(0);
    type Text = *const c_char;
    unsafe extern "C" fn call_back(_: *mut c_void, _: Text, _: Status, _: Text, _: Text) {
        let c = INSTANCE.load(Ordering::Relaxed);
        unsafe { (PERSON.fmi2FreeInstance)(c) };
        if unsafe { (PERSON.fmi2Reset)(c) } == Status::Error {
            REFUSED.fetch_add(1, Ordering::Relaxed);
        }
    }
    let call_back: unsafe extern "C" fn(_, _, _, _, _) = call_back;
    // SAFETY: as for the logger of `Master`.
    let logger = unsafe { std::mem::transmute::<*const (), fmi2_component::Logger>(call_back as *const ()) };
    let functions = CallbackFunctions { logger: Some(logger), ..callbacks(null_mut()) };
    unsafe {
        let c = (PERSON.fmi2Instantiate)(c"one".as_ptr(), 1, c"moody".as_ptr(), null(), &functions, 0, 0);
        INSTANCE.store(c, Ordering::Relaxed);
        assert_eq!((PERSON.fmi2DoStep)(c, 0.0, 1.0, 1), Status::Error);
        assert_eq!(REFUSED.load(Ordering::Relaxed), 1);
        (PERSON.fmi2FreeInstance)(c);
    }
}
