//! A master that calls the C functions of the example component as C does, and keeps what its logger hears.
#![allow(dead_code)] // each test file uses its own part

use std::ffi::{CStr, CString, c_char, c_int, c_uint, c_void};
use std::ptr::{null, null_mut};

use fmi2_component::abi::CallbackFunctions;
use fmi2_component::{Logger, Status};

pub type Raw = *mut c_void;

unsafe extern "C" {
    pub fn fmi2GetTypesPlatform() -> *const c_char;
    pub fn fmi2GetVersion() -> *const c_char;
    pub fn fmi2Instantiate(
        name: *const c_char,
        fmu_type: c_int,
        guid: *const c_char,
        location: *const c_char,
        functions: *const CallbackFunctions,
        visible: c_int,
        logging: c_int,
    ) -> Raw;
    pub fn fmi2FreeInstance(c: Raw);
    pub fn fmi2SetDebugLogging(c: Raw, on: c_int, n: usize, names: *const *const c_char) -> Status;
    pub fn fmi2SetupExperiment(c: Raw, td: c_int, t: f64, start: f64, sd: c_int, stop: f64) -> Status;
    pub fn fmi2EnterInitializationMode(c: Raw) -> Status;
    pub fn fmi2ExitInitializationMode(c: Raw) -> Status;
    pub fn fmi2Terminate(c: Raw) -> Status;
    pub fn fmi2Reset(c: Raw) -> Status;
    pub fn fmi2GetReal(c: Raw, vr: *const c_uint, n: usize, value: *mut f64) -> Status;
    pub fn fmi2GetInteger(c: Raw, vr: *const c_uint, n: usize, value: *mut c_int) -> Status;
    pub fn fmi2GetBoolean(c: Raw, vr: *const c_uint, n: usize, value: *mut c_int) -> Status;
    pub fn fmi2GetString(c: Raw, vr: *const c_uint, n: usize, value: *mut *const c_char) -> Status;
    pub fn fmi2SetReal(c: Raw, vr: *const c_uint, n: usize, value: *const f64) -> Status;
    pub fn fmi2SetInteger(c: Raw, vr: *const c_uint, n: usize, value: *const c_int) -> Status;
    pub fn fmi2SetBoolean(c: Raw, vr: *const c_uint, n: usize, value: *const c_int) -> Status;
    pub fn fmi2SetString(c: Raw, vr: *const c_uint, n: usize, value: *const *const c_char) -> Status;
    pub fn fmi2GetFMUstate(c: Raw, state: *mut Raw) -> Status;
    pub fn fmi2SetFMUstate(c: Raw, state: Raw) -> Status;
    pub fn fmi2FreeFMUstate(c: Raw, state: *mut Raw) -> Status;
    pub fn fmi2SerializedFMUstateSize(c: Raw, state: Raw, size: *mut usize) -> Status;
    pub fn fmi2SerializeFMUstate(c: Raw, state: Raw, bytes: *mut u8, size: usize) -> Status;
    pub fn fmi2DeSerializeFMUstate(c: Raw, bytes: *const u8, size: usize, state: *mut Raw) -> Status;
    pub fn fmi2GetDirectionalDerivative(
        c: Raw,
        unknown: *const c_uint,
        unknowns: usize,
        known: *const c_uint,
        knowns: usize,
        direction: *const f64,
        answer: *mut f64,
    ) -> Status;
    pub fn fmi2SetRealInputDerivatives(
        c: Raw,
        vr: *const c_uint,
        n: usize,
        order: *const c_int,
        value: *const f64,
    ) -> Status;
    pub fn fmi2GetRealOutputDerivatives(
        c: Raw,
        vr: *const c_uint,
        n: usize,
        order: *const c_int,
        value: *mut f64,
    ) -> Status;
    pub fn fmi2DoStep(c: Raw, time: f64, step: f64, no_return: c_int) -> Status;
    pub fn fmi2CancelStep(c: Raw) -> Status;
    pub fn fmi2GetStatus(c: Raw, kind: c_int, value: *mut Status) -> Status;
    pub fn fmi2GetRealStatus(c: Raw, kind: c_int, value: *mut f64) -> Status;
    pub fn fmi2GetIntegerStatus(c: Raw, kind: c_int, value: *mut c_int) -> Status;
    pub fn fmi2GetBooleanStatus(c: Raw, kind: c_int, value: *mut c_int) -> Status;
    pub fn fmi2GetStringStatus(c: Raw, kind: c_int, value: *mut *const c_char) -> Status;
    pub fn fmi2EnterEventMode(c: Raw) -> Status;
    pub fn fmi2NewDiscreteStates(c: Raw, info: *mut c_void) -> Status;
    pub fn fmi2EnterContinuousTimeMode(c: Raw) -> Status;
    pub fn fmi2CompletedIntegratorStep(c: Raw, no_return: c_int, e: *mut c_int, t: *mut c_int) -> Status;
    pub fn fmi2SetTime(c: Raw, time: f64) -> Status;
    pub fn fmi2SetContinuousStates(c: Raw, x: *const f64, n: usize) -> Status;
    pub fn fmi2GetDerivatives(c: Raw, dx: *mut f64, n: usize) -> Status;
    pub fn fmi2GetEventIndicators(c: Raw, z: *mut f64, n: usize) -> Status;
    pub fn fmi2GetContinuousStates(c: Raw, x: *mut f64, n: usize) -> Status;
    pub fn fmi2GetNominalsOfContinuousStates(c: Raw, x: *mut f64, n: usize) -> Status;
}

