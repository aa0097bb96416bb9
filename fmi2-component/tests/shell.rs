//! Guards the shell through its C functions, with the example component: setting and getting values, the life cycle, FMU states,
//! instantiation and logging.

use std::ffi::{CStr, CString, c_char, c_int};
use std::ptr::{null, null_mut, without_provenance_mut};

use fmi2_boundary::{Fmu, Interface, Master, call, callbacks, refused};
use fmi2_component::Status::{self, Discard, Error, Ok, Warning};
use fmi2_component::abi::{CFmuState, CallbackFunctions};

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

#[test]
fn name_guid_and_interface_are_checked_and_the_resource_location_is_not_read() {
    let text = Fmu::tank().guid();
    let [plain, braced] = [text.clone(), format!("{{{text}}}")].map(|guid| CString::new(guid).unwrap());
    let (own, one, f) = (plain.as_ptr(), c"one".as_ptr(), Fmu::tank().functions);
    for location in [c"", c"file:///tmp/a%20b", c"file:////tmp", c"/tmp", c"\xff"] {
        assert!(!Master::instantiate(f, 1, [one, own, location.as_ptr()]).c.is_null());
    }
    assert!(!Master::instantiate(f, 1, [one, braced.as_ptr(), null()]).c.is_null());
    for (name, kind, guid, reason) in [
        (null(), 1, own, "instanceName"),
        (c"".as_ptr(), 1, own, "instanceName"),
        (one, 0, own, "fmuType = 0"),
        (one, 7, own, "fmuType = 7"),
        (one, 1, null(), "do not belong together"),
        (one, 1, c"".as_ptr(), &text),
        (one, 1, c"0-0".as_ptr(), &text),
        (one, 1, c"\xff%n".as_ptr(), &text),
    ] {
        let m = Master::instantiate(f, kind, [name, guid, null()]);
        assert!(m.c.is_null());
        let heard = m.heard();
        let one = heard.len() == 1 && heard[0].status == Error;
        assert!(one && heard[0].text.contains(reason), "{heard:?}");
    }
}

#[test]
fn callbacks_may_be_missing() {
    let (name, guid) = (c"one".as_ptr(), CString::new(Fmu::tank().guid()).unwrap());
    let f = Fmu::tank().functions;
    let mute = CallbackFunctions { logger: None, ..callbacks(null_mut()) };
    unsafe {
        assert!((f.fmi2Instantiate)(name, 1, guid.as_ptr(), null(), null(), 0, 1).is_null());
        let c = (f.fmi2Instantiate)(name, 1, guid.as_ptr(), null(), &mute, 0, 1);
        assert!(!c.is_null());
        assert_eq!((f.fmi2DoStep)(c, 0.0, 1.0, 1), Error);
        (f.fmi2FreeInstance)(c);
        assert_eq!(CStr::from_ptr((f.fmi2GetVersion)()), c"2.0");
        assert_eq!(CStr::from_ptr((f.fmi2GetTypesPlatform)()), c"default");
    }
}

#[test]
fn a_category_is_heard_when_it_is_switched_on_and_an_unknown_one_is_a_warning() {
    // Lets the tank overflow; what was logged.
    let overflow = |on: c_int, names: &[*const c_char], expected: Status| {
        let m = ready();
        assert_eq!(call!(m.fmi2SetDebugLogging(on, names.len(), names.as_ptr())), expected);
        m.set_real(INFLOW, 100.0);
        m.well(m.step(0.0, 1.0));
        m.heard()
    };
    let [events, all, error, other] = [c"logEvents", c"logAll", c"logStatusError", c"logEverything"].map(CStr::as_ptr);
    for names in [&[events][..], &[all], &[error, events], &[]] {
        let log = overflow(1, names, Ok);
        assert_eq!((log.len(), log[0].category.as_str()), (1, "logEvents"));
        assert_eq!(log[0].text, "A \"tank\" is 100%% full", "a printf format");
    }
    for (on, names) in [(1, &[error][..]), (0, &[]), (0, &[events])] {
        assert!(overflow(on, names, Ok).is_empty());
    }
    let log = overflow(1, &[other, events], Warning);
    assert!(log.len() == 2 && log[0].text.contains("logEverything") && log[0].text.contains("logEvents, "));
    overflow(1, &[null()], Warning);
    let m = ready();
    refused!(m.fmi2SetDebugLogging(1, 1, null()));
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
fn each_state_has_its_functions_a_call_out_of_order_does_no_harm_and_a_reset_instance_equals_a_fresh_one() {
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
    let fresh = new().bytes();
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
                master.expect(status, Error, &[name, "is illegal in state"]);
                assert_eq!(master.bytes(), before, "{name} did harm");
            }
            master.well(call!(master.fmi2Reset()));
            assert_eq!(master.bytes(), fresh, "{name}");
        }
    }
}

