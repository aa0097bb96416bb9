//! Guards the shell through its C functions, with the example component: setting and getting values, the life cycle, FMU states,
//! instantiation and logging.

use std::ffi::{CStr, CString, c_char, c_int};
use std::ptr::{null, null_mut, without_provenance_mut};

use fmi2_boundary::{Fmu, Interface, Line, Master, Raw, call, callbacks};
use fmi2_component::Status::{self, Error, Ok};
use fmi2_component::abi::CallbackFunctions;

/// A tank that has been instantiated.
fn new() -> Master {
    Master::new(&Fmu::tank(), Interface::CoSimulation)
}

/// A tank that is ready to step.
fn ready() -> Master {
    Master::ready(&Fmu::tank())
}

const AREA: u32 = 0;
const HEIGHT: u32 = 1;
const INFLOW: u32 = 2;
const LEVEL: u32 = 3;
const RATE: u32 = 4;
const VALVE: u32 = 0;
const FULL: u32 = 1;

/// Instantiates and frees; answers whether there was an instance, and the log.
fn try_out(name: *const c_char, kind: c_int, guid: *const c_char, location: &CStr) -> (bool, Vec<Line>) {
    let (f, mut lines) = (Fmu::tank().functions, Vec::new());
    let functions = callbacks(&mut lines);
    let c = unsafe { (f.fmi2Instantiate)(name, kind, guid, location.as_ptr(), &functions, 0, 0) };
    unsafe { (f.fmi2FreeInstance)(c) };
    (!c.is_null(), lines)
}

fn guid() -> CString {
    CString::new(Fmu::tank().guid()).unwrap()
}

#[test]
fn a_library_meets_only_its_own_description() {
    let name = c"one".as_ptr();
    for stale in [null(), c"".as_ptr(), c"0-0".as_ptr(), c"\xff%n".as_ptr()] {
        let (alive, log) = try_out(name, 1, stale, c"");
        assert!(!alive);
        assert_eq!(log.len(), 1);
        assert!(log[0].text.contains(&Fmu::tank().guid()) && log[0].text.contains("do not belong together"));
        assert_eq!(log[0].status, Error);
    }
    assert!(try_out(name, 1, guid().as_ptr(), c"").0);
    let braced = CString::new(format!("{{{}}}", Fmu::tank().guid())).unwrap();
    assert!(try_out(name, 1, braced.as_ptr(), c"").0);
}

#[test]
fn a_name_and_the_right_interface_are_needed_and_the_resource_location_is_not_read() {
    let (guid, one) = (guid(), c"one".as_ptr());
    for location in [c"", c"file:///tmp/a%20b", c"file:////tmp", c"/tmp", c"\xff"] {
        assert!(try_out(one, 1, guid.as_ptr(), location).0);
    }
    assert!(!new().c.is_null(), "NULL");
    for (name, kind, reason) in [
        (null(), 1, "instanceName"),
        (c"".as_ptr(), 1, "instanceName"),
        (one, 0, "fmuType = 0"),
        (one, 7, "fmuType = 7"),
    ] {
        let (alive, log) = try_out(name, kind, guid.as_ptr(), c"");
        assert!(!alive && log[0].text.contains(reason), "{log:?}");
    }
}

#[test]
fn callbacks_may_be_missing() {
    let (name, guid, f) = (c"one".as_ptr(), guid(), Fmu::tank().functions);
    unsafe {
        assert!((f.fmi2Instantiate)(name, 1, guid.as_ptr(), null(), null(), 0, 1).is_null());
        let mute = CallbackFunctions {
            logger: None,
            allocate_memory: None,
            free_memory: None,
            step_finished: None,
            component_environment: null_mut(),
        };
        let c = (f.fmi2Instantiate)(name, 1, guid.as_ptr(), null(), &mute, 0, 1);
        assert!(!c.is_null());
        assert_eq!((f.fmi2DoStep)(c, 0.0, 1.0, 1), Error);
        (f.fmi2FreeInstance)(c);
    }
}

#[test]
fn version_and_platform_are_those_of_the_standard() {
    let f = Fmu::tank().functions;
    unsafe {
        assert_eq!(CStr::from_ptr((f.fmi2GetVersion)()), c"2.0");
        assert_eq!(CStr::from_ptr((f.fmi2GetTypesPlatform)()), c"default");
    }
}

