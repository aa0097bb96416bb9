//! `fmi2GetString` and `fmi2SetString` (FMI 2.0, clause 2.1.7).

use std::ffi::CString as OwnedCString;

use super::entry::enter;
use super::pointers::{input, output, text};
use super::types::{CComponent, CString, CValueReference};
use super::values::{find, refresh_for};
use crate::component::{Component, StringOf};
use crate::instance::Instance;
use crate::life_cycle::Function;
use crate::model::Key;
use crate::refusal::Refusal;
use crate::status::Status;

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
