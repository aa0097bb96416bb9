//! The C functions, each as a generic one that [`export!`](crate::export) gives its name. Not for use by hand.
//!
//! All `unsafe` of the shell is here and in the one call of the logger. Every function has the same contract, which
//! is that of the standard: the instance pointer is NULL or comes from `fmi2Instantiate` of the same component and has
//! not been freed; no two threads call one instance at the same time; an array has as many elements as its count says.
//! NULL arrays, impossible counts and misaligned arrays are refused.
#![allow(clippy::missing_safety_doc)] // one contract for all, above

mod derivatives;
mod entry;
mod experiment;
mod fmu_state;
mod instantiate;
mod model_exchange;
mod pointers;
mod status;
mod types;
mod values;

pub use derivatives::{get_directional_derivative, get_real_output_derivatives, set_real_input_derivatives};
pub use experiment::{
    cancel_step, do_step, enter_initialization_mode, exit_initialization_mode, reset, setup_experiment, terminate,
};
pub use fmu_state::{
    deserialize_fmu_state, free_fmu_state, get_fmu_state, serialize_fmu_state, serialized_fmu_state_size, set_fmu_state,
};
pub use instantiate::{free_instance, instantiate, set_debug_logging};
pub use model_exchange::{
    completed_integrator_step, enter_continuous_time_mode, enter_event_mode, get_continuous_states, get_derivatives,
    get_event_indicators, get_nominals_of_continuous_states, new_discrete_states, not_for_co_simulation,
    set_continuous_states, set_time,
};
pub use status::{get_boolean_status, get_integer_status, get_real_status, get_status, get_string_status};
pub use types::{
    CBoolean, CComponent, CFmuState, CString, CValueReference, CallbackFunctions, EventInfo, TYPES_PLATFORM, VERSION,
};
pub use values::{get_boolean, get_integer, get_real, get_string, set_boolean, set_integer, set_real, set_string};

pub use crate::refusal::Status;