/// Lets the tank overflow and answers what was logged of it.
fn overflow(set_up: impl Fn(&Master) -> Status) -> (Status, Vec<Line>) {
    let master = ready();
    let status = set_up(&master);
    master.set_real(INFLOW, 100.0);
    assert_eq!(master.step(0.0, 1.0), Ok);
    (status, master.heard())
}

fn choose(m: &Master, on: c_int, names: &[&CStr]) -> Status {
    let names: Vec<_> = names.iter().map(|name| name.as_ptr()).collect();
    call!(m.fmi2SetDebugLogging(on, names.len(), names.as_ptr()))
}

#[test]
fn a_category_is_heard_when_it_is_switched_on() {
    for names in [
        &[c"logEvents"][..],
        &[c"logAll"],
        &[c"logStatusError", c"logEvents"],
        &[],
    ] {
        let (status, log) = overflow(|m| choose(m, 1, names));
        assert_eq!((status, log.len()), (Ok, 1));
        assert_eq!(log[0].category, "logEvents");
        assert_eq!(log[0].text, "A \"tank\" is 100%% full", "a printf format");
    }
    for (on, names) in [(1, &[c"logStatusError"][..]), (0, &[]), (0, &[c"logEvents"])] {
        let (status, log) = overflow(|m| choose(m, on, names));
        assert_eq!((status, log.len()), (Ok, 0));
    }
}

#[test]
fn an_unknown_category_is_a_warning() {
    let (status, log) = overflow(|m| choose(m, 1, &[c"logEverything", c"logEvents"]));
    assert_eq!(status, Status::Warning);
    assert_eq!(log.len(), 2);
    assert!(log[0].text.contains("logEverything") && log[0].text.contains("logEvents, "));
    let (status, _) = overflow(|m| call!(m.fmi2SetDebugLogging(1, 1, &null())));
    assert_eq!(status, Status::Warning);
    let (status, _) = overflow(|m| call!(m.fmi2SetDebugLogging(1, 1, null())));
    assert_eq!(status, Error);
}

type Call = fn(&Master) -> Status;

/// Every function that depends on the state, called with arguments that are in order.
const CALLS: &[(&str, Call)] = {
    macro_rules! calls {
        ($($name:ident($($argument:expr),*);)*) => { &[$((stringify!($name), |m| call!(m.$name($($argument),*)))),*] };
    }
    calls! {
        fmi2SetupExperiment(0, 0.0, 0.0, 0, 0.0);
        fmi2EnterInitializationMode();
        fmi2ExitInitializationMode();
        fmi2Terminate();
        fmi2DoStep(0.0, 0.1, 1);
        fmi2CancelStep();
        fmi2GetReal(&3, 1, &mut 0.0);
        fmi2SetReal(&2, 1, &0.0);
        fmi2GetInteger(&0, 1, &mut 0);
        fmi2GetBoolean(&0, 1, &mut 0);
        fmi2SetBoolean(&0, 1, &1);
        fmi2GetRealOutputDerivatives(&3, 1, &1, &mut 0.0);
        fmi2GetStatus(0, &mut Ok);
        fmi2GetRealStatus(2, &mut 0.0);
        fmi2GetBooleanStatus(3, &mut 0);
        fmi2GetStringStatus(1, &mut null());
        fmi2EnterEventMode();
        fmi2NewDiscreteStates(null_mut());
        fmi2EnterContinuousTimeMode();
        fmi2CompletedIntegratorStep(1, &mut 0, &mut 0);
        fmi2SetTime(0.0);
        fmi2SetContinuousStates(&0.0, 1);
        fmi2GetDerivatives(&mut 0.0, 1);
        fmi2GetEventIndicators(&mut 0.0, 1);
        fmi2GetContinuousStates(&mut 0.0, 1);
        fmi2GetNominalsOfContinuousStates(&mut 0.0, 1);
    }
};

fn initialise(master: &Master) {
    call!(master.fmi2EnterInitializationMode());
}

fn start(master: &Master) {
    initialise(master);
    call!(master.fmi2ExitInitializationMode());
}

fn fail(master: &Master) {
    start(master);
    master.set_real(INFLOW, -100.0);
    assert_eq!(master.step(0.0, 1.0), Status::Discard);
}

fn terminate(master: &Master) {
    start(master);
    call!(master.fmi2Terminate());
}