#[test]
fn null_is_no_instance() {
    let nobody = Master::instantiate(Fmu::tank().functions, 7, [null(), null(), null()]);
    assert!(nobody.c.is_null() && CALLS.iter().all(|(_, call)| call(&nobody) == Error));
    call!(nobody.fmi2FreeInstance());
}

#[test]
fn a_discarded_step_changes_nothing_wants_to_end_and_its_status_can_be_asked_for() {
    let master = ready();
    master.set_real(INFLOW, 0.1);
    assert_eq!(master.step(0.0, 1.0), Ok);
    let level = master.real(LEVEL);
    master.set_real(INFLOW, -100.0);
    master.expect(master.step(1.0, 1.0), Discard, &["fmi2DoStep", "runs dry before 2 s"]);
    assert_eq!(master.real(LEVEL), level);
    let (mut time, mut wants_to_end, mut status) = (f64::NAN, 0, Ok);
    assert_eq!(call!(master.fmi2GetRealStatus(2, &mut time)), Ok);
    assert_eq!(call!(master.fmi2GetBooleanStatus(3, &mut wants_to_end)), Ok);
    assert_eq!(call!(master.fmi2GetStatus(0, &mut status)), Ok);
    assert_eq!((time, wants_to_end, status), (1.0, 1, Discard));
    // A status of the wrong type.
    assert_eq!(call!(master.fmi2GetStatus(2, &mut Ok)), Discard);
    assert_eq!(call!(master.fmi2GetIntegerStatus(0, &mut 0)), Discard);
    assert_eq!(call!(master.fmi2GetRealStatus(2, null_mut())), Error);
}

#[test]
fn steps_follow_each_other() {
    let master = ready();
    assert_eq!(master.step(0.0, 0.1), Ok);
    assert_eq!(master.step(0.1 * (1.0 + 1e-12), 0.1), Ok);
    refused!(master.fmi2DoStep(0.1, 0.1, 1) => "currentCommunicationPoint = 0.1 s", "ended at 0.2");
    for wrong in [-0.1, f64::NAN, f64::INFINITY] {
        refused!(master.fmi2DoStep(0.2, wrong, 1) => "communicationStepSize", "at least 0");
    }
    for wrong in [f64::NAN, f64::NEG_INFINITY] {
        refused!(master.fmi2DoStep(wrong, 0.1, 1));
    }
    assert_eq!(master.step(0.2, 0.0), Ok);
    assert_eq!(master.step(0.2, 0.1), Ok);
}

#[test]
fn a_step_may_lead_past_the_stop_time_by_rounding_only() {
    let master = new();
    call!(master.fmi2SetupExperiment(1, 1e-6, 0.0, 1, 1.0));
    start(&master);
    master.well(master.step(0.0, 0.9));
    refused!(master.fmi2DoStep(0.9, 0.3, 1) => "from 0.9 s to 1.2 s", "stopTime = 1 s");
    refused!(master.fmi2DoStep(0.9, 0.1 + 1e-8, 1) => "stopTime = 1 s");
    assert_eq!(master.step(0.9, 0.1 + 1e-12), Ok);
    refused!(master.fmi2DoStep(1.0, 0.3, 1) => "stopTime = 1 s");
}

