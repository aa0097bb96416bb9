//! `fmi2GetStatus` and its relatives (FMI 2.0, clause 4.2.3).

use std::ffi::c_int;

use super::entry::enter;
use super::pointers::place;
use super::types::{CBoolean, CComponent, CString};
use crate::component::Component;
use crate::instance::Instance;
use crate::life_cycle::{Function, State};
use crate::refusal::Refusal;
use crate::refusal::Status;
use crate::session::Session;

/// `fmi2StatusKind`.
const DO_STEP_STATUS: c_int = 0;
const PENDING_STATUS: c_int = 1;
const LAST_SUCCESSFUL_TIME: c_int = 2;
const TERMINATED: c_int = 3;

/// `fmi2GetStatus`: how the last step went.
pub unsafe fn get_status<C: Component>(component: CComponent, kind: c_int, value: *mut Status) -> Status {
    // SAFETY: the contract is passed on.
    unsafe {
        answer::<C, _>(
            component,
            "fmi2GetStatus",
            (kind, DO_STEP_STATUS),
            value,
            |session| match session.state {
                State::StepFailed => Status::Discard,
                _ => Status::Ok,
            },
        )
    }
}

/// `fmi2GetRealStatus`: the time that was reached.
pub unsafe fn get_real_status<C: Component>(component: CComponent, kind: c_int, value: *mut f64) -> Status {
    let kinds = (kind, LAST_SUCCESSFUL_TIME);
    // SAFETY: the contract is passed on.
    unsafe { answer::<C, _>(component, "fmi2GetRealStatus", kinds, value, |s| s.time) }
}

/// `fmi2GetIntegerStatus`: no status is of that type.
pub unsafe fn get_integer_status<C: Component>(component: CComponent, kind: c_int, value: *mut c_int) -> Status {
    let name = "fmi2GetIntegerStatus";
    // SAFETY: the contract is passed on.
    unsafe { answer::<C, _>(component, name, (kind, -1), value, |_| 0) }
}

/// `fmi2GetBooleanStatus`: whether the component wants to end, which it does once it has discarded a step.
pub unsafe fn get_boolean_status<C: Component>(component: CComponent, kind: c_int, value: *mut CBoolean) -> Status {
    let name = "fmi2GetBooleanStatus";
    // SAFETY: the contract is passed on.
    unsafe {
        answer::<C, _>(component, name, (kind, TERMINATED), value, |session| {
            CBoolean::from(session.state == State::StepFailed)
        })
    }
}

/// `fmi2GetStringStatus`: nothing is ever pending.
pub unsafe fn get_string_status<C: Component>(component: CComponent, kind: c_int, value: *mut CString) -> Status {
    let name = "fmi2GetStringStatus";
    // SAFETY: the contract is passed on.
    unsafe { answer::<C, _>(component, name, (kind, PENDING_STATUS), value, |_| c"".as_ptr()) }
}

/// Answers the one kind of question that has an answer of type `T`.
unsafe fn answer<C: Component, T>(
    component: CComponent,
    name: &str,
    (kind, answerable): (c_int, c_int),
    value: *mut T,
    read: impl Fn(&Session<C>) -> T,
) -> Status {
    let body = |instance: &mut Instance<C>| {
        // SAFETY: NULL or one writable place, by contract.
        let place = unsafe { place(value, "value") }?;
        if kind != answerable {
            return Err(Refusal::discard(format!(
                "status kind {kind} has no answer of this type"
            )));
        }
        place.write(read(&instance.session));
        Ok(())
    };
    // SAFETY: the contract is passed on.
    unsafe { enter(component, Function::GetStatus, name, body) }
}
