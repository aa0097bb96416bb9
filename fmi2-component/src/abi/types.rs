//! The C types of `fmi2TypesPlatform.h` and `fmi2FunctionTypes.h`, platform "default".

use std::ffi::{CStr, c_char, c_int, c_uint, c_void};

use crate::log::Logger;

/// `fmi2Component`.
pub type CComponent = *mut c_void;
/// `fmi2FMUstate`: a number, see `session.rs`.
pub type CFmuState = *mut c_void;
/// `fmi2ValueReference`.
pub type CValueReference = c_uint;
/// `fmi2Boolean`: 0 is false.
pub type CBoolean = c_int;
/// `fmi2String`.
pub type CString = *const c_char;

/// `fmi2CallbackFunctions`. The shell uses the logger alone: Rust allocates for itself, and no step is asynchronous.
#[repr(C)]
#[derive(Debug)]
pub struct CallbackFunctions {
    /// Takes log lines; may be NULL.
    pub logger: Option<Logger>,
    /// Not used.
    pub allocate_memory: Option<unsafe extern "C" fn(usize, usize) -> *mut c_void>,
    /// Not used.
    pub free_memory: Option<unsafe extern "C" fn(*mut c_void)>,
    /// Not used.
    pub step_finished: Option<unsafe extern "C" fn(*mut c_void, c_int)>,
    /// Handed back to the logger.
    pub component_environment: *mut c_void,
}

/// `fmi2EventInfo`: what an event has led to.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[allow(missing_docs)] // the names are those of the standard
pub struct EventInfo {
    pub new_discrete_states_needed: CBoolean,
    pub terminate_simulation: CBoolean,
    pub nominals_of_continuous_states_changed: CBoolean,
    pub values_of_continuous_states_changed: CBoolean,
    pub next_event_time_defined: CBoolean,
    pub next_event_time: f64,
}

/// What `fmi2GetTypesPlatform` answers.
pub const TYPES_PLATFORM: &CStr = c"default";
/// What `fmi2GetVersion` answers.
pub const VERSION: &CStr = c"2.0";
