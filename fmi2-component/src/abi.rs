//! The crossing from C: types, pointers, and the way from a call to its status. Not for use by hand.
//!
//! All `unsafe` of the shell is here and in the one call of the logger. Every function has the same contract, which
//! is that of the standard: the instance pointer is NULL or comes from `fmi2Instantiate` of the same component and has
//! not been freed; no two threads call one instance at the same time; an array has as many elements as its count says.
//! NULL arrays, impossible counts and misaligned arrays are refused.
#![allow(clippy::missing_safety_doc)] // one contract for all, above

mod functions;
#[cfg(test)]
mod tests;

use std::any::Any;
use std::borrow::Cow;
use std::cell::UnsafeCell;
use std::ffi::{CStr, c_char, c_int, c_uint, c_void};
use std::mem::MaybeUninit;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, Ordering};

pub use crate::refusal::Status;
pub use functions::*;

use crate::instance::Instance;
use crate::life_cycle::{Function, State};
use crate::log::Logger;
use crate::refusal::Refusal;

/// `fmi2Component`.
pub type CComponent = *mut c_void;
/// `fmi2FMUstate`: a number, see `instance.rs`.
pub type CFmuState = *mut c_void;
/// `fmi2ValueReference`.
pub type CValueReference = c_uint;
/// `fmi2Boolean`: 0 is false.
pub type CBoolean = c_int;
/// `fmi2String`.
pub type CString = *const c_char;

/// `fmi2CallbackFunctions`. The shell uses the logger alone: Rust allocates for itself, and no step is asynchronous.
#[repr(C)]
#[derive(Debug)]
pub struct CallbackFunctions {
    /// Takes log lines; may be NULL.
    pub logger: Option<Logger>,
    /// Not used.
    pub allocate_memory: Option<unsafe extern "C" fn(usize, usize) -> *mut c_void>,
    /// Not used.
    pub free_memory: Option<unsafe extern "C" fn(*mut c_void)>,
    /// Not used.
    pub step_finished: Option<unsafe extern "C" fn(*mut c_void, c_int)>,
    /// Handed back to the logger.
    pub component_environment: *mut c_void,
}

/// `fmi2EventInfo`: what an event has led to.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[allow(missing_docs)] // the names are those of the standard
pub struct EventInfo {
    pub new_discrete_states_needed: CBoolean,
    pub terminate_simulation: CBoolean,
    pub nominals_of_continuous_states_changed: CBoolean,
    pub values_of_continuous_states_changed: CBoolean,
    pub next_event_time_defined: CBoolean,
    pub next_event_time: f64,
}

/// What `fmi2GetTypesPlatform` answers.
pub const TYPES_PLATFORM: &CStr = c"default";
/// What `fmi2GetVersion` answers.
pub const VERSION: &CStr = c"2.0";

/// Target of an `fmi2Component`.
struct Handle<C> {
    /// A call is under way: a logger that calls back into its own instance is refused.
    busy: AtomicBool,
    instance: UnsafeCell<Instance<C>>,
}

impl<C> Handle<C> {
    fn into_pointer(instance: Instance<C>) -> CComponent {
        let (busy, instance) = (AtomicBool::new(false), UnsafeCell::new(instance));
        Box::into_raw(Box::new(Self { busy, instance })).cast()
    }