#[test]
fn each_state_has_its_functions_and_a_call_out_of_order_does_no_harm() {
    let read = "GetReal GetInteger GetBoolean";
    let write = "SetReal SetBoolean";
    let ask = "GetRealOutputDerivatives GetStatus GetRealStatus GetBooleanStatus GetStringStatus";
    type Path = fn(&Master);
    let states: [(Path, &[&str]); 5] = [
        (|_| (), &["SetupExperiment EnterInitializationMode", write]),
        (initialise, &["ExitInitializationMode", read, write]),
        (start, &["DoStep Terminate", read, write, ask]),
        (fail, &["Terminate", read, ask]),
        (terminate, &[read, ask]),
    ];
    for (lead_there, legal) in states {
        let legal: Vec<_> = legal.iter().flat_map(|names| names.split(' ')).collect();
        for (name, call) in CALLS {
            let master = new();
            lead_there(&master);
            let before = master.bytes();
            master.heard();
            let status = call(&master);
            if legal.contains(&&name[4..]) {
                assert_eq!(status, Ok, "{name}: {:?}", master.heard());
            } else {
                assert_eq!(status, Error, "{name}");
                master.heard_one(&[&format!("{name} is illegal in state")]);
                assert_eq!(master.bytes(), before, "{name} did harm");
            }
        }
    }
}

#[test]
fn null_is_no_instance() {
    let refused = Master::at(&Fmu::tank(), 7, "", None);
    assert!(refused.c.is_null());
    for (name, call) in CALLS {
        assert_eq!(call(&refused), Error, "{name}");
    }
    call!(refused.fmi2FreeInstance());
}

#[test]
fn a_reset_instance_equals_a_fresh_one() {
    let (used, fresh) = (new(), new());
    used.set_real(AREA, 3.0);
    fail(&used);
    assert_eq!(call!(used.fmi2Reset()), Ok);
    assert_eq!(used.bytes(), fresh.bytes());
}

#[test]
fn a_discarded_step_changes_nothing_and_wants_to_end() {
    let master = ready();
    master.set_real(INFLOW, 0.1);
    assert_eq!(master.step(0.0, 1.0), Ok);
    let level = master.real(LEVEL);
    master.set_real(INFLOW, -100.0);
    assert_eq!(master.step(1.0, 1.0), Status::Discard);
    master.heard_one(&["fmi2DoStep", "runs dry before 2 s"]);
    assert_eq!(master.real(LEVEL), level);
    let (mut time, mut wants_to_end, mut status) = (f64::NAN, 0, Ok);
    assert_eq!(call!(master.fmi2GetRealStatus(2, &mut time)), Ok);
    assert_eq!(call!(master.fmi2GetBooleanStatus(3, &mut wants_to_end)), Ok);
    assert_eq!(call!(master.fmi2GetStatus(0, &mut status)), Ok);
    assert_eq!((time, wants_to_end, status), (1.0, 1, Status::Discard));
}

#[test]
fn a_status_of_the_wrong_type_is_discarded() {
    let master = ready();
    assert_eq!(call!(master.fmi2GetStatus(2, &mut Ok)), Status::Discard);
    assert_eq!(call!(master.fmi2GetIntegerStatus(0, &mut 0)), Status::Discard);
    assert_eq!(call!(master.fmi2GetRealStatus(2, null_mut())), Error);
}

#[test]
fn steps_follow_each_other() {
    let master = ready();
    assert_eq!(master.step(0.0, 0.1), Ok);
    assert_eq!(master.step(0.1 * (1.0 + 1e-12), 0.1), Ok);
    assert_eq!(master.step(0.1, 0.1), Error);
    master.heard_one(&["currentCommunicationPoint = 0.1 s", "ended at 0.2"]);
    for wrong in [-0.1, f64::NAN, f64::INFINITY] {
        assert_eq!(master.step(0.2, wrong), Error);
        master.heard_one(&["communicationStepSize", "at least 0"]);
    }
    for wrong in [f64::NAN, f64::NEG_INFINITY] {
        assert_eq!(master.step(wrong, 0.1), Error);
        master.heard();
    }
    assert_eq!(master.step(0.2, 0.0), Ok);
    assert_eq!(master.step(0.2, 0.1), Ok);
}

#[test]
fn a_step_may_lead_past_the_stop_time_by_rounding_only() {
    let master = new();
    call!(master.fmi2SetupExperiment(1, 1e-6, 0.0, 1, 1.0));
    start(&master);
    assert_eq!(master.step(0.0, 0.9), Ok);
    assert_eq!(master.step(0.9, 0.3), Error);
    master.heard_one(&["from 0.9 s to 1.2 s", "stopTime = 1 s"]);
    assert_eq!(master.step(0.9, 0.1 + 1e-8), Error);
    master.heard_one(&["stopTime = 1 s"]);
    assert_eq!(master.step(0.9, 0.1 + 1e-12), Ok);
    assert_eq!(master.step(1.0, 0.3), Error);
    master.heard_one(&["stopTime = 1 s"]);
}

