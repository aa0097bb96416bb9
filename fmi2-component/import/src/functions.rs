//! The functions of FMI 2.0 that co-simulation needs.
#![allow(non_snake_case)] // the names are those of the standard

use std::ffi::{c_char, c_int, c_uint, c_void};

use libloading::Library;

/// `fmi2Component`.
pub(crate) type Component = *mut c_void;

/// `fmi2CallbackLogger`.
pub(crate) type Logger = unsafe extern "C" fn(*mut c_void, *const c_char, c_int, *const c_char, *const c_char, ...);

/// `fmi2CallbackFunctions`.
#[repr(C)]
pub(crate) struct Callbacks {
    pub logger: Logger,
    pub allocate_memory: unsafe extern "C" fn(usize, usize) -> *mut c_void,
    pub free_memory: unsafe extern "C" fn(*mut c_void),
    pub step_finished: Option<unsafe extern "C" fn(*mut c_void, c_int)>,
    pub component_environment: *const c_void,
}

/// Declares a structure with one pointer per function.
macro_rules! functions {
    ($($name:ident($($argument:ty),*) $(-> $answer:ty)?;)*) => {
        pub(crate) struct Functions {
            $(pub $name: unsafe extern "C" fn($($argument),*) $(-> $answer)?,)*
        }

        impl Functions {
            /// Finds all functions.
            ///
            /// # Safety
            /// The library must be one of FMI 2.0, and must stay loaded as long as the pointers are used.
            pub(crate) unsafe fn load(library: &Library) -> Result<Self, libloading::Error> {
                // SAFETY: the caller's contract.
                Ok(unsafe { Self { $($name: *library.get(stringify!($name).as_bytes())?,)* } })
            }
        }
    };
}

functions! {
    fmi2Instantiate(*const c_char, c_int, *const c_char, *const c_char, *const Callbacks, c_int, c_int) -> Component;
    fmi2FreeInstance(Component);
    fmi2SetupExperiment(Component, c_int, f64, f64, c_int, f64) -> c_int;
    fmi2EnterInitializationMode(Component) -> c_int;
    fmi2ExitInitializationMode(Component) -> c_int;
    fmi2GetReal(Component, *const c_uint, usize, *mut f64) -> c_int;
    fmi2GetInteger(Component, *const c_uint, usize, *mut c_int) -> c_int;
    fmi2GetBoolean(Component, *const c_uint, usize, *mut c_int) -> c_int;
    fmi2SetReal(Component, *const c_uint, usize, *const f64) -> c_int;
    fmi2SetInteger(Component, *const c_uint, usize, *const c_int) -> c_int;
    fmi2SetBoolean(Component, *const c_uint, usize, *const c_int) -> c_int;
    fmi2DoStep(Component, f64, f64, c_int) -> c_int;
}
