//! `fmi2GetReal`, `fmi2SetReal`, and the same for integers, Booleans and strings (FMI 2.0, clause 2.1.7).

use std::any::TypeId;
use std::ffi::{CString as OwnedCString, c_int};

use super::entry::enter;
use super::pointers::{input, input_and_output, inputs, output, text};
use super::types::{CBoolean, CComponent, CString, CValueReference};
use crate::component::{Component, StringOf};
use crate::instance::Instance;
use crate::life_cycle::Function;
use crate::model::Key;
use crate::refusal::{Refusal, Status};
use crate::variable::Occasions;

/// Declares a getter and a setter of the ABI.
macro_rules! values {
    ($get:ident, $set:ident, $c_get:literal, $c_set:literal, $setting:expr, $c_type:ty,
     $read:expr, $check:expr, $write:expr) => {
        #[doc = concat!("`", $c_get, "`.")]
        #[inline]
        pub unsafe fn $get<C: Component>(
            component: CComponent,
            references: *const CValueReference,
            count: usize,
            values: *mut $c_type,
        ) -> Status {
            // SAFETY: the contract is passed on.
            unsafe { get(component, $c_get, references, count, values, $read) }
        }

        #[doc = concat!("`", $c_set, "`.")]
        #[inline]
        pub unsafe fn $set<C: Component>(
            component: CComponent,
            references: *const CValueReference,
            count: usize,
            values: *const $c_type,
        ) -> Status {
            // SAFETY: the contract is passed on.
            unsafe {
                set(
                    component,
                    ($setting, $c_set),
                    references,
                    count,
                    values,
                    $check,
                    $write,
                )
            }
        }
    };
}

values!(
    get_real,
    set_real,
    "fmi2GetReal",
    "fmi2SetReal",
    Function::SetReal,
    f64,
    |c: &C, key| c.get_real(key),
    |key, &value| Instance::<C>::check_finite(key, value),
    |c: &mut C, key, &value| c.set_real(key, value)
);
values!(
    get_integer,
    set_integer,
    "fmi2GetInteger",
    "fmi2SetInteger",
    Function::SetDiscrete,
    c_int,
    |c: &C, key| c.get_integer(key),
    |_, _| Ok(()),
    |c: &mut C, key, &value| c.set_integer(key, value)
);
values!(
    get_boolean,
    set_boolean,
    "fmi2GetBoolean",
    "fmi2SetBoolean",
    Function::SetDiscrete,
    CBoolean,
    |c: &C, key| CBoolean::from(c.get_boolean(key)),
    |_, _| Ok(()),
    |c: &mut C, key, &value| c.set_boolean(key, value != 0)
);

#[inline]
unsafe fn get<C: Component, K: Key, T>(
    component: CComponent,
    name: &str,
    references: *const CValueReference,
    count: usize,
    values: *mut T,
    read: impl Fn(&C, K) -> T,
) -> Status {
    let body = |instance: &mut Instance<C>| {
        // SAFETY: the arrays are as long as their count, by contract.
        let (references, values) = unsafe { input_and_output((references, values), count, &["vr", "value"]) }?;
        if instance.session.stale {
            refresh_for::<C, K>(instance, references)?;
        }
        for (&reference, value) in references.iter().zip(values) {
            let key = find::<K>(reference)?;
            value.write(read(&instance.session.component, key));
        }
        Ok(())
    };
    // SAFETY: the contract is passed on.
    unsafe { enter(component, Function::GetValues, name, body) }
}

#[inline]
unsafe fn set<C: Component, K: Key, T>(
    component: CComponent,
    (function, name): (Function, &str),
    references: *const CValueReference,
    count: usize,
    values: *const T,
    check: impl Fn(K, &T) -> Result<(), Refusal>,
    write: impl Fn(&mut C, K, &T) -> Result<(), Refusal>,
) -> Status {
    let body = |instance: &mut Instance<C>| {
        // SAFETY: the arrays are as long as their count, by contract.
        let (references, values) = unsafe { inputs((references, values), count, &["vr", "value"]) }?;
        // All are checked before the first is set.
        let mut common = Occasions::ALL;
        for (&reference, value) in references.iter().zip(values) {
            let key = find::<K>(reference)?;
            common = common.and(instance.check_settable(key)?);
            check(key, value)?;
        }
        if count <= 1 || C::TAKES_EVERY_INPUT && common.is_input() {
            set_each(&mut instance.session.component, references, values, &write)?;
        } else {
            instance.change(|component| set_each(component, references, values, &write))?;
        }
        instance.values_change();
        Ok(())
    };
    // SAFETY: the contract is passed on.
    unsafe { enter(component, function, name, body) }
}

/// `fmi2GetString`. The strings live until it is called again, which is longer than the standard asks for.
pub unsafe fn get_string<C: Component>(
    component: CComponent,
    references: *const CValueReference,
    count: usize,
    values: *mut CString,
) -> Status {
    let body = |instance: &mut Instance<C>| {
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
    // SAFETY: the contract is passed on.
    unsafe { enter(component, Function::GetValues, "fmi2GetString", body) }
}

/// `fmi2SetString`. What is not UTF-8 is replaced.
pub unsafe fn set_string<C: Component>(
    component: CComponent,
    references: *const CValueReference,
    count: usize,
    values: *const CString,
) -> Status {
    let body = |instance: &mut Instance<C>| {
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
        instance.change(|component| {
            for (key, value) in settings {
                component.set_string(key, &value)?;
            }
            Ok(())
        })?;
        instance.values_change();
        Ok(())
    };
    // SAFETY: the contract is passed on.
    unsafe { enter(component, Function::SetDiscrete, "fmi2SetString", body) }
}

#[inline]
fn set_each<C, K: Key, T>(
    component: &mut C,
    references: &[CValueReference],
    values: &[T],
    write: &impl Fn(&mut C, K, &T) -> Result<(), Refusal>,
) -> Result<(), Refusal> {
    for (&reference, value) in references.iter().zip(values) {
        write(component, find(reference)?, value)?;
    }
    Ok(())
}

/// Makes computed values right in Initialization Mode; reading back what was set needs no more than that.
#[cold]
pub(super) fn refresh_for<C: Component, K: Key>(
    instance: &mut Instance<C>,
    references: &[CValueReference],
) -> Result<(), Refusal> {
    for &reference in references {
        if find::<K>(reference)?.variable().computed() {
            return instance.refresh();
        }
    }
    Ok(())
}

#[inline]
pub(super) fn find<K: Key>(reference: CValueReference) -> Result<K, Refusal> {
    K::find(reference).ok_or_else(|| unknown::<K>(reference))
}

#[cold]
fn unknown<K: Key>(reference: CValueReference) -> Refusal {
    let type_name = type_name::<K>();
    let known: Vec<_> = K::VARIABLES.iter().map(|v| v.value_reference.to_string()).collect();
    let expected = if known.is_empty() {
        format!("the model has no variables of type {type_name}")
    } else {
        format!("expected one of {}", known.join(", "))
    };
    Refusal::error(format!(
        "value reference {reference} is unknown among variables of type {type_name}; {expected}"
    ))
}

/// The name of a type of variables in the standard.
fn type_name<K: Key>() -> &'static str {
    let names = [
        (TypeId::of::<f64>(), "Real"),
        (TypeId::of::<i32>(), "Integer"),
        (TypeId::of::<bool>(), "Boolean"),
    ];
    let own = TypeId::of::<K::Value>();
    names
        .iter()
        .find(|(id, _)| *id == own)
        .map_or("String", |(_, name)| name)
}
