//! Types and functions of the header files of FMI 2.0, under their names.

#![allow(non_camel_case_types, non_snake_case, non_upper_case_globals, clippy::missing_safety_doc, clippy::too_many_arguments)]

/// What an FMU logs, as a record of the crate `log`.
pub mod logger {
    use std::ffi::{CStr, c_int};

    use log::{Level, Record};

    use super::{fmi2ComponentEnvironment, fmi2Status, fmi2String};

    unsafe extern "C" {
        /// In logger.c.
        pub fn callback_logger_handler(
            environment: fmi2ComponentEnvironment,
            instance: fmi2String,
            status: fmi2Status,
            category: fmi2String,
            message: fmi2String,
            ...
        );
    }

    /// Called by logger.c with the complete message.
    #[unsafe(no_mangle)]
    extern "C" fn vines_fmi2_log(instance: fmi2String, status: c_int, message: fmi2String) {
        let level = match status {
            0 => Level::Info,
            1 => Level::Warn,
            2 => Level::Trace,
            _ => Level::Error,
        };
        // Safety: the standard has them end with NUL, and they live until this function returns.
        let text = |from: fmi2String| (!from.is_null()).then(|| unsafe { CStr::from_ptr(from) }.to_string_lossy());
        let [instance, message] = [instance, message].map(|from| text(from).unwrap_or("NULL".into()));
        log::logger().log(
            &Record::builder()
                .args(format_args!("{message}"))
                .level(level)
                .module_path(Some("logger"))
                .target(&instance)
                .build(),
        );
    }
}

use std::ffi::{OsStr, c_char, c_int, c_uint, c_void};

use libloading::{Error, Library};

pub type fmi2Component = *mut c_void;
pub type fmi2ComponentEnvironment = *mut c_void;
pub type fmi2FMUstate = *mut c_void;
pub type fmi2ValueReference = c_uint;
pub type fmi2Real = f64;
pub type fmi2Integer = c_int;
pub type fmi2Boolean = c_int;
pub type fmi2String = *const c_char;
pub type fmi2Byte = c_char;

pub type fmi2Status = c_uint;
pub const fmi2Status_fmi2OK: fmi2Status = 0;
pub const fmi2Status_fmi2Warning: fmi2Status = 1;
pub const fmi2Status_fmi2Discard: fmi2Status = 2;
pub const fmi2Status_fmi2Error: fmi2Status = 3;
pub const fmi2Status_fmi2Fatal: fmi2Status = 4;

pub type fmi2Type = c_uint;
pub const fmi2Type_fmi2ModelExchange: fmi2Type = 0;
pub const fmi2Type_fmi2CoSimulation: fmi2Type = 1;

pub type fmi2StatusKind = c_uint;
pub const fmi2StatusKind_fmi2DoStepStatus: fmi2StatusKind = 0;
pub const fmi2StatusKind_fmi2PendingStatus: fmi2StatusKind = 1;
pub const fmi2StatusKind_fmi2LastSuccessfulTime: fmi2StatusKind = 2;
pub const fmi2StatusKind_fmi2Terminated: fmi2StatusKind = 3;

pub type fmi2CallbackLogger = Option<
    unsafe extern "C" fn(fmi2ComponentEnvironment, fmi2String, fmi2Status, fmi2String, fmi2String, ...),
>;
pub type fmi2CallbackAllocateMemory = Option<unsafe extern "C" fn(count: usize, size: usize) -> *mut c_void>;
pub type fmi2CallbackFreeMemory = Option<unsafe extern "C" fn(*mut c_void)>;
pub type fmi2StepFinished = Option<unsafe extern "C" fn(fmi2ComponentEnvironment, fmi2Status)>;

#[repr(C)]
#[derive(Debug, Copy, Clone)]
pub struct fmi2CallbackFunctions {
    pub logger: fmi2CallbackLogger,
    pub allocateMemory: fmi2CallbackAllocateMemory,
    pub freeMemory: fmi2CallbackFreeMemory,
    pub stepFinished: fmi2StepFinished,
    pub componentEnvironment: fmi2ComponentEnvironment,
}

