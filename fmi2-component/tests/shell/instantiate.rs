//! Guards instantiation and logging through the C functions.

use std::ffi::{CStr, CString, c_char, c_int};
use std::ptr::{null, null_mut};

use crate::{new, ready};
use fmi2_boundary::{Fmu, Line, Master, callbacks};
use fmi2_component::Status;
use fmi2_component::abi::CallbackFunctions;

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
        assert_eq!(log[0].status, Status::Error);
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
        assert_eq!((f.fmi2DoStep)(c, 0.0, 1.0, 1), Status::Error);
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
    master.set_real(2, 100.0);
    assert_eq!(master.step(0.0, 1.0), Status::Ok);
    (status, master.heard())
}

fn choose(m: &Master, on: c_int, names: &[&CStr]) -> Status {
    let names: Vec<_> = names.iter().map(|name| name.as_ptr()).collect();
    unsafe { (m.f.fmi2SetDebugLogging)(m.c, on, names.len(), names.as_ptr()) }
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
        assert_eq!((status, log.len()), (Status::Ok, 1));
        assert_eq!(log[0].category, "logEvents");
        assert_eq!(log[0].text, "A \"tank\" is 100%% full", "a printf format");
    }
    for (on, names) in [(1, &[c"logStatusError"][..]), (0, &[]), (0, &[c"logEvents"])] {
        let (status, log) = overflow(|m| choose(m, on, names));
        assert_eq!((status, log.len()), (Status::Ok, 0));
    }
}

#[test]
fn an_unknown_category_is_a_warning() {
    let (status, log) = overflow(|m| choose(m, 1, &[c"logEverything", c"logEvents"]));
    assert_eq!(status, Status::Warning);
    assert_eq!(log.len(), 2);
    assert!(log[0].text.contains("logEverything") && log[0].text.contains("logEvents, "));
    let (status, _) = overflow(|m| unsafe { (m.f.fmi2SetDebugLogging)(m.c, 1, 1, &null()) });
    assert_eq!(status, Status::Warning);
    let (status, _) = overflow(|m| unsafe { (m.f.fmi2SetDebugLogging)(m.c, 1, 1, null()) });
    assert_eq!(status, Status::Error);
}