#[test]
fn an_experiment_without_sense_is_refused() {
    let master = new();
    for (start, stop) in [(f64::NAN, 1.0), (f64::INFINITY, 1.0), (0.0, f64::NAN), (2.0, 1.0)] {
        refused!(master.fmi2SetupExperiment(0, 0.0, start, 1, stop) => "is refused");
    }
    let allowed = "is refused; allowed is a relative tolerance from 0 to 1";
    for tolerance in [f64::NAN, -1e-6, 1e300] {
        refused!(master.fmi2SetupExperiment(1, tolerance, 0.0, 1, 1.0) => "tolerance = ", allowed);
    }
    assert_eq!(call!(master.fmi2SetupExperiment(0, f64::NAN, 5.0, 0, f64::NAN)), Ok);
    start(&master);
    assert_eq!(master.step(5.0, 0.1), Ok);
}

#[test]
fn outputs_are_right_in_initialization_mode_however_often_inputs_are_set() {
    let (master, mut label) = (new(), null());
    call!(master.fmi2EnterInitializationMode());
    // Start values come from the description.
    assert_eq!(master.reals(&[AREA, LEVEL]), [2.0, 0.5]);
    assert_eq!(call!(master.fmi2GetString(&0, 1, &mut label)), Ok);
    assert_eq!(unsafe { CStr::from_ptr(label) }, c"A \"tank\"");
    for (inflow, level) in [(1.0, 0.1), (3.0, 0.9)] {
        assert_eq!(master.set_reals(&[INFLOW, LEVEL], &[inflow, level]), Ok);
        assert_eq!(master.reals(&[RATE, LEVEL]), [inflow / 2.0, level]);
    }
    // What was set can be read back even where it makes no sense yet.
    assert_eq!(master.set_real(LEVEL, 7.0), Ok);
    assert_eq!(master.real(INFLOW), 3.0);
    refused!(master.fmi2GetReal(&LEVEL, 1, &mut 0.0) => "level = 7 m is refused", "height = 1 m");
    refused!(master.fmi2ExitInitializationMode() => "fmi2ExitInitializationMode: level = 7 m");
    assert_eq!(master.set_real(HEIGHT, 8.0), Ok);
    assert_eq!(call!(master.fmi2ExitInitializationMode()), Ok);
    assert_eq!(master.real(LEVEL), 7.0);
}

#[test]
fn causality_and_variability_say_when_a_variable_may_be_set() {
    let master = new();
    let all = [AREA, HEIGHT, INFLOW, LEVEL, RATE];
    let set = |expected: [Status; 5]| assert_eq!(all.map(|vr| master.set_real(vr, 0.5)), expected);
    set([Ok, Ok, Ok, Ok, Error]);
    let why = "causality output, variability continuous, initial calculated";
    master.heard();
    refused!(master.fmi2SetReal(&RATE, 1, &0.5) => "der(level) cannot be set in state instantiated", why);
    initialise(&master);
    set([Ok, Ok, Ok, Ok, Error]);
    call!(master.fmi2ExitInitializationMode());
    set([Error, Ok, Ok, Error, Error]);
}