#[repr(C)]
#[derive(Debug, Copy, Clone, Default)]
pub struct fmi2EventInfo {
    pub newDiscreteStatesNeeded: fmi2Boolean,
    pub terminateSimulation: fmi2Boolean,
    pub nominalsOfContinuousStatesChanged: fmi2Boolean,
    pub valuesOfContinuousStatesChanged: fmi2Boolean,
    pub nextEventTimeDefined: fmi2Boolean,
    pub nextEventTime: fmi2Real,
}

/// Declares the functions of a library. One that it lacks is an error only when it is called.
macro_rules! functions {
    ($(fn $name:ident($($argument:ident: $type:ty),* $(,)?) -> $result:ty;)*) => {
        pub struct Fmi2Binding {
            $($name: Result<unsafe extern "C" fn($($type),*) -> $result, Error>,)*
            /// Unloaded last.
            _library: Library,
        }

        impl Fmi2Binding {
            /// # Safety
            /// The library must be one of an FMU of FMI 2.0, whose functions have these types.
            pub unsafe fn new(path: impl AsRef<OsStr>) -> Result<Self, Error> {
                // Safety: as promised by the caller.
                let library = unsafe { Library::new(path) }?;
                Ok(Self {
                    // Safety: as promised by the caller; the library lives as long as its functions.
                    $($name: unsafe { library.get(concat!(stringify!($name), "\0").as_bytes()) }.map(|found| *found),)*
                    _library: library,
                })
            }

            $(
                /// # Safety
                /// The standard says when it may be called, and with what.
                pub unsafe fn $name(&self, $($argument: $type),*) -> $result {
                    let function = self.$name.as_ref().unwrap_or_else(|error| panic!("the FMU lacks a function: {error}"));
                    // Safety: as promised by the caller.
                    unsafe { function($($argument),*) }
                }
            )*
        }
    };
}

