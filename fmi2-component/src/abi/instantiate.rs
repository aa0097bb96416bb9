//! Instantiation, release, and which log lines the master has requested (FMI 2.0, clause 2.1.5).

use std::ffi::{CStr, c_int};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::ptr;

use super::entry::{self, Handle, enter, panic_message};
use super::pointers::{input, text};
use super::types::{CBoolean, CComponent, CString, CallbackFunctions};
use crate::component::Component;
use crate::instance::Instance;
use crate::life_cycle::Function;
use crate::log::Log;
use crate::model::Model;
use crate::refusal::Refusal;
use crate::refusal::Status;
use crate::session::Select;

/// `fmi2Type`.
const MODEL_EXCHANGE: c_int = 0;
const CO_SIMULATION: c_int = 1;

/// `fmi2Instantiate`; a component with the interface of model exchange has `select`. The resource location is not used, so that
/// every notation of it is accepted.
pub unsafe fn instantiate<C: Component>(
    instance_name: CString,
    fmu_type: c_int,
    guid: CString,
    functions: *const CallbackFunctions,
    logging_on: CBoolean,
    select: Option<fn(&mut C)>,
) -> CComponent {
    // SAFETY: NULL or one readable structure, by contract.
    let Ok([functions]) = (unsafe { input(functions, 1, "functions") }) else {
        return ptr::null_mut(); // and no logger to tell
    };
    let name = if instance_name.is_null() {
        c""
    } else {
        // SAFETY: not NULL, and by the standard it ends in NUL.
        unsafe { CStr::from_ptr(instance_name) }
    };
    // SAFETY: by the standard the callbacks stay callable until `fmi2FreeInstance`, which drops the log.
    let mut log = unsafe { log::<C>(functions, name) };
    log.enable_all(logging_on != 0);
    let make = || {
        check_name(name)?;
        let select = interface(fmu_type, select)?;
        // SAFETY: NULL or a C string, by the standard.
        check_guid::<C>(unsafe { text(guid) }.as_deref())?;
        Instance::<C>::new(log, select)
    };
    let (status, reason) = match catch_unwind(AssertUnwindSafe(make)) {
        Ok(Ok(instance)) => return Handle::into_pointer(instance),
        Ok(Err(refusal)) => (refusal.status(), refusal.message().to_owned()),
        Err(panic) => (
            Status::Fatal,
            format!("the component has panicked ({})", panic_message(&*panic)),
        ),
    };
    // SAFETY: as above; the callbacks are callable during this call at least.
    unsafe { self::log::<C>(functions, name) }.reason(status, &format!("fmi2Instantiate: {reason}"));
    ptr::null_mut()
}

/// `fmi2FreeInstance`. NULL is fine.
pub unsafe fn free_instance<C: Component>(component: CComponent) {
    // SAFETY: the contract is passed on.
    unsafe { entry::free::<C>(component) }
}

unsafe fn log<C: Component>(functions: &CallbackFunctions, name: &CStr) -> Log {
    let categories = C::Model::CATEGORIES;
    // SAFETY: the contract is passed on.
    unsafe { Log::new(functions.logger, functions.component_environment, name, categories) }
}

fn check_name(name: &CStr) -> Result<(), Refusal> {
    if name.is_empty() {
        return Err(Refusal::error("instanceName is NULL or empty; expected a name"));
    }
    Ok(())
}

/// Selects the interface that the master has requested.
fn interface<C>(fmu_type: c_int, select: Select<C>) -> Result<Select<C>, Refusal> {
    match (fmu_type, select) {
        (CO_SIMULATION, _) => Ok(None),
        (MODEL_EXCHANGE, Some(_)) => Ok(select),
        (_, Some(_)) => Err(Refusal::error(format!(
            "fmuType = {fmu_type} is refused; allowed are {MODEL_EXCHANGE} (model exchange) and {CO_SIMULATION} (co-simulation)"
        ))),
        (_, None) => Err(Refusal::error(format!(
            "fmuType = {fmu_type} is refused; the component is for co-simulation ({CO_SIMULATION}) only"
        ))),
    }
}

fn check_guid<C: Component>(guid: Option<&str>) -> Result<(), Refusal> {
    let own = C::Model::GUID;
    match guid {
        // Some masters write the braces of a registry GUID around it.
        Some(given) if given.trim_matches(['{', '}']) == own => Ok(()),
        given => Err(Refusal::error(format!(
            "fmuGUID is {}, but the library of {} was built with {own}: modelDescription.xml and library do not belong \
             together",
            given.unwrap_or("NULL"),
            C::Model::IDENTIFIER,
        ))),
    }
}

/// `fmi2SetDebugLogging`. No category at all means all of them; an unknown one is a warning.
pub unsafe fn set_debug_logging<C: Component>(
    component: CComponent,
    logging_on: CBoolean,
    count: usize,
    categories: *const CString,
) -> Status {
    let body = |instance: &mut Instance<C>| {
        // SAFETY: the array is as long as its count, by contract.
        let categories = unsafe { input(categories, count, "categories") }?;
        let log = &mut instance.log;
        if logging_on == 0 || categories.is_empty() {
            log.enable_all(logging_on != 0);
            return Ok(Status::Ok);
        }
        // SAFETY: NULL or C strings, by the standard.
        let names: Vec<_> = categories
            .iter()
            .map(|&c| unsafe { text(c) }.unwrap_or("NULL".into()))
            .collect();
        Ok(if log.enable_only(names.iter().map(AsRef::as_ref)) {
            Status::Ok
        } else {
            Status::Warning
        })
    };
    let function = Function::SetDebugLogging;
    // SAFETY: the contract is passed on.
    unsafe { enter(component, function, "fmi2SetDebugLogging", body) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_is_needed() {
        assert!(check_name(c"").is_err());
        assert!(check_name(c"rig").is_ok());
    }
}
