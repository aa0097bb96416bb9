//! The functions of FMI 2.0 as pointers into a library, by the list that the shell exports.
#![allow(non_snake_case, missing_docs)] // the names are those of the standard

use std::ffi::{c_char, c_int};

use fmi2_component::abi::{
    CBoolean, CComponent, CFmuState, CString, CValueReference, CallbackFunctions, EventInfo, Status,
};
use libloading::Library;

/// Declares a structure with a pointer for each function, and a macro that makes it of the functions that are linked into this program.
macro_rules! declare {
    ($dollar:tt { $($common:tt)* } { $($exchange:tt)* }) => {
        declare! { @instance $dollar $($common)* $($exchange)* }
    };
    (@instance $dollar:tt $($name:ident = $function:ident($($argument:ident: $type:ty),*);)*) => {
        declare! { @all $dollar
            fmi2GetTypesPlatform() -> CString;
            fmi2GetVersion() -> CString;
            fmi2Instantiate(CString, c_int, CString, CString, *const CallbackFunctions, CBoolean, CBoolean) -> CComponent;
            fmi2FreeInstance(CComponent) -> ();
            $($name(CComponent $(, $type)*) -> Status;)*
        }
    };
    (@all $dollar:tt $($name:ident($($type:ty),*) -> $answer:ty;)*) => {
        /// Every function that the standard names.
        #[derive(Clone, Copy, Debug)]
        pub struct Functions {
            $(pub $name: unsafe extern "C" fn($($type),*) -> $answer,)*
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

        /// The functions in the module that `fmi2_component::export!` makes.
        #[macro_export]
        macro_rules! functions_of {
            ($dollar module:ident) => {
                $dollar crate::Functions { $($name: $dollar module::$name,)* }
            };
        }
    };
}

fmi2_component::c_functions! { [declare] $ }
