//! The C functions, each as a generic one that [`export!`](crate::export) gives its name.

use std::any::TypeId;
use std::ffi::{CStr, CString as OwnedCString, c_char, c_int};
use std::ops::Range;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::ptr;

use super::{
    CBoolean, CComponent, CFmuState, CString, CValueReference, CallbackFunctions, EventInfo, Handle, Status, enter,
    input, output, panic_message, place, readings, settings, text,
};
use crate::component::{BooleanOf, Component, IntegerOf, Key, Model, ModelExchange, RealOf, StringOf};
use crate::instance::{Instance, Select, Session};
use crate::life_cycle::{Function, State};
use crate::log::Log;
use crate::refusal::Refusal;
use crate::resources::Resources;
use crate::variable::Causality;

/// Declares functions of a [`Component`] or of [`ModelExchange`]: the name in Rust, the group of the life cycle, the name in C, the
/// arguments, and what is done with the instance.
macro_rules! functions {
    ($bound:ident: $(
        $(#[$note:meta])*
        $name:ident = $function:ident $c_name:literal ($($argument:ident: $type:ty),*) |$instance:pat_param| $body:expr;
    )*) => {$(
        #[doc = concat!("`", $c_name, "`.")]
        $(#[$note])*
        #[inline]
        pub unsafe fn $name<C: $bound>(component: CComponent, $($argument: $type),*) -> Status {
            let body = |$instance: &mut Instance<C>| $body;
            // SAFETY: the contract is passed on.
            unsafe { enter(component, Function::$function, $c_name, body) }
        }
    )*};
}

// From set-up to termination (FMI 2.0, clauses 2.1.6 and 4.2.2).
functions! {
    Component:

    /// The tolerance is checked and not used: what a component cannot do exactly it decides for itself.
    setup_experiment = SetupExperiment "fmi2SetupExperiment" (
        tolerance_defined: CBoolean, tolerance: f64, start_time: f64, stop_time_defined: CBoolean, stop_time: f64
    ) |instance| {
        let stop_time = (stop_time_defined != 0).then_some(stop_time);
        let tolerance = (tolerance_defined != 0).then_some(tolerance);
        instance.set_up(tolerance, start_time, stop_time)
    };

    enter_initialization_mode = EnterInitializationMode "fmi2EnterInitializationMode" () |instance| {
        instance.session.state = State::InitializationMode;
        Ok(())
    };

    exit_initialization_mode = ExitInitializationMode "fmi2ExitInitializationMode" () |instance| {
        instance.leave_initialization()
    };

    terminate = Terminate "fmi2Terminate" () |instance| {
        instance.session.state = State::Terminated;
        Ok(())
    };

    /// The instance is as if instantiated anew; its FMU states and log categories are kept.
    reset = Reset "fmi2Reset" () |instance| {
        instance.reset();
        Ok(())
    };

    /// Whether the master may come back to an earlier point makes no difference here.
    do_step = DoStep "fmi2DoStep" (time: f64, step: f64, _no_set_prior: CBoolean) |instance| instance.do_step(time, step);

    /// Never legal, since no step continues in the background.
    cancel_step = CancelStep "fmi2CancelStep" () |_| Ok(());

    /// No category at all means all of them; an unknown one is a warning.
    set_debug_logging = SetDebugLogging "fmi2SetDebugLogging" (
        logging_on: CBoolean, count: usize, categories: *const CString
    ) |instance| {
        // SAFETY: the array is as long as its count, by contract.
        let categories = unsafe { input(categories, count, "categories") }?;
        let log = &mut instance.log;
        if logging_on == 0 || categories.is_empty() {
            log.enable_all(logging_on != 0);
            return Ok(Status::Ok);
        }
        // SAFETY: NULL or C strings, by the standard.
        let names = categories.iter().map(|&name| unsafe { text(name) }.unwrap_or("NULL".into()));
        let names: Vec<_> = names.collect();
        let known = log.enable_only(names.iter().map(AsRef::as_ref));
        Ok(if known { Status::Ok } else { Status::Warning })
    };
}

/// `fmi2Type`.
const MODEL_EXCHANGE: c_int = 0;
const CO_SIMULATION: c_int = 1;

/// `fmi2Instantiate` (FMI 2.0, clause 2.1.5); a component with the interface of model exchange has `select`. The resource location is
/// read by a component that adopts another model, and by no other.
pub unsafe fn instantiate<C: Component>(
    instance_name: CString,
    fmu_type: c_int,
    guid: CString,
    resource_location: CString,
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
    let log = || {
        let (logger, environment) = (functions.logger, functions.component_environment);
        // SAFETY: by the standard the callbacks stay callable until `fmi2FreeInstance`, which drops the log.
        unsafe { Log::new(logger, environment, name, C::Model::CATEGORIES) }
    };
    let make = || {
        if name.is_empty() {
            return Err(Refusal::error("instanceName is NULL or empty; expected a name"));
        }
        let select = interface(fmu_type, select)?;
        // SAFETY: NULL or C strings, by the standard.
        let (guid, location) = unsafe { (text(guid), text(resource_location)) };
        // Some masters write the braces of a registry GUID around it.
        let guid = guid.as_deref().map_or("NULL", |guid| guid.trim_matches(['{', '}']));
        let session = session::<C>(guid, location.as_deref(), select)?;
        let mut log = log();
        log.enable_all(logging_on != 0);
        Ok(Instance::<C>::new(log, guid, session))
    };
    let (status, reason) = match catch_unwind(AssertUnwindSafe(make)) {
        Ok(Ok(instance)) => return Handle::into_pointer(instance),
        Ok(Err(refusal)) => (refusal.status(), refusal.message().to_owned()),
        Err(panic) => (
            Status::Fatal,
            format!("the component has panicked ({})", panic_message(&*panic)),
        ),
    };
    log().reason(status, &format!("fmi2Instantiate: {reason}"));
    ptr::null_mut()
}

/// `fmi2FreeInstance`. NULL is fine.
pub unsafe fn free_instance<C: Component>(component: CComponent) {
    // SAFETY: the contract is passed on.
    unsafe { Handle::<C>::free(component) }
}

/// Selects the interface that the master has requested.
fn interface<C>(fmu_type: c_int, select: Select<C>) -> Result<Select<C>, Refusal> {
    match (fmu_type, select) {
        (CO_SIMULATION, _) => Ok(None),
        (MODEL_EXCHANGE, Some(_)) => Ok(select),
        (_, Some(_)) => Err(Refusal::error(format!(
            "fmuType = {fmu_type} is refused; allowed are {MODEL_EXCHANGE} (model exchange) and {CO_SIMULATION} (co-simulation)"
        ))),
        (_, None) => Err(co_simulation_only(fmu_type)),
    }
}

fn co_simulation_only(fmu_type: c_int) -> Refusal {
    Refusal::error(format!(
        "fmuType = {fmu_type} is refused; the component is for co-simulation ({CO_SIMULATION}) only"
    ))
}

/// A component at its start values: of the library's own model, or of one that its resources determine.
fn session<C: Component>(guid: &str, location: Option<&str>, select: Select<C>) -> Result<Session<C>, Refusal> {
    let mut session = Session::<C>::new(select)?;
    if guid != C::Model::GUID {
        session.component.adopt(guid, &Resources::at(location))?;
        if select.is_some() {
            return Err(co_simulation_only(MODEL_EXCHANGE));
        }
    }
    Ok(session)
}

/// Declares a getter and a setter of one type (FMI 2.0, clause 2.1.7).
macro_rules! values {
    ($get:ident $c_get:literal, $set:ident $c_set:literal, $setting:ident, $key:ident, $c_type:ty, $read:expr, $further:expr, $check:expr, $write:expr) => {
        functions! {
            Component:
            $get = GetValues $c_get (references: *const CValueReference, count: usize, values: *mut $c_type) |instance| {
                // SAFETY: the arrays are as long as their count, by contract.
                let (references, values) = unsafe { readings((references, values), count) }?;
                if instance.session.stale {
                    refresh_for::<C, $key<C>>(instance, references)?;
                }
                for (&reference, value) in references.iter().zip(values) {
                    let component = &instance.session.component;
                    value.write(match $key::<C>::find(reference) {
                        Some(key) => $read(component, key),
                        None => $further(component, reference)?,
                    });
                }
                Ok(())
            };
            $set = $setting $c_set (references: *const CValueReference, count: usize, values: *const $c_type) |instance| {
                // SAFETY: the arrays are as long as their count, by contract.
                let (references, values) = unsafe { settings((references, values), count) }?;
                // All are checked before the first is set.
                let mut inputs = true;
                for (&reference, &value) in references.iter().zip(values) {
                    let key = find::<$key<C>>(reference)?;
                    inputs &= instance.check_settable(key)?.causality == Causality::Input;
                    $check(key, value)?;
                }
                let set = |component: &mut C| {
                    for (&reference, &value) in references.iter().zip(values) {
                        $write(component, find::<$key<C>>(reference)?, value)?;
                    }
                    Ok(())
                };
                if count <= 1 || C::TAKES_EVERY_INPUT && inputs {
                    set(&mut instance.session.component)?;
                } else {
                    instance.change(set)?;
                }
                instance.values_change();
                Ok(())
            };
        }
    };
}

values!(
    get_real "fmi2GetReal", set_real "fmi2SetReal", SetReal, RealOf, f64,
    |c: &C, key| c.get_real(key),
    further,
    |key, value| Instance::<C>::check_finite(key, value),
    |c: &mut C, key, value| c.set_real(key, value)
);
values!(
    get_integer "fmi2GetInteger", set_integer "fmi2SetInteger", SetDiscrete, IntegerOf, c_int,
    |c: &C, key| c.get_integer(key),
    |_, reference| Err(unknown::<IntegerOf<C>>(reference)),
    |_, _| Ok::<_, Refusal>(()),
    |c: &mut C, key, value| c.set_integer(key, value)
);
values!(
    get_boolean "fmi2GetBoolean", set_boolean "fmi2SetBoolean", SetDiscrete, BooleanOf, CBoolean,
    |c: &C, key| CBoolean::from(c.get_boolean(key)),
    |_, reference| Err(unknown::<BooleanOf<C>>(reference)),
    |_, _| Ok::<_, Refusal>(()),
    |c: &mut C, key, value| c.set_boolean(key, value != 0)
);

functions! {
    Component:

    /// The strings live until it is called again, which is longer than the standard asks for.
    get_string = GetValues "fmi2GetString" (
        references: *const CValueReference, count: usize, values: *mut CString
    ) |instance| {
        // SAFETY: the arrays are as long as their count, by contract.
        let (references, values) = unsafe { (input(references, count, "vr")?, output(values, count, "value")?) };
        if instance.session.stale {
            refresh_for::<C, StringOf<C>>(instance, references)?;
        }
        instance.strings.clear();
        for (&reference, value) in references.iter().zip(values) {
            let string = instance.session.component.get_string(find(reference)?);
            let string = OwnedCString::new(string.replace('\0', "\u{fffd}"))?;
            value.write(string.as_ptr());
            instance.strings.push(string);
        }
        Ok(())
    };

    /// Bytes that are not UTF-8 are replaced.
    set_string = SetDiscrete "fmi2SetString" (
        references: *const CValueReference, count: usize, values: *const CString
    ) |instance| {
        // SAFETY: the arrays are as long as their count, by contract.
        let (references, values) = unsafe { (input(references, count, "vr")?, input(values, count, "value")?) };
        let mut settings = Vec::with_capacity(count);
        for (&reference, &value) in references.iter().zip(values) {
            let key = find::<StringOf<C>>(reference)?;
            instance.check_settable(key)?;
            // SAFETY: NULL or a C string, by the standard.
            let value = unsafe { text(value) }
                .ok_or_else(|| Refusal::error(format!("{} = NULL; expected text", key.variable().name)))?;
            settings.push((key, value));
        }
        instance.change(|component| settings.iter().try_for_each(|(key, value)| component.set_string(*key, value)))?;
        instance.values_change();
        Ok(())
    };
}

/// Makes computed values right in Initialization Mode; reading back what was set needs no more than that.
#[cold]
fn refresh_for<C: Component, K: Key>(
    instance: &mut Instance<C>,
    references: &[CValueReference],
) -> Result<(), Refusal> {
    for &reference in references {
        if K::find(reference).is_none_or(|key| key.variable().computed()) {
            return instance.refresh();
        }
    }
    Ok(())
}

/// An output that is not in the table.
#[cold]
#[inline(never)]
fn further<C: Component>(component: &C, reference: CValueReference) -> Result<f64, Refusal> {
    if component.further().contains(&reference) {
        return Ok(component.get_further(reference));
    }
    let mut refusal = unknown::<RealOf<C>>(reference).message().to_owned();
    if let Range { start, end: end @ 1.. } = component.further() {
        refusal += &format!(", or from {start} to {}", end - 1);
    }
    Err(Refusal::error(refusal))
}

#[inline]
fn find<K: Key>(reference: CValueReference) -> Result<K, Refusal> {
    K::find(reference).ok_or_else(|| unknown::<K>(reference))
}

#[cold]
fn unknown<K: Key>(reference: CValueReference) -> Refusal {
    let names = [
        (TypeId::of::<f64>(), "Real"),
        (TypeId::of::<i32>(), "Integer"),
        (TypeId::of::<bool>(), "Boolean"),
    ];
    let name = names.iter().find(|(id, _)| *id == TypeId::of::<K::Value>());
    let name = name.map_or("String", |(_, name)| name);
    let known: Vec<_> = K::VARIABLES.iter().map(|v| v.value_reference.to_string()).collect();
    let expected = if known.is_empty() {
        format!("the model has no variables of type {name}")
    } else {
        format!("expected one of {}", known.join(", "))
    };
    Refusal::error(format!(
        "value reference {reference} is unknown among variables of type {name}; {expected}"
    ))
}

// FMU states: taken, set back, freed, and as bytes (FMI 2.0, clause 2.1.8).
functions! {
    Component:

    /// A state given on entry is overwritten.
    get_fmu_state = FMUstate "fmi2GetFMUstate" (state: *mut CFmuState) |instance| {
        let session = instance.session.clone();
        // SAFETY: the contract is passed on.
        unsafe { keep(instance, state, session) }
    };

    set_fmu_state = FMUstate "fmi2SetFMUstate" (state: CFmuState) |instance| {
        let session = instance.snapshots.get(state.addr())?;
        instance.session.clone_from(session);
        Ok(())
    };

    /// NULL is fine; a freed state becomes NULL.
    free_fmu_state = FMUstate "fmi2FreeFMUstate" (state: *mut CFmuState) |instance| {
        if state.is_null() {
            return Ok(());
        }
        // SAFETY: one readable handle, by contract.
        let handle = unsafe { input(state, 1, "FMUstate") }?[0];
        if !handle.is_null() {
            instance.snapshots.free(handle.addr())?;
            // SAFETY: one writable handle, by contract.
            unsafe { place(state, "FMUstate") }?.write(ptr::null_mut());
        }
        Ok(())
    };

    serialized_fmu_state_size = FMUstate "fmi2SerializedFMUstateSize" (state: CFmuState, size: *mut usize) |instance| {
        let bytes = instance.serialise(state.addr())?;
        // SAFETY: one writable place, by contract.
        unsafe { place(size, "size") }?.write(bytes.len());
        Ok(())
    };

    serialize_fmu_state = FMUstate "fmi2SerializeFMUstate" (state: CFmuState, bytes: *mut c_char, size: usize) |instance| {
        let serialised = instance.serialise(state.addr())?;
        if size < serialised.len() {
            return Err(Refusal::error(format!(
                "size = {size} is too small; the serialised state needs {} bytes",
                serialised.len()
            )));
        }
        // SAFETY: the array has `size` bytes by contract, and no fewer than are written.
        let places = unsafe { output(bytes.cast::<u8>(), serialised.len(), "serializedState") }?;
        places.write_copy_of_slice(&serialised);
        Ok(())
    };

    deserialize_fmu_state = FMUstate "fmi2DeSerializeFMUstate" (
        bytes: *const c_char, size: usize, state: *mut CFmuState
    ) |instance| {
        // SAFETY: the array has `size` bytes by contract.
        let bytes = unsafe { input(bytes.cast::<u8>(), size, "serializedState") }?;
        // SAFETY: the contract is passed on.
        unsafe { keep(instance, state, instance.deserialise(bytes)?) }
    };
}

/// Keeps `session` as the state that `*state` names, or as a new one where that is NULL.
unsafe fn keep<C: Component>(
    instance: &mut Instance<C>,
    state: *mut CFmuState,
    session: Session<C>,
) -> Result<(), Refusal> {
    // SAFETY: one readable handle, by contract.
    let handle = unsafe { input(state, 1, "FMUstate") }?[0];
    let handle = instance.snapshots.put(handle.addr(), session)?;
    // SAFETY: one writable handle, by contract.
    unsafe { place(state, "FMUstate") }?.write(ptr::without_provenance_mut(handle));
    Ok(())
}

// Time derivatives of inputs and outputs (FMI 2.0, clause 4.2.1), directional derivatives (clause 2.1.9).
functions! {
    Component:

    set_real_input_derivatives = SetRealInputDerivatives "fmi2SetRealInputDerivatives" (
        references: *const CValueReference, count: usize, orders: *const c_int, values: *const f64
    ) |instance| {
        // SAFETY: the arrays are as long as their count, by contract.
        let (references, orders, values) =
            unsafe { (input(references, count, "vr")?, input(orders, count, "order")?, input(values, count, "value")?) };
        let settings = || references.iter().zip(orders).zip(values);
        for ((&reference, &order), &value) in settings() {
            let key = find::<RealOf<C>>(reference)?;
            check_derivative(key, order, Causality::Input, "an input")?;
            Instance::<C>::check_finite(key, value)?;
        }
        // All are set or none.
        let mut changed = instance.session.component.clone();
        for ((&reference, &order), &value) in settings() {
            changed.set_real_input_derivative(find(reference)?, order.unsigned_abs(), value, &instance.log)?;
        }
        instance.session.component = changed;
        instance.values_change();
        Ok(())
    };

    get_real_output_derivatives = GetRealOutputDerivatives "fmi2GetRealOutputDerivatives" (
        references: *const CValueReference, count: usize, orders: *const c_int, values: *mut f64
    ) |instance| {
        // SAFETY: the arrays are as long as their count, by contract.
        let (references, orders, values) =
            unsafe { (input(references, count, "vr")?, input(orders, count, "order")?, output(values, count, "value")?) };
        for ((&reference, &order), value) in references.iter().zip(orders).zip(values) {
            let key = find::<RealOf<C>>(reference)?;
            check_derivative(key, order, Causality::Output, "an output")?;
            let component = &instance.session.component;
            value.write(component.get_real_output_derivative(key, order.unsigned_abs())?);
        }
        Ok(())
    };

    /// The partial derivatives, summed up along the direction `dvKnown`.
    get_directional_derivative = GetDirectionalDerivative "fmi2GetDirectionalDerivative" (
        unknowns: *const CValueReference, unknown_count: usize,
        knowns: *const CValueReference, known_count: usize, direction: *const f64, answer: *mut f64
    ) |instance| {
        // SAFETY: the arrays are as long as their count, by contract.
        let (unknowns, knowns) =
            unsafe { (input(unknowns, unknown_count, "vUnknown_ref")?, input(knowns, known_count, "vKnown_ref")?) };
        // SAFETY: the arrays are as long as their count, by contract.
        let (direction, answer) =
            unsafe { (input(direction, known_count, "dvKnown")?, output(answer, unknown_count, "dvUnknown")?) };
        if instance.session.stale {
            refresh_for::<C, RealOf<C>>(instance, unknowns)?;
        }
        for (&unknown, answer) in unknowns.iter().zip(answer) {
            let unknown = if is_discrete::<C>(unknown) { None } else { Some(find(unknown)?) };
            let mut sum = 0.0;
            for (&known, &along) in knowns.iter().zip(direction) {
                let known = find(known)?;
                if let Some(unknown) = unknown {
                    sum += instance.session.component.partial_derivative(unknown, known)? * along;
                }
            }
            answer.write(sum);
        }
        Ok(())
    };
}

/// Whether a reference is that of an Integer or Boolean output and of no Real. Some masters ask for the derivatives of all
/// outputs, whatever their type; such a value does not change between events, so that its derivative is 0.
fn is_discrete<C: Component>(reference: CValueReference) -> bool {
    fn is_output<K: Key>(reference: CValueReference) -> bool {
        K::find(reference).is_some_and(|key| key.variable().causality == Causality::Output)
    }
    RealOf::<C>::find(reference).is_none()
        && (is_output::<IntegerOf<C>>(reference) || is_output::<BooleanOf<C>>(reference))
}

fn check_derivative<K: Key>(key: K, order: c_int, causality: Causality, expected: &str) -> Result<(), Refusal> {
    let variable = key.variable();
    if variable.causality != causality {
        return Err(Refusal::error(format!(
            "{} has no such derivative; expected {expected}",
            variable.name
        )));
    }
    if order < 1 {
        return Err(Refusal::error(format!(
            "derivative {order} of {} is refused; allowed are orders of at least 1",
            variable.name
        )));
    }
    Ok(())
}

/// `fmi2StatusKind`.
const DO_STEP_STATUS: c_int = 0;
const PENDING_STATUS: c_int = 1;
const LAST_SUCCESSFUL_TIME: c_int = 2;
const TERMINATED: c_int = 3;

/// Declares a status query (FMI 2.0, clause 4.2.3): each type has an answer to one kind of question at most.
macro_rules! queries {
    ($($(#[$note:meta])* $name:ident = $c_name:literal $type:ty, $kind:expr => $answer:expr;)*) => {
        functions! {
            Component:
            $($(#[$note])* $name = GetStatus $c_name (kind: c_int, value: *mut $type) |instance| {
                // SAFETY: NULL or one writable place, by contract.
                let place = unsafe { place(value, "value") }?;
                if $kind != Some(kind) {
                    return Err(Refusal::discard(format!("status kind {kind} has no answer of this type")));
                }
                place.write($answer(&instance.session));
                Ok(())
            };)*
        }
    };
}

queries! {
    /// How the last step went.
    get_status = "fmi2GetStatus" Status, Some(DO_STEP_STATUS) => |session: &Session<C>| match session.state {
        State::StepFailed => Status::Discard,
        _ => Status::Ok,
    };
    /// The time that was reached.
    get_real_status = "fmi2GetRealStatus" f64, Some(LAST_SUCCESSFUL_TIME) => |session: &Session<C>| session.time;
    /// No status is of that type.
    get_integer_status = "fmi2GetIntegerStatus" c_int, None => |_: &Session<C>| 0;
    /// Whether the component wants to end, which it does once it has discarded a step.
    get_boolean_status = "fmi2GetBooleanStatus" CBoolean, Some(TERMINATED) => |session: &Session<C>| {
        CBoolean::from(session.state == State::StepFailed)
    };
    /// Nothing is ever pending.
    get_string_status = "fmi2GetStringStatus" CString, Some(PENDING_STATUS) => |_: &Session<C>| c"".as_ptr();
}

/// Any function of model exchange (FMI 2.0, clause 3.2), for a component without: an error with a reason.
pub unsafe fn not_for_co_simulation<C: Component>(component: CComponent, name: &str) -> Status {
    let body = |_: &mut Instance<C>| Ok(());
    // SAFETY: the contract is passed on.
    unsafe { enter(component, Function::EnterEventMode, name, body) }
}

functions! {
    ModelExchange:

    enter_event_mode = EnterEventMode "fmi2EnterEventMode" () |instance| {
        if instance.session.state != State::EventMode {
            instance.session.component.enter_event_mode();
            instance.session.state = State::EventMode;
        }
        Ok(())
    };

    new_discrete_states = NewDiscreteStates "fmi2NewDiscreteStates" (info: *mut EventInfo) |instance| {
        // SAFETY: NULL or one writable place, by contract.
        let place = unsafe { place(info, "fmi2eventInfo") }?;
        let session = &mut instance.session;
        let done = session.component.new_discrete_states(session.time, &instance.log)?;
        place.write(EventInfo {
            new_discrete_states_needed: done.again.into(),
            terminate_simulation: done.terminate.into(),
            nominals_of_continuous_states_changed: done.nominals_changed.into(),
            values_of_continuous_states_changed: done.states_changed.into(),
            next_event_time_defined: done.next_event_time.is_some().into(),
            next_event_time: done.next_event_time.unwrap_or(0.0),
        });
        Ok(())
    };

    enter_continuous_time_mode = EnterContinuousTimeMode "fmi2EnterContinuousTimeMode" () |instance| {
        instance.session.state = State::ContinuousTimeMode;
        Ok(())
    };

    /// The component never asks to end here.
    completed_integrator_step = CompletedIntegratorStep "fmi2CompletedIntegratorStep" (
        _no_set_prior: CBoolean, event: *mut CBoolean, terminate: *mut CBoolean
    ) |instance| {
        // SAFETY: NULL or one writable place each, by contract.
        let (event, terminate) = unsafe { (place(event, "enterEventMode")?, place(terminate, "terminateSimulation")?) };
        event.write(instance.session.component.completed_step().into());
        terminate.write(0);
        Ok(())
    };

    set_time = SetTime "fmi2SetTime" (time: f64) |instance| {
        if !time.is_finite() {
            return Err(Refusal::error(format!("time = {time} s is refused; allowed is a finite number")));
        }
        instance.session.time = time;
        instance.session.component.set_time(time);
        Ok(())
    };

    /// An integrator whose trial step has led to infinity may try a shorter one.
    set_continuous_states = SetContinuousStates "fmi2SetContinuousStates" (states: *const f64, count: usize) |instance| {
        let keys = C::Model::STATES;
        counted("nx", count, keys.len())?;
        // SAFETY: the array is as long as its count, by contract.
        let values = unsafe { input(states, count, "x") }?;
        if let Some(value) = values.iter().find(|value| !value.is_finite()) {
            return Err(Refusal::discard(format!(
                "a continuous state of {value} is refused; allowed are finite numbers"
            )));
        }
        for (&key, &value) in keys.iter().zip(values) {
            instance.session.component.set_state(key, value);
        }
        Ok(())
    };

    get_continuous_states = GetEquations "fmi2GetContinuousStates" (states: *mut f64, count: usize) |instance| {
        // SAFETY: the contract is passed on.
        unsafe { answer(instance, ("nx", count), states, C::Model::STATES.iter(), |c, key| c.get_real(*key)) }
    };

    get_derivatives = GetEquations "fmi2GetDerivatives" (derivatives: *mut f64, count: usize) |instance| {
        // SAFETY: the contract is passed on.
        unsafe { answer(instance, ("nx", count), derivatives, C::Model::DERIVATIVES.iter(), |c, key| c.get_real(*key)) }
    };

    get_event_indicators = GetEquations "fmi2GetEventIndicators" (indicators: *mut f64, count: usize) |instance| {
        // SAFETY: the contract is passed on.
        unsafe { answer(instance, ("ni", count), indicators, 0..C::Model::EVENT_INDICATORS, C::event_indicator) }
    };

    get_nominals_of_continuous_states = GetNominalsOfContinuousStates "fmi2GetNominalsOfContinuousStates" (
        nominals: *mut f64, count: usize
    ) |instance| {
        // SAFETY: the contract is passed on.
        unsafe { answer(instance, ("nx", count), nominals, C::Model::STATES.iter(), |c, key| c.nominal(*key)) }
    };
}

/// Answers one number for each item of a list.
unsafe fn answer<C: Component, I>(
    instance: &mut Instance<C>,
    (name, count): (&str, usize),
    values: *mut f64,
    list: impl ExactSizeIterator<Item = I>,
    value: impl Fn(&C, I) -> f64,
) -> Result<(), Refusal> {
    counted(name, count, list.len())?;
    // SAFETY: the array is as long as its count, by contract.
    let places = unsafe { output(values, count, "the array") }?;
    instance.refresh()?;
    for (item, place) in list.zip(places) {
        place.write(value(&instance.session.component, item));
    }
    Ok(())
}

fn counted(name: &str, count: usize, expected: usize) -> Result<(), Refusal> {
    let refusal = || Refusal::error(format!("{name} = {count} is refused; expected {expected}"));
    (count == expected).then_some(()).ok_or_else(refusal)
}
