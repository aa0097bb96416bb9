//! The macro that gives the functions of [`abi`](crate::abi) their C names.

/// Exports a [`Component`](crate::Component) under the C names of FMI 2.0, those of model exchange included.
///
/// `export!(MyComponent)` is for co-simulation alone: functions of model exchange, which some masters look up in every
/// library, answer an error with a reason. `export!(MyComponent, model_exchange)` is for a component that is
/// [`ModelExchange`](crate::ModelExchange) too.
///
/// Once per library, and in a crate of type `cdylib`: two components whose names meet in one program cannot be linked.
/// The unsafe attributes and signatures are written by this macro, so that the crate it is used in may
/// `#![forbid(unsafe_code)]`.
///
/// ```ignore
/// fmi2_component::export!(MyComponent);
/// ```
#[macro_export]
macro_rules! export {
    ($component:ty) => {
        $crate::c_functions! { [$crate::export_library] $component, ::core::option::Option::None, export_refusals }
    };
    ($component:ty, model_exchange) => {
        $crate::c_functions! { [$crate::export_library]
            $component, ::core::option::Option::Some(<$component as $crate::ModelExchange>::select), export_functions
        }
    };
}

/// The functions of an instance, handed to the macro in brackets after its own arguments: `C name = Rust name(arguments)`, those of
/// model exchange in a group of their own. `fmi2-boundary` declares its function pointers by the same list.
#[doc(hidden)]
#[macro_export]
macro_rules! c_functions {
    ([$($then:tt)*] $($arguments:tt)*) => {
        $($then)*! { $($arguments)* {
            fmi2SetDebugLogging = set_debug_logging(on: CBoolean, count: usize, categories: *const CString);
            fmi2SetupExperiment = setup_experiment(tolerance_defined: CBoolean, tolerance: f64, start_time: f64, stop_time_defined: CBoolean, stop_time: f64);
            fmi2EnterInitializationMode = enter_initialization_mode();
            fmi2ExitInitializationMode = exit_initialization_mode();
            fmi2Terminate = terminate();
            fmi2Reset = reset();
            fmi2GetReal = get_real(vr: *const CValueReference, count: usize, value: *mut f64);
            fmi2GetInteger = get_integer(vr: *const CValueReference, count: usize, value: *mut c_int);
            fmi2GetBoolean = get_boolean(vr: *const CValueReference, count: usize, value: *mut CBoolean);
            fmi2GetString = get_string(vr: *const CValueReference, count: usize, value: *mut CString);
            fmi2SetReal = set_real(vr: *const CValueReference, count: usize, value: *const f64);
            fmi2SetInteger = set_integer(vr: *const CValueReference, count: usize, value: *const c_int);
            fmi2SetBoolean = set_boolean(vr: *const CValueReference, count: usize, value: *const CBoolean);
            fmi2SetString = set_string(vr: *const CValueReference, count: usize, value: *const CString);
            fmi2GetFMUstate = get_fmu_state(state: *mut CFmuState);
            fmi2SetFMUstate = set_fmu_state(state: CFmuState);
            fmi2FreeFMUstate = free_fmu_state(state: *mut CFmuState);
            fmi2SerializedFMUstateSize = serialized_fmu_state_size(state: CFmuState, size: *mut usize);
            fmi2SerializeFMUstate = serialize_fmu_state(state: CFmuState, bytes: *mut c_char, size: usize);
            fmi2DeSerializeFMUstate = deserialize_fmu_state(bytes: *const c_char, size: usize, state: *mut CFmuState);
            fmi2GetDirectionalDerivative = get_directional_derivative(unknown: *const CValueReference, unknowns: usize, known: *const CValueReference, knowns: usize, direction: *const f64, answer: *mut f64);
            fmi2SetRealInputDerivatives = set_real_input_derivatives(vr: *const CValueReference, count: usize, order: *const c_int, value: *const f64);
            fmi2GetRealOutputDerivatives = get_real_output_derivatives(vr: *const CValueReference, count: usize, order: *const c_int, value: *mut f64);
            fmi2DoStep = do_step(time: f64, step: f64, no_set_prior: CBoolean);
            fmi2CancelStep = cancel_step();
            fmi2GetStatus = get_status(kind: c_int, value: *mut Status);
            fmi2GetRealStatus = get_real_status(kind: c_int, value: *mut f64);
            fmi2GetIntegerStatus = get_integer_status(kind: c_int, value: *mut c_int);
            fmi2GetBooleanStatus = get_boolean_status(kind: c_int, value: *mut CBoolean);
            fmi2GetStringStatus = get_string_status(kind: c_int, value: *mut CString);
        } {
            fmi2EnterEventMode = enter_event_mode();
            fmi2NewDiscreteStates = new_discrete_states(info: *mut EventInfo);
            fmi2EnterContinuousTimeMode = enter_continuous_time_mode();
            fmi2CompletedIntegratorStep = completed_integrator_step(no_set_prior: CBoolean, event: *mut CBoolean, terminate: *mut CBoolean);
            fmi2SetTime = set_time(time: f64);
            fmi2SetContinuousStates = set_continuous_states(states: *const f64, count: usize);
            fmi2GetDerivatives = get_derivatives(derivatives: *mut f64, count: usize);
            fmi2GetEventIndicators = get_event_indicators(indicators: *mut f64, count: usize);
            fmi2GetContinuousStates = get_continuous_states(states: *mut f64, count: usize);
            fmi2GetNominalsOfContinuousStates = get_nominals_of_continuous_states(nominals: *mut f64, count: usize);
        } }
    };
}