/// A line that the logger has heard.
#[derive(Clone, Debug, PartialEq)]
pub struct Line {
    pub status: Status,
    pub category: String,
    pub text: String,
}

unsafe extern "C" fn hear(
    environment: *mut c_void,
    name: *const c_char,
    status: Status,
    category: *const c_char,
    message: *const c_char,
) {
    assert!(!name.is_null() && !category.is_null() && !message.is_null());
    // SAFETY: none is NULL, and the environment is the list that `callbacks` was given.
    unsafe {
        let text = |pointer| CStr::from_ptr(pointer).to_str().unwrap().to_owned();
        (*environment.cast::<Vec<Line>>()).push(Line { status, category: text(category), text: text(message) });
    }
}

/// Callbacks whose logger appends to `lines`.
pub fn callbacks(lines: *mut Vec<Line>) -> CallbackFunctions {
    let hear: unsafe extern "C" fn(_, _, _, _, _) = hear;
    // SAFETY: a variadic function cannot be written in stable Rust. The named arguments travel alike, and the shell
    // passes no others.
    let logger = unsafe { std::mem::transmute::<*const (), Logger>(hear as *const ()) };
    CallbackFunctions {
        logger: Some(logger),
        allocate_memory: None,
        free_memory: None,
        step_finished: None,
        component_environment: lines.cast(),
    }
}

/// An instance and its log.
pub struct Master {
    pub c: Raw,
    lines: *mut Vec<Line>,
}

impl Master {
    /// An instance with debug logging off.
    pub fn new(guid: &str) -> Self {
        let lines = Box::into_raw(Box::default());
        let guid = CString::new(guid).unwrap();
        let functions = callbacks(lines);
        // SAFETY: as the standard asks.
        let c = unsafe { fmi2Instantiate(c"one".as_ptr(), 1, guid.as_ptr(), null(), &functions, 0, 0) };
        Self { c, lines }
    }

    /// An instance that is ready to step.
    pub fn ready(guid: &str) -> Self {
        let master = Self::new(guid);
        // SAFETY: the instance is alive; so below.
        unsafe {
            assert_eq!(fmi2SetupExperiment(master.c, 0, 0.0, 0.0, 0, 0.0), Status::Ok);
            assert_eq!(fmi2EnterInitializationMode(master.c), Status::Ok);
            assert_eq!(fmi2ExitInitializationMode(master.c), Status::Ok);
        }
        master
    }

    /// What was logged since the last call.
    pub fn heard(&self) -> Vec<Line> {
        // SAFETY: the list lives as long as the master, and no call is under way.
        unsafe { std::mem::take(&mut *self.lines) }
    }

    /// Asserts that one line was logged which contains all of `parts`.
    #[track_caller]
    pub fn heard_one(&self, parts: &[&str]) {
        let heard = self.heard();
        let [line] = heard.as_slice() else {
            panic!("not one line: {heard:?}")
        };
        for part in parts {
            assert!(line.text.contains(part), "no {part:?} in {line:?}");
        }
    }

    pub fn real(&self, vr: u32) -> f64 {
        let mut value = f64::NAN;
        assert_eq!(unsafe { fmi2GetReal(self.c, &vr, 1, &mut value) }, Status::Ok);
        value
    }

    pub fn set_real(&self, vr: u32, value: f64) -> Status {
        unsafe { fmi2SetReal(self.c, &vr, 1, &value) }
    }

    pub fn step(&self, time: f64, step: f64) -> Status {
        unsafe { fmi2DoStep(self.c, time, step, 1) }
    }

    /// The whole state as bytes, for comparison.
    pub fn bytes(&self) -> Vec<u8> {
        let (mut state, mut size) = (null_mut(), 0);
        unsafe {
            assert_eq!(fmi2GetFMUstate(self.c, &mut state), Status::Ok);
            assert_eq!(fmi2SerializedFMUstateSize(self.c, state, &mut size), Status::Ok);
            let mut bytes = vec![0; size];
            assert_eq!(
                fmi2SerializeFMUstate(self.c, state, bytes.as_mut_ptr(), size),
                Status::Ok
            );
            assert_eq!(fmi2FreeFMUstate(self.c, &mut state), Status::Ok);
            assert!(state.is_null());
            bytes
        }
    }
}

impl Drop for Master {
    fn drop(&mut self) {
        // SAFETY: the list came out of a box, and after the instance nobody writes to it.
        unsafe {
            fmi2FreeInstance(self.c);
            drop(Box::from_raw(self.lines));
        }
    }
}
