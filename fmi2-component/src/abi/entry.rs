//! Entry from C: from a pointer to an instance, and from a result or a panic to a status.

use std::any::Any;
use std::cell::UnsafeCell;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, Ordering};

use crate::abi::types::CComponent;
use crate::instance::Instance;
use crate::life_cycle::{Function, State};
use crate::refusal::Status;
use crate::refusal::{Refusal, Severity};

/// Target of an `fmi2Component`.
pub(super) struct Handle<C> {
    /// A call is under way: a logger that calls back into its own instance is refused.
    busy: AtomicBool,
    instance: UnsafeCell<Instance<C>>,
}

impl<C> Handle<C> {
    pub fn into_pointer(instance: Instance<C>) -> CComponent {
        Box::into_raw(Box::new(Self {
            busy: AtomicBool::new(false),
            instance: UnsafeCell::new(instance),
        }))
        .cast()
    }
}

impl From<()> for Status {
    fn from((): ()) -> Self {
        Self::Ok
    }
}

/// Runs `body` on the instance, if `function` is legal in its state; the body's refusal or panic is logged under
/// `name` and becomes the status.
#[inline]
pub(super) unsafe fn enter<C, R: Into<Status>>(
    component: CComponent,
    function: Function,
    name: &str,
    body: impl FnOnce(&mut Instance<C>) -> Result<R, Refusal>,
) -> Status {
    // SAFETY: by the contract of this module the pointer is NULL or one that `into_pointer` gave.
    let Some(handle) = (unsafe { component.cast::<Handle<C>>().as_ref() }) else {
        return Status::Error;
    };
    // Not one atomic swap, which would cost more than the rest: this guards against re-entry on the same thread.
    if handle.busy.load(Ordering::Relaxed) {
        return Status::Error;
    }
    handle.busy.store(true, Ordering::Relaxed);
    // SAFETY: no other reference exists: other threads keep out by contract, and re-entry was refused just now.
    let instance = unsafe { &mut *handle.instance.get() };
    let status = if function.legal(instance.session.interface, instance.session.state) {
        match catch_unwind(AssertUnwindSafe(|| body(instance))) {
            Ok(Ok(done)) => done.into(),
            Ok(Err(refusal)) => refuse(instance, name, &refusal),
            Err(panic) => poison(instance, name, &*panic),
        }
    } else {
        illegal(instance, function, name)
    };
    handle.busy.store(false, Ordering::Relaxed);
    status
}

/// Ends the instance; whether it was there and idle.
pub(super) unsafe fn free<C>(component: CComponent) {
    let pointer = component.cast::<Handle<C>>();
    // SAFETY: by the contract of this module the pointer is NULL or one that `into_pointer` gave.
    let Some(handle) = (unsafe { pointer.as_ref() }) else {
        return;
    };
    if handle.busy.load(Ordering::Relaxed) {
        return;
    }
    // SAFETY: the pointer came out of a box, and by contract no caller uses it any more.
    let handle = unsafe { Box::from_raw(pointer) };
    // A component may panic when it is dropped; there is no instance left that could log it.
    let _ = catch_unwind(AssertUnwindSafe(|| drop(handle)));
}

#[cold]
fn refuse<C>(instance: &mut Instance<C>, name: &str, refusal: &Refusal) -> Status {
    if refusal.severity() == Severity::Fatal {
        instance.session.state = State::Fatal;
    }
    let status = refusal.status();
    instance.log.reason(status, &format!("{name}: {}", refusal.message()));
    status
}

#[cold]
fn illegal<C>(instance: &Instance<C>, function: Function, name: &str) -> Status {
    let state = instance.session.state;
    let (status, expected) = match (state, function) {
        (State::Fatal, _) => (Status::Fatal, "only fmi2FreeInstance is legal now".to_owned()),
        _ => (Status::Error, whereabouts(instance, function)),
    };
    instance.log.reason(
        status,
        &format!("{name} is illegal in state {}: {expected}", state.name()),
    );
    status
}

/// Where the function would be legal.
fn whereabouts<C>(instance: &Instance<C>, function: Function) -> String {
    let interface = instance.session.interface;
    match function.only_in() {
        Some(only) if only != interface => format!(
            "the component was instantiated for {}, the function is one of {}",
            interface.name(),
            only.name()
        ),
        _ => format!("the function is legal in {}", function.legal_in()),
    }
}

#[cold]
fn poison<C>(instance: &mut Instance<C>, name: &str, panic: &(dyn Any + Send)) -> Status {
    instance.session.state = State::Fatal;
    let what = panic_message(panic);
    instance.log.reason(
        Status::Fatal,
        &format!("{name}: the component has panicked ({what}) and can only be freed"),
    );
    Status::Fatal
}

pub(super) fn panic_message(panic: &(dyn Any + Send)) -> &str {
    panic
        .downcast_ref::<String>()
        .map(String::as_str)
        .or_else(|| panic.downcast_ref::<&str>().copied())
        .unwrap_or("without a message")
}