    /// Ends the instance, if it is there and idle.
    unsafe fn free(component: CComponent) {
        let pointer = component.cast::<Self>();
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
}

impl From<()> for Status {
    #[inline]
    fn from((): ()) -> Self {
        Self::Ok
    }
}

/// Runs `body` on the instance, if `function` is legal in its state; the body's refusal or panic is logged under
/// `name` and becomes the status.
#[inline]
unsafe fn enter<C, R: Into<Status>>(
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

#[cold]
fn refuse<C>(instance: &mut Instance<C>, name: &str, refusal: &Refusal) -> Status {
    if refusal.status() == Status::Fatal {
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

fn panic_message(panic: &(dyn Any + Send)) -> &str {
    panic
        .downcast_ref::<String>()
        .map(String::as_str)
        .or_else(|| panic.downcast_ref::<&str>().copied())
        .unwrap_or("without a message")
}

/// No call needs more elements; a larger count is a negative or uninitialised number.
const MOST_ELEMENTS: usize = 1 << 20;

/// The elements of an array that is read.
#[inline]
unsafe fn input<'a, T>(pointer: *const T, count: usize, what: &str) -> Result<&'a [T], Refusal> {
    if count == 0 {
        return Ok(&[]);
    }
    check(pointer, count, what)?;
    // SAFETY: not NULL, aligned, of a sane size, and by the contract of `abi` as long as its count says.
    Ok(unsafe { std::slice::from_raw_parts(pointer, count) })
}

/// The places of an array that is written.
#[inline]
unsafe fn output<'a, T>(pointer: *mut T, count: usize, what: &str) -> Result<&'a mut [MaybeUninit<T>], Refusal> {
    if count == 0 {
        return Ok(&mut []);
    }
    check(pointer, count, what)?;
    // SAFETY: not NULL, aligned, of a sane size, and by the contract of `abi` as long as its count says; what is there now is not read.
    Ok(unsafe { std::slice::from_raw_parts_mut(pointer.cast(), count) })
}

/// Value references, and as many values.
#[inline]
unsafe fn settings<'a, T>(
    (references, values): (*const CValueReference, *const T),
    count: usize,
) -> Result<(&'a [CValueReference], &'a [T]), Refusal> {
    if count == 0 {
        return Ok((&[], &[]));
    }
    check_both(references, values, count)?;
    // SAFETY: neither is NULL, both are aligned, of a sane size, and by the contract of this module as long as the count says.
    Ok(unsafe {
        (
            std::slice::from_raw_parts(references, count),
            std::slice::from_raw_parts(values, count),
        )
    })
}

/// Value references, and as many places of values.
#[inline]
unsafe fn readings<'a, T>(
    (references, values): (*const CValueReference, *mut T),
    count: usize,
) -> Result<(&'a [CValueReference], &'a mut [MaybeUninit<T>]), Refusal> {
    if count == 0 {
        return Ok((&[], &mut []));
    }
    check_both(references, values, count)?;
    // SAFETY: as in `settings`; what the master's memory holds now is not read.
    Ok(unsafe {
        (
            std::slice::from_raw_parts(references, count),
            std::slice::from_raw_parts_mut(values.cast(), count),
        )
    })
}

/// The place of a single answer.
#[inline]
unsafe fn place<'a, T>(pointer: *mut T, what: &str) -> Result<&'a mut MaybeUninit<T>, Refusal> {
    // SAFETY: passed on.
    unsafe { output(pointer, 1, what) }.map(|places| &mut places[0])
}

/// The text of a C string; what is not UTF-8 in it is replaced.
unsafe fn text<'a>(pointer: *const c_char) -> Option<Cow<'a, str>> {
    if pointer.is_null() {
        return None;
    }
    // SAFETY: not NULL, and by the standard it ends in NUL.
    Some(unsafe { CStr::from_ptr(pointer) }.to_string_lossy())
}

#[inline]
fn check<T>(pointer: *const T, count: usize, what: &str) -> Result<(), Refusal> {
    if pointer.is_null() || !pointer.is_aligned() || count > MOST_ELEMENTS {
        return Err(refuse_array(pointer.is_null(), count, what));
    }
    Ok(())
}

/// Checks both arrays at once: these calls are in every step.
#[inline]
fn check_both<T>(references: *const CValueReference, values: *const T, count: usize) -> Result<(), Refusal> {
    let aligned = references.is_aligned() & values.is_aligned();
    if !aligned | references.is_null() | values.is_null() | (count > MOST_ELEMENTS) {
        return refuse_either(references, values, count);
    }
    Ok(())
}

#[cold]
#[inline(never)]
fn refuse_either<T>(references: *const CValueReference, values: *const T, count: usize) -> Result<(), Refusal> {
    check(references, count, "vr")?;
    check(values, count, "value")
}

#[cold]
fn refuse_array(null: bool, count: usize, what: &str) -> Refusal {
    Refusal::error(if null {
        format!("{what} is NULL; expected an array of {count}")
    } else if count > MOST_ELEMENTS {
        format!("the count of {what} is {count}; allowed are at most {MOST_ELEMENTS}")
    } else {
        format!("{what} is not aligned; expected an array of {count}")
    })
}