#[test]
fn an_experiment_without_sense_is_refused() {
    let master = new();
    for (start, stop) in [(f64::NAN, 1.0), (f64::INFINITY, 1.0), (0.0, f64::NAN), (2.0, 1.0)] {
        let status = call!(master.fmi2SetupExperiment(0, 0.0, start, 1, stop));
        assert_eq!(status, Error);
        master.heard_one(&["is refused"]);
    }
    for tolerance in [f64::NAN, -1e-6, 1e300] {
        let status = call!(master.fmi2SetupExperiment(1, tolerance, 0.0, 1, 1.0));
        assert_eq!(status, Error);
        master.heard_one(&[
            "tolerance = ",
            "is refused; allowed is a relative tolerance from 0 to 1",
        ]);
    }
    assert_eq!(call!(master.fmi2SetupExperiment(0, f64::NAN, 5.0, 0, f64::NAN)), Ok);
    start(&master);
    assert_eq!(master.step(5.0, 0.1), Ok);
}

#[test]
fn start_values_come_from_the_description() {
    let master = ready();
    assert_eq!(master.real(AREA), 2.0);
    assert_eq!(master.real(LEVEL), 0.5);
    let mut label = null();
    assert_eq!(call!(master.fmi2GetString(&0, 1, &mut label)), Ok);
    assert_eq!(unsafe { CStr::from_ptr(label) }, c"A \"tank\"");
}

#[test]
fn outputs_are_right_in_initialization_mode_however_often_inputs_are_set() {
    let master = new();
    call!(master.fmi2EnterInitializationMode());
    for (inflow, level) in [(1.0, 0.1), (3.0, 0.9)] {
        assert_eq!(master.set_real(INFLOW, inflow), Ok);
        assert_eq!(master.set_real(LEVEL, level), Ok);
        assert_eq!(master.real(RATE), inflow / 2.0);
        assert_eq!(master.real(LEVEL), level);
    }
    // What was set can be read back even where it makes no sense yet.
    assert_eq!(master.set_real(LEVEL, 7.0), Ok);
    assert_eq!(master.real(INFLOW), 3.0);
    assert_eq!(call!(master.fmi2GetReal(&LEVEL, 1, &mut 0.0)), Error);
    master.heard_one(&["level = 7 m is refused", "height = 1 m"]);
    assert_eq!(call!(master.fmi2ExitInitializationMode()), Error);
    master.heard_one(&["fmi2ExitInitializationMode: level = 7 m"]);
    assert_eq!(master.set_real(HEIGHT, 8.0), Ok);
    assert_eq!(call!(master.fmi2ExitInitializationMode()), Ok);
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
    call!(master.fmi2EnterInitializationMode());
    for (vr, expected) in [(AREA, Ok), (HEIGHT, Ok), (INFLOW, Ok), (LEVEL, Ok), (RATE, Error)] {
        assert_eq!(master.set_real(vr, 0.5), expected);
    }
    call!(master.fmi2ExitInitializationMode());
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
        let status = call!(master.fmi2SetReal(references.as_ptr(), 2, values.as_ptr()));
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
        call!(fresh.fmi2EnterInitializationMode());
        assert_eq!(call!(fresh.fmi2GetString(&0, 1, &mut label)), Ok);
        assert_eq!(CStr::from_ptr(label).to_str(), Result::Ok("\u{fffd}%s"));
    }
}