functions! {
    fn fmi2GetTypesPlatform() -> *const c_char;
    fn fmi2GetVersion() -> *const c_char;
    fn fmi2SetDebugLogging(
        c: fmi2Component, loggingOn: fmi2Boolean, nCategories: usize, categories: *const fmi2String,
    ) -> fmi2Status;
    fn fmi2Instantiate(
        instanceName: fmi2String, fmuType: fmi2Type, fmuGUID: fmi2String, fmuResourceLocation: fmi2String,
        functions: *const fmi2CallbackFunctions, visible: fmi2Boolean, loggingOn: fmi2Boolean,
    ) -> fmi2Component;
    fn fmi2FreeInstance(c: fmi2Component) -> ();
    fn fmi2SetupExperiment(
        c: fmi2Component, toleranceDefined: fmi2Boolean, tolerance: fmi2Real, startTime: fmi2Real,
        stopTimeDefined: fmi2Boolean, stopTime: fmi2Real,
    ) -> fmi2Status;
    fn fmi2EnterInitializationMode(c: fmi2Component) -> fmi2Status;
    fn fmi2ExitInitializationMode(c: fmi2Component) -> fmi2Status;
    fn fmi2Terminate(c: fmi2Component) -> fmi2Status;
    fn fmi2Reset(c: fmi2Component) -> fmi2Status;
    fn fmi2GetReal(c: fmi2Component, r: *const fmi2ValueReference, n: usize, v: *mut fmi2Real) -> fmi2Status;
    fn fmi2GetInteger(c: fmi2Component, r: *const fmi2ValueReference, n: usize, v: *mut fmi2Integer) -> fmi2Status;
    fn fmi2GetBoolean(c: fmi2Component, r: *const fmi2ValueReference, n: usize, v: *mut fmi2Boolean) -> fmi2Status;
    fn fmi2GetString(c: fmi2Component, r: *const fmi2ValueReference, n: usize, v: *mut fmi2String) -> fmi2Status;
    fn fmi2SetReal(c: fmi2Component, r: *const fmi2ValueReference, n: usize, v: *const fmi2Real) -> fmi2Status;
    fn fmi2SetInteger(c: fmi2Component, r: *const fmi2ValueReference, n: usize, v: *const fmi2Integer) -> fmi2Status;
    fn fmi2SetBoolean(c: fmi2Component, r: *const fmi2ValueReference, n: usize, v: *const fmi2Boolean) -> fmi2Status;
    fn fmi2SetString(c: fmi2Component, r: *const fmi2ValueReference, n: usize, v: *const fmi2String) -> fmi2Status;
    fn fmi2GetFMUstate(c: fmi2Component, FMUstate: *mut fmi2FMUstate) -> fmi2Status;
    fn fmi2SetFMUstate(c: fmi2Component, FMUstate: fmi2FMUstate) -> fmi2Status;
    fn fmi2FreeFMUstate(c: fmi2Component, FMUstate: *mut fmi2FMUstate) -> fmi2Status;
    fn fmi2SerializedFMUstateSize(c: fmi2Component, FMUstate: fmi2FMUstate, size: *mut usize) -> fmi2Status;
    fn fmi2SerializeFMUstate(c: fmi2Component, state: fmi2FMUstate, bytes: *mut fmi2Byte, size: usize) -> fmi2Status;
    fn fmi2DeSerializeFMUstate(
        c: fmi2Component, serializedState: *const fmi2Byte, size: usize, FMUstate: *mut fmi2FMUstate,
    ) -> fmi2Status;
    fn fmi2GetDirectionalDerivative(
        c: fmi2Component, vUnknown_ref: *const fmi2ValueReference, nUnknown: usize,
        vKnown_ref: *const fmi2ValueReference, nKnown: usize, dvKnown: *const fmi2Real, dvUnknown: *mut fmi2Real,
    ) -> fmi2Status;
    fn fmi2EnterEventMode(c: fmi2Component) -> fmi2Status;
    fn fmi2NewDiscreteStates(c: fmi2Component, fmi2eventInfo: *mut fmi2EventInfo) -> fmi2Status;
    fn fmi2EnterContinuousTimeMode(c: fmi2Component) -> fmi2Status;
    fn fmi2CompletedIntegratorStep(
        c: fmi2Component, noSetFMUStatePriorToCurrentPoint: fmi2Boolean, enterEventMode: *mut fmi2Boolean,
        terminateSimulation: *mut fmi2Boolean,
    ) -> fmi2Status;
    fn fmi2SetTime(c: fmi2Component, time: fmi2Real) -> fmi2Status;
    fn fmi2SetContinuousStates(c: fmi2Component, x: *const fmi2Real, nx: usize) -> fmi2Status;
    fn fmi2GetDerivatives(c: fmi2Component, derivatives: *mut fmi2Real, nx: usize) -> fmi2Status;
    fn fmi2GetEventIndicators(c: fmi2Component, eventIndicators: *mut fmi2Real, ni: usize) -> fmi2Status;
    fn fmi2GetContinuousStates(c: fmi2Component, x: *mut fmi2Real, nx: usize) -> fmi2Status;
    fn fmi2GetNominalsOfContinuousStates(c: fmi2Component, x_nominal: *mut fmi2Real, nx: usize) -> fmi2Status;
    fn fmi2DoStep(c: fmi2Component, time: fmi2Real, step: fmi2Real, is_final: fmi2Boolean) -> fmi2Status;
    fn fmi2CancelStep(c: fmi2Component) -> fmi2Status;
    fn fmi2GetStatus(c: fmi2Component, s: fmi2StatusKind, v: *mut fmi2Status) -> fmi2Status;
    fn fmi2GetRealStatus(c: fmi2Component, s: fmi2StatusKind, v: *mut fmi2Real) -> fmi2Status;
    fn fmi2GetBooleanStatus(c: fmi2Component, s: fmi2StatusKind, v: *mut fmi2Boolean) -> fmi2Status;
    fn fmi2GetStringStatus(c: fmi2Component, s: fmi2StatusKind, v: *mut fmi2String) -> fmi2Status;
}
