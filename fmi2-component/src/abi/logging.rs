//! Which log lines the master has requested (FMI 2.0, clause 2.1.5).

use super::entry::enter;
use super::pointers::{input, text};
use super::types::{CBoolean, CComponent, CString};
use crate::component::Component;
use crate::instance::Instance;
use crate::life_cycle::Function;
use crate::status::Status;

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
