//! The functions of FMI 2.0 as pointers into a library.
#![allow(non_snake_case, missing_docs)] // the names are those of the standard

use std::ffi::{c_char, c_int, c_uint, c_void};
use std::ptr::{null, null_mut};

use fmi2_component::Status;
use fmi2_component::abi::{CallbackFunctions, EventInfo};
use libloading::Library;

/// `fmi2Component`, and `fmi2FMUstate`.
pub type Raw = *mut c_void;

/// `fmi2Status` as a library answers it: any number.
#[repr(transparent)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Answer(c_int);

impl Answer {
    /// Whether the call was done, possibly with a warning.
    #[must_use]
    pub fn is_done(self) -> bool {
        matches!(self.into(), Status::Ok | Status::Warning)
    }
}

impl From<Answer> for Status {
    /// A number that the standard does not have is fatal.
    fn from(answer: Answer) -> Self {
        match answer.0 {
            0 => Self::Ok,
            1 => Self::Warning,
            2 => Self::Discard,
            3 => Self::Error,
            5 => Self::Pending,
            _ => Self::Fatal,
        }
    }
}

impl PartialEq<Status> for Answer {
    fn eq(&self, other: &Status) -> bool {
        Status::from(*self) == *other
    }
}

/// The answer of a function that the library lacks: an error.
trait Absent {
    const ABSENT: Self;
}

impl Absent for Answer {
    const ABSENT: Self = Self(Status::Error as c_int);
}

impl Absent for Raw {
    const ABSENT: Self = null_mut();
}

impl Absent for *const c_char {
    const ABSENT: Self = null();
}

impl Absent for () {
    const ABSENT: Self = ();
}

/// Declares a structure with a pointer for each function.
macro_rules! functions {
    ($($name:ident($($argument:ty),*) -> $answer:ty;)*) => {
        /// Every function that the standard names.
        #[derive(Clone, Copy, Debug)]
        pub struct Functions {
            $(pub $name: unsafe extern "C" fn($($argument),*) -> $answer,)*
        }

        impl Functions {
            /// Their names.
            pub const NAMES: &[&str] = &[$(stringify!($name)),*];

            /// Looks all of them up. One that is missing answers with an error when it is called.
            ///
            /// # Safety
            /// The library must be one of FMI 2.0, and must stay loaded as long as the pointers are used.
            #[must_use]
            pub unsafe fn of(library: &Library) -> Self {
                Self {
                    $($name: {
                        extern "C" fn absent($(_: $argument),*) -> $answer {
                            <$answer as Absent>::ABSENT
                        }
                        // SAFETY: the standard gives the function this type.
                        let found = unsafe { library.get(stringify!($name).as_bytes()) };
                        found.map_or(absent as _, |found| *found)
                    },)*
                }
            }
        }
    };
}

/// Calls a macro with the functions of the standard and their types: a test of a component that is linked declares them.
#[doc(hidden)]
#[macro_export]
macro_rules! fmi2_functions {
    ($with:ident) => {
        $with! {
            fmi2GetTypesPlatform() -> *const c_char;
            fmi2GetVersion() -> *const c_char;
            fmi2Instantiate(*const c_char, c_int, *const c_char, *const c_char, *const CallbackFunctions, c_int, c_int) -> Raw;
            fmi2FreeInstance(Raw) -> ();
            fmi2SetDebugLogging(Raw, c_int, usize, *const *const c_char) -> Answer;
            fmi2SetupExperiment(Raw, c_int, f64, f64, c_int, f64) -> Answer;
            fmi2EnterInitializationMode(Raw) -> Answer;
            fmi2ExitInitializationMode(Raw) -> Answer;
            fmi2Terminate(Raw) -> Answer;
            fmi2Reset(Raw) -> Answer;
            fmi2GetReal(Raw, *const c_uint, usize, *mut f64) -> Answer;
            fmi2GetInteger(Raw, *const c_uint, usize, *mut c_int) -> Answer;
            fmi2GetBoolean(Raw, *const c_uint, usize, *mut c_int) -> Answer;
            fmi2GetString(Raw, *const c_uint, usize, *mut *const c_char) -> Answer;
            fmi2SetReal(Raw, *const c_uint, usize, *const f64) -> Answer;
            fmi2SetInteger(Raw, *const c_uint, usize, *const c_int) -> Answer;
            fmi2SetBoolean(Raw, *const c_uint, usize, *const c_int) -> Answer;
            fmi2SetString(Raw, *const c_uint, usize, *const *const c_char) -> Answer;
            fmi2GetFMUstate(Raw, *mut Raw) -> Answer;
            fmi2SetFMUstate(Raw, Raw) -> Answer;
            fmi2FreeFMUstate(Raw, *mut Raw) -> Answer;
            fmi2SerializedFMUstateSize(Raw, Raw, *mut usize) -> Answer;
            fmi2SerializeFMUstate(Raw, Raw, *mut u8, usize) -> Answer;
            fmi2DeSerializeFMUstate(Raw, *const u8, usize, *mut Raw) -> Answer;
            fmi2GetDirectionalDerivative(Raw, *const c_uint, usize, *const c_uint, usize, *const f64, *mut f64) -> Answer;
            fmi2SetRealInputDerivatives(Raw, *const c_uint, usize, *const c_int, *const f64) -> Answer;
            fmi2GetRealOutputDerivatives(Raw, *const c_uint, usize, *const c_int, *mut f64) -> Answer;
            fmi2DoStep(Raw, f64, f64, c_int) -> Answer;
            fmi2CancelStep(Raw) -> Answer;
            fmi2GetStatus(Raw, c_int, *mut c_int) -> Answer;
            fmi2GetRealStatus(Raw, c_int, *mut f64) -> Answer;
            fmi2GetIntegerStatus(Raw, c_int, *mut c_int) -> Answer;
            fmi2GetBooleanStatus(Raw, c_int, *mut c_int) -> Answer;
            fmi2GetStringStatus(Raw, c_int, *mut *const c_char) -> Answer;
            fmi2EnterEventMode(Raw) -> Answer;
            fmi2NewDiscreteStates(Raw, *mut EventInfo) -> Answer;
            fmi2EnterContinuousTimeMode(Raw) -> Answer;
            fmi2CompletedIntegratorStep(Raw, c_int, *mut c_int, *mut c_int) -> Answer;
            fmi2SetTime(Raw, f64) -> Answer;
            fmi2SetContinuousStates(Raw, *const f64, usize) -> Answer;
            fmi2GetDerivatives(Raw, *mut f64, usize) -> Answer;
            fmi2GetEventIndicators(Raw, *mut f64, usize) -> Answer;
            fmi2GetContinuousStates(Raw, *mut f64, usize) -> Answer;
            fmi2GetNominalsOfContinuousStates(Raw, *mut f64, usize) -> Answer;
        }
    };
}

fmi2_functions!(functions);