#[test]
fn an_unknown_value_reference_is_named_and_one_may_be_given_twice() {
    let master = ready();
    assert_eq!(master.set_real(4711, 1.0), Error);
    master.heard_one(&["value reference 4711 is unknown", "type Real; expected one of 0, 1, 2"]);
    assert_eq!(call!(master.fmi2GetInteger(&1, 1, &mut 0)), Error);
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

fn read_back(master: &Master, bytes: &[u8]) -> (Status, Raw) {
    let mut state = null_mut();
    let status = call!(master.fmi2DeSerializeFMUstate(bytes.as_ptr().cast(), bytes.len(), &mut state));
    (status, state)
}

#[test]
fn a_state_set_back_continues_bit_by_bit() {
    let master = ready();
    master.set_real(INFLOW, 0.1);
    master.step(0.0, 0.3);
    let mut state = null_mut();
    assert_eq!(call!(master.fmi2GetFMUstate(&mut state)), Ok);
    let run = || {
        (0..5).for_each(|i| assert_eq!(master.step(0.3 + 0.1 * f64::from(i), 0.1), Ok));
        master.bytes()
    };
    let first = run();
    assert_eq!(call!(master.fmi2SetFMUstate(state)), Ok);
    assert_eq!(run(), first);
}

#[test]
fn a_state_continues_in_an_experiment_that_ends_later() {
    let (short, long, fresh) = (new(), new(), new());
    for (master, stop) in [(&short, 2.5), (&long, 5.0)] {
        assert_eq!(call!(master.fmi2SetupExperiment(0, 0.0, 0.0, 1, stop)), Ok);
        assert_eq!(call!(master.fmi2EnterInitializationMode()), Ok);
        assert_eq!(call!(master.fmi2ExitInitializationMode()), Ok);
    }
    short.step(0.0, 2.0);
    for master in [&long, &fresh] {
        let (status, state) = read_back(master, &short.bytes());
        assert_eq!((status, call!(master.fmi2SetFMUstate(state))), (Ok, Ok));
        assert_eq!(master.step(2.0, 1.0), Ok);
    }
    assert_eq!(long.step(3.0, 3.0), Error);
    long.heard_one(&["stopTime = 5 s"]);
}

#[test]
fn a_state_given_on_entry_is_overwritten_and_thousands_need_not_be_freed() {
    let master = ready();
    let mut state = null_mut();
    let take = |state: &mut Raw| assert_eq!(call!(master.fmi2GetFMUstate(state)), Ok);
    take(&mut state);
    let handle = state;
    master.set_real(INFLOW, 0.2);
    take(&mut state);
    assert_eq!(state, handle);
    master.set_real(INFLOW, 0.0);
    call!(master.fmi2SetFMUstate(state));
    assert_eq!(master.real(INFLOW), 0.2);
    (0..10_000).for_each(|_| take(&mut null_mut()));
}

#[test]
fn every_damaged_or_truncated_blob_is_refused() {
    let master = ready();
    let good = master.bytes();
    for end in 0..good.len() {
        let (status, state) = read_back(&master, &good[..end]);
        assert_eq!((status, state), (Error, null_mut()), "{end} bytes");
        master.heard();
    }
    for i in 0..good.len() {
        let mut bad = good.clone();
        bad[i] ^= 0x10;
        assert_eq!(read_back(&master, &bad).0, Error, "byte {i}");
    }
    assert_eq!(read_back(&master, &[&good[..], b"!"].concat()).0, Error);
    assert_eq!(master.bytes(), good);
}

#[test]
fn a_handle_that_is_not_of_this_instance_is_refused() {
    let (one, two) = (ready(), ready());
    let mut state = null_mut();
    call!(one.fmi2GetFMUstate(&mut state));
    for foreign in [state, null_mut(), without_provenance_mut(usize::MAX)] {
        assert_eq!(call!(two.fmi2SetFMUstate(foreign)), Error);
        two.heard_one(&["not one that this instance has given out"]);
    }
    let mut freed = state;
    assert_eq!(call!(one.fmi2FreeFMUstate(&mut freed)), Ok);
    assert_eq!(call!(one.fmi2SetFMUstate(state)), Error);
    assert_eq!(call!(one.fmi2FreeFMUstate(&mut state)), Error);
    assert_eq!(call!(one.fmi2SerializedFMUstateSize(state, &mut 0)), Error);
}

#[test]
fn null_and_a_small_buffer_are_dealt_with() {
    let master = ready();
    let (c, f) = (master.c, master.f);
    let mut state = null_mut();
    unsafe {
        assert_eq!((f.fmi2FreeFMUstate)(c, null_mut()), Ok);
        assert_eq!((f.fmi2FreeFMUstate)(c, &mut state), Ok);
        assert_eq!((f.fmi2GetFMUstate)(c, null_mut()), Error);
        assert_eq!((f.fmi2DeSerializeFMUstate)(c, null(), 100, &mut state), Error);
        (f.fmi2GetFMUstate)(c, &mut state);
        assert_eq!((f.fmi2SerializedFMUstateSize)(c, state, null_mut()), Error);
        master.heard();
        assert_eq!((f.fmi2SerializeFMUstate)(c, state, [0; 4].as_mut_ptr(), 4), Error);
        master.heard_one(&["size = 4 is too small"]);
        assert_eq!((f.fmi2SerializeFMUstate)(c, state, null_mut(), 4096), Error);
    }
}