#[test]
fn all_values_of_a_call_are_set_or_none_and_what_is_refused_is_named_with_its_unit() {
    let (fresh, started) = (new(), ready());
    let unchanged = |master: &Master, call: &dyn Fn(&Master) -> Status, reason: &str| {
        let before = master.bytes();
        master.expect(call(master), Error, &[reason]);
        assert_eq!(master.bytes(), before);
    };
    let reason = "fmi2SetReal: area = -1 m2 is refused; allowed is a number above 0";
    unchanged(&fresh, &|m| m.set_reals(&[HEIGHT, AREA], &[5.0, -1.0]), reason);
    for (second, value, reason) in [
        (
            99,
            1.0,
            "value reference 99 is unknown among variables of type Real; expected one of 0, 1, 2",
        ),
        (AREA, 1.0, "area cannot be set"),
        (INFLOW, f64::NAN, "finite"),
    ] {
        unchanged(&started, &|m| m.set_reals(&[INFLOW, second], &[1.0, value]), reason);
    }
    let set = |m: &Master, references: [u32; 2], values: [i32; 2]| {
        call!(m.fmi2SetBoolean(references.as_ptr(), 2, values.as_ptr()))
    };
    for (second, reason) in [(99, "value reference 99 is unknown"), (FULL, "full cannot be set")] {
        unchanged(&started, &|m| set(m, [VALVE, second], [0, 0]), reason);
    }
    let before = started.bytes();
    assert_eq!(set(&started, [VALVE, VALVE], [1, 0]), Ok);
    assert_ne!(started.bytes(), before);
    let set = |m: &Master, second: u32, text| {
        call!(m.fmi2SetString([0, second].as_ptr(), 2, [c"another".as_ptr(), text].as_ptr()))
    };
    let text = c"\xff%s".as_ptr();
    for (second, text, reason) in [
        (99, text, "value reference 99 is unknown"),
        (0, null(), "label = NULL"),
        (0, c"".as_ptr(), "label = \"\" is refused"),
    ] {
        unchanged(&fresh, &|m| set(m, second, text), reason);
    }
    for (wrong, text) in [(f64::NAN, "NaN"), (f64::INFINITY, "inf"), (f64::NEG_INFINITY, "-inf")] {
        refused!(started.fmi2SetReal(&INFLOW, 1, &wrong) => "inflow", text, "m3/s", "finite");
    }
    assert_eq!(started.real(INFLOW), 0.0);
    // Anything that ends in NUL is a text.
    assert_eq!(set(&fresh, 0, text), Ok);
    initialise(&fresh);
    let mut label = null();
    assert_eq!(call!(fresh.fmi2GetString(&0, 1, &mut label)), Ok);
    assert_eq!(unsafe { CStr::from_ptr(label) }.to_str(), Result::Ok("\u{fffd}%s"));
}

#[test]
fn null_arrays_and_absurd_counts_are_refused() {
    let m = ready();
    m.well(call!(m.fmi2GetReal(null(), 0, null_mut())));
    m.well(call!(m.fmi2SetReal(null(), 0, null())));
    refused!(m.fmi2GetReal(null(), 1, &mut 0.0) => "vr is NULL");
    refused!(m.fmi2GetReal(&LEVEL, 1, null_mut()) => "value is NULL");
    refused!(m.fmi2SetReal(&INFLOW, usize::MAX, &0.0) => "count of vr is 18446744073709551615");
    refused!(m.fmi2SetReal(&INFLOW, usize::MAX, null()) => "count of vr is 18446744073709551615");
    refused!(m.fmi2GetReal(null(), 1, null_mut()) => "vr is NULL");
    let askew = std::ptr::from_ref(&INFLOW).wrapping_byte_add(1);
    refused!(m.fmi2GetReal(askew, 1, &mut 0.0) => "vr is not aligned");
    refused!(m.fmi2GetString(&0, 1, null_mut()));
    refused!(m.fmi2GetInteger(null(), 1, null_mut()));
    refused!(m.fmi2GetBoolean(null(), 1, null_mut()));
}