/// The library of a component; `$exchange` makes the functions of model exchange.
#[doc(hidden)]
#[macro_export]
macro_rules! export_library {
    ($component:ty, $select:expr, $exchange:ident { $($common:tt)* } { $($model_exchange:tt)* }) => {
        #[allow(non_snake_case, clippy::missing_safety_doc, clippy::too_many_arguments, missing_docs)]
        mod fmi2_functions {
            use super::*;
            use $crate::abi::{
                CBoolean, CComponent, CFmuState, CString, CValueReference, CallbackFunctions, EventInfo, Status,
            };
            use ::std::ffi::{c_char, c_int};

            #[unsafe(no_mangle)]
            pub extern "C" fn fmi2GetTypesPlatform() -> *const c_char {
                $crate::abi::TYPES_PLATFORM.as_ptr()
            }

            #[unsafe(no_mangle)]
            pub extern "C" fn fmi2GetVersion() -> *const c_char {
                $crate::abi::VERSION.as_ptr()
            }

            #[unsafe(no_mangle)]
            pub unsafe extern "C" fn fmi2Instantiate(
                instance_name: CString,
                fmu_type: c_int,
                guid: CString,
                resource_location: CString,
                functions: *const CallbackFunctions,
                _visible: CBoolean,
                logging_on: CBoolean,
            ) -> CComponent {
                // SAFETY: the master keeps the contract of the standard; so below.
                unsafe {
                    $crate::abi::instantiate::<$component>(
                        instance_name, fmu_type, guid, resource_location, functions, logging_on, $select,
                    )
                }
            }

            #[unsafe(no_mangle)]
            pub unsafe extern "C" fn fmi2FreeInstance(component: CComponent) {
                unsafe { $crate::abi::free_instance::<$component>(component) }
            }

            $crate::export_functions! { $component, $($common)* }
            $crate::$exchange! { $component, $($model_exchange)* }
        }
    };
}

/// Functions that hand on their arguments.
#[doc(hidden)]
#[macro_export]
macro_rules! export_functions {
    ($component:ty, $($c_name:ident = $function:ident($($argument:ident: $type:ty),*);)*) => {$(
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $c_name(component: CComponent, $($argument: $type),*) -> Status {
            unsafe { $crate::abi::$function::<$component>(component, $($argument),*) }
        }
    )*};
}

/// Functions of model exchange, of a component without it.
#[doc(hidden)]
#[macro_export]
macro_rules! export_refusals {
    ($component:ty, $($c_name:ident = $function:ident($($argument:ident: $type:ty),*);)*) => {$(
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $c_name(component: CComponent, $(_: $type),*) -> Status {
            unsafe { $crate::abi::not_for_co_simulation::<$component>(component, stringify!($c_name)) }
        }
    )*};
}
