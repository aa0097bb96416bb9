//! The functions of FMI 2.0 as pointers into a library.
#![allow(non_snake_case, missing_docs)] // the names are those of the standard

use std::ffi::{c_char, c_int, c_uint, c_void};

use fmi2_component::Status;
use fmi2_component::abi::{CallbackFunctions, EventInfo};
use libloading::Library;

/// `fmi2Component`, and `fmi2FMUstate`.
pub type Raw = *mut c_void;

/// Declares a structure with a pointer for each function.
macro_rules! functions {
    ($dollar:tt $($name:ident($($argument:ty),*) $(-> $answer:ty)?;)*) => {
        /// Every function that the standard names.
        #[derive(Clone, Copy, Debug)]
        pub struct Functions {
            $(pub $name: unsafe extern "C" fn($($argument),*) $(-> $answer)?,)*
        }

        impl Functions {
            /// Their names.
            pub const NAMES: &[&str] = &[$(stringify!($name)),*];

            /// Looks all of them up.
            ///
            /// # Safety
            /// The library must be one of FMI 2.0, and must stay loaded as long as the pointers are used.
            pub(crate) unsafe fn load(library: &Library) -> Result<Self, libloading::Error> {
                // SAFETY: passed on.
                Ok(unsafe { Self { $($name: *library.get(stringify!($name).as_bytes())?,)* } })
            }
        }

        /// The functions of a component that is linked into this program: those in the module that `fmi2_component::export!` makes.
        #[macro_export]
        macro_rules! functions_of {
            ($dollar module:ident) => {
                $dollar crate::Functions { $($name: $dollar module::$name,)* }
            };
        }
    };
}

functions! { $
    fmi2GetTypesPlatform() -> *const c_char;
    fmi2GetVersion() -> *const c_char;
    fmi2Instantiate(*const c_char, c_int, *const c_char, *const c_char, *const CallbackFunctions, c_int, c_int) -> Raw;
    fmi2FreeInstance(Raw);
    fmi2SetDebugLogging(Raw, c_int, usize, *const *const c_char) -> Status;
    fmi2SetupExperiment(Raw, c_int, f64, f64, c_int, f64) -> Status;
    fmi2EnterInitializationMode(Raw) -> Status;
    fmi2ExitInitializationMode(Raw) -> Status;
    fmi2Terminate(Raw) -> Status;
    fmi2Reset(Raw) -> Status;
    fmi2GetReal(Raw, *const c_uint, usize, *mut f64) -> Status;
    fmi2GetInteger(Raw, *const c_uint, usize, *mut c_int) -> Status;
    fmi2GetBoolean(Raw, *const c_uint, usize, *mut c_int) -> Status;
    fmi2GetString(Raw, *const c_uint, usize, *mut *const c_char) -> Status;
    fmi2SetReal(Raw, *const c_uint, usize, *const f64) -> Status;
    fmi2SetInteger(Raw, *const c_uint, usize, *const c_int) -> Status;
    fmi2SetBoolean(Raw, *const c_uint, usize, *const c_int) -> Status;
    fmi2SetString(Raw, *const c_uint, usize, *const *const c_char) -> Status;
    fmi2GetFMUstate(Raw, *mut Raw) -> Status;
    fmi2SetFMUstate(Raw, Raw) -> Status;
    fmi2FreeFMUstate(Raw, *mut Raw) -> Status;
    fmi2SerializedFMUstateSize(Raw, Raw, *mut usize) -> Status;
    fmi2SerializeFMUstate(Raw, Raw, *mut c_char, usize) -> Status;
    fmi2DeSerializeFMUstate(Raw, *const c_char, usize, *mut Raw) -> Status;
    fmi2GetDirectionalDerivative(Raw, *const c_uint, usize, *const c_uint, usize, *const f64, *mut f64) -> Status;
    fmi2SetRealInputDerivatives(Raw, *const c_uint, usize, *const c_int, *const f64) -> Status;
    fmi2GetRealOutputDerivatives(Raw, *const c_uint, usize, *const c_int, *mut f64) -> Status;
    fmi2DoStep(Raw, f64, f64, c_int) -> Status;
    fmi2CancelStep(Raw) -> Status;
    fmi2GetStatus(Raw, c_int, *mut Status) -> Status;
    fmi2GetRealStatus(Raw, c_int, *mut f64) -> Status;
    fmi2GetIntegerStatus(Raw, c_int, *mut c_int) -> Status;
    fmi2GetBooleanStatus(Raw, c_int, *mut c_int) -> Status;
    fmi2GetStringStatus(Raw, c_int, *mut *const c_char) -> Status;
    fmi2EnterEventMode(Raw) -> Status;
    fmi2NewDiscreteStates(Raw, *mut EventInfo) -> Status;
    fmi2EnterContinuousTimeMode(Raw) -> Status;
    fmi2CompletedIntegratorStep(Raw, c_int, *mut c_int, *mut c_int) -> Status;
    fmi2SetTime(Raw, f64) -> Status;
    fmi2SetContinuousStates(Raw, *const f64, usize) -> Status;
    fmi2GetDerivatives(Raw, *mut f64, usize) -> Status;
    fmi2GetEventIndicators(Raw, *mut f64, usize) -> Status;
    fmi2GetContinuousStates(Raw, *mut f64, usize) -> Status;
    fmi2GetNominalsOfContinuousStates(Raw, *mut f64, usize) -> Status;
}