#[test]
fn derivatives_have_orders_and_causalities() {
    let m = ready();
    m.set_real(INFLOW, 3.0);
    let mut value = f64::NAN;
    m.well(call!(m.fmi2GetRealOutputDerivatives(&LEVEL, 1, &1, &mut value)));
    assert_eq!(value, 1.5);
    refused!(m.fmi2GetRealOutputDerivatives(&LEVEL, 1, &0, &mut value) => "derivative 0 of level is refused");
    refused!(m.fmi2GetRealOutputDerivatives(&INFLOW, 1, &1, &mut value) => "inflow", "expected an output");
    refused!(m.fmi2SetRealInputDerivatives(&INFLOW, 1, &1, &0.0) => "takes no input derivatives");
    refused!(m.fmi2SetRealInputDerivatives(&LEVEL, 1, &1, &0.0) => "level", "expected an input");

    let (unknown, known, along, mut answer) = ([RATE, LEVEL], [INFLOW, AREA], [4.0, 0.0], [f64::NAN; 2]);
    let (of, by, answers) = (unknown.as_ptr(), known.as_ptr(), answer.as_mut_ptr());
    let status = call!(m.fmi2GetDirectionalDerivative(of, 2, by, 2, along.as_ptr(), answers));
    m.well(status);
    assert_eq!(answer, [2.0, 0.0]);
}

#[test]
fn a_state_continues_in_an_experiment_that_ends_later() {
    let (short, long, fresh) = (new(), new(), new());
    for (master, stop) in [(&short, 2.5), (&long, 5.0)] {
        assert_eq!(call!(master.fmi2SetupExperiment(0, 0.0, 0.0, 1, stop)), Ok);
        start(master);
    }
    short.step(0.0, 2.0);
    for master in [&long, &fresh] {
        assert_eq!(master.restore(&short.bytes()), Ok);
        assert_eq!(master.step(2.0, 1.0), Ok);
    }
    refused!(long.fmi2DoStep(3.0, 3.0, 1) => "stopTime = 5 s");
}

#[test]
fn a_state_given_on_entry_is_overwritten_and_thousands_need_not_be_freed() {
    let master = ready();
    let mut state = null_mut();
    let take = |state: &mut CFmuState| assert_eq!(call!(master.fmi2GetFMUstate(state)), Ok);
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
    let longer = [&good[..], b"!"].concat();
    let truncated = (0..good.len()).map(|end| good[..end].to_vec());
    let damaged = (0..good.len()).map(|n| {
        let mut bad = good.clone();
        bad[n] ^= 0x10;
        bad
    });
    for bad in truncated.chain(damaged).chain([longer]) {
        assert_eq!(master.restore(&bad), Error, "{bad:?}");
        master.heard();
    }
    assert_eq!(master.bytes(), good);
}

#[test]
fn a_handle_that_is_not_of_this_instance_is_refused() {
    let (one, two) = (ready(), ready());
    let mut state = null_mut();
    call!(one.fmi2GetFMUstate(&mut state));
    for foreign in [state, null_mut(), without_provenance_mut(usize::MAX)] {
        refused!(two.fmi2SetFMUstate(foreign) => "not one that this instance has given out");
    }
    let mut freed = state;
    assert_eq!(call!(one.fmi2FreeFMUstate(&mut freed)), Ok);
    assert_eq!(call!(one.fmi2SetFMUstate(state)), Error);
    assert_eq!(call!(one.fmi2FreeFMUstate(&mut state)), Error);
    assert_eq!(call!(one.fmi2SerializedFMUstateSize(state, &mut 0)), Error);
}

#[test]
fn null_and_a_small_buffer_are_dealt_with() {
    let m = ready();
    let mut state = null_mut();
    m.well(call!(m.fmi2FreeFMUstate(null_mut())));
    m.well(call!(m.fmi2FreeFMUstate(&mut state)));
    refused!(m.fmi2GetFMUstate(null_mut()));
    refused!(m.fmi2DeSerializeFMUstate(null(), 100, &mut state));
    m.well(call!(m.fmi2GetFMUstate(&mut state)));
    refused!(m.fmi2SerializedFMUstateSize(state, null_mut()));
    refused!(m.fmi2SerializeFMUstate(state, [0; 4].as_mut_ptr(), 4) => "size = 4 is too small");
    refused!(m.fmi2SerializeFMUstate(state, null_mut(), 4096));
}
