//! Time derivatives of inputs and outputs (FMI 2.0, clause 4.2.1), directional derivatives (clause 2.1.9).

use std::ffi::c_int;

use super::entry::enter;
use super::pointers::{input, output};
use super::types::{CComponent, CValueReference};
use super::values::{find, refresh_for};
use crate::component::{BooleanOf, Component, IntegerOf, RealOf};
use crate::instance::Instance;
use crate::life_cycle::Function;
use crate::model::Key;
use crate::refusal::{Refusal, Status};
use crate::variable::Causality;

/// `fmi2SetRealInputDerivatives`.
pub unsafe fn set_real_input_derivatives<C: Component>(
    component: CComponent,
    references: *const CValueReference,
    count: usize,
    orders: *const c_int,
    values: *const f64,
) -> Status {
    let body = |instance: &mut Instance<C>| {
        // SAFETY: the arrays are as long as their count, by contract.
        let (references, orders, values) = unsafe {
            (
                input(references, count, "vr")?,
                input(orders, count, "order")?,
                input(values, count, "value")?,
            )
        };
        for ((&reference, &order), &value) in references.iter().zip(orders).zip(values) {
            let key = find::<RealOf<C>>(reference)?;
            check(key, order, Causality::Input, "an input")?;
            Instance::<C>::check_finite(key, value)?;
        }
        // All are set or none.
        let mut changed = instance.session.component.clone();
        for ((&reference, &order), &value) in references.iter().zip(orders).zip(values) {
            let (key, order) = (find(reference)?, order.unsigned_abs());
            changed.set_real_input_derivative(key, order, value, &instance.log)?;
        }
        instance.session.component = changed;
        instance.values_change();
        Ok(())
    };
    let function = Function::SetRealInputDerivatives;
    // SAFETY: the contract is passed on.
    unsafe { enter(component, function, "fmi2SetRealInputDerivatives", body) }
}

/// `fmi2GetRealOutputDerivatives`.
pub unsafe fn get_real_output_derivatives<C: Component>(
    component: CComponent,
    references: *const CValueReference,
    count: usize,
    orders: *const c_int,
    values: *mut f64,
) -> Status {
    let body = |instance: &mut Instance<C>| {
        // SAFETY: the arrays are as long as their count, by contract.
        let (references, orders, values) = unsafe {
            (
                input(references, count, "vr")?,
                input(orders, count, "order")?,
                output(values, count, "value")?,
            )
        };
        for ((&reference, &order), value) in references.iter().zip(orders).zip(values) {
            let key = find::<RealOf<C>>(reference)?;
            check(key, order, Causality::Output, "an output")?;
            let component = &instance.session.component;
            value.write(component.get_real_output_derivative(key, order.unsigned_abs())?);
        }
        Ok(())
    };
    let function = Function::GetRealOutputDerivatives;
    // SAFETY: the contract is passed on.
    unsafe { enter(component, function, "fmi2GetRealOutputDerivatives", body) }
}

/// `fmi2GetDirectionalDerivative`: the partial derivatives, summed up along the direction `dvKnown`.
pub unsafe fn get_directional_derivative<C: Component>(
    component: CComponent,
    unknowns: *const CValueReference,
    unknown_count: usize,
    knowns: *const CValueReference,
    known_count: usize,
    direction: *const f64,
    answer: *mut f64,
) -> Status {
    let body = |instance: &mut Instance<C>| {
        // SAFETY: the arrays are as long as their count, by contract.
        let (unknowns, knowns, direction, answer) = unsafe {
            (
                input(unknowns, unknown_count, "vUnknown_ref")?,
                input(knowns, known_count, "vKnown_ref")?,
                input(direction, known_count, "dvKnown")?,
                output(answer, unknown_count, "dvUnknown")?,
            )
        };
        if instance.session.stale {
            refresh_for::<C, RealOf<C>>(instance, unknowns)?;
        }
        for (&unknown, answer) in unknowns.iter().zip(answer) {
            if is_discrete::<C>(unknown) {
                for &known in knowns {
                    find::<RealOf<C>>(known)?;
                }
                answer.write(0.0);
                continue;
            }
            let unknown = find::<RealOf<C>>(unknown)?;
            let mut sum = 0.0;
            for (&known, &along) in knowns.iter().zip(direction) {
                let known = find::<RealOf<C>>(known)?;
                let component = &instance.session.component;
                sum += component.partial_derivative(unknown, known)? * along;
            }
            answer.write(sum);
        }
        Ok(())
    };
    let function = Function::GetDirectionalDerivative;
    // SAFETY: the contract is passed on.
    unsafe { enter(component, function, "fmi2GetDirectionalDerivative", body) }
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

fn check<K: Key>(key: K, order: c_int, causality: Causality, expected: &str) -> Result<(), Refusal> {
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
