//! The functions of model exchange (FMI 2.0, clause 3.2).

use super::entry::enter;
use super::pointers::{input, output, place};
use super::types::{CBoolean, CComponent, EventInfo};
use crate::component::{Component, RealOf};
use crate::instance::Instance;
use crate::life_cycle::{Function, State};
use crate::model::Model;
use crate::model_exchange::ModelExchange;
use crate::refusal::{Refusal, Status};

/// Any function of model exchange, for a component without: an error with a reason.
pub unsafe fn not_for_co_simulation<C: Component>(component: CComponent, name: &str) -> Status {
    let body = |_: &mut Instance<C>| Ok(());
    // SAFETY: the contract is passed on.
    unsafe { enter(component, Function::EnterEventMode, name, body) }
}

/// `fmi2EnterEventMode`.
pub unsafe fn enter_event_mode<C: ModelExchange>(component: CComponent) -> Status {
    let body = |instance: &mut Instance<C>| {
        if instance.session.state != State::EventMode {
            instance.session.component.enter_event_mode();
            instance.session.state = State::EventMode;
        }
        Ok(())
    };
    // SAFETY: the contract is passed on.
    unsafe { enter(component, Function::EnterEventMode, "fmi2EnterEventMode", body) }
}

/// `fmi2NewDiscreteStates`.
pub unsafe fn new_discrete_states<C: ModelExchange>(component: CComponent, info: *mut EventInfo) -> Status {
    let body = |instance: &mut Instance<C>| {
        // SAFETY: NULL or one writable place, by contract.
        let place = unsafe { place(info, "fmi2eventInfo") }?;
        let session = &mut instance.session;
        let done = (session.component).new_discrete_states(session.time, &instance.log)?;
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
    let function = Function::NewDiscreteStates;
    // SAFETY: the contract is passed on.
    unsafe { enter(component, function, "fmi2NewDiscreteStates", body) }
}

/// `fmi2EnterContinuousTimeMode`.
pub unsafe fn enter_continuous_time_mode<C: ModelExchange>(component: CComponent) -> Status {
    let body = |instance: &mut Instance<C>| {
        instance.session.state = State::ContinuousTimeMode;
        Ok(())
    };
    let function = Function::EnterContinuousTimeMode;
    // SAFETY: the contract is passed on.
    unsafe { enter(component, function, "fmi2EnterContinuousTimeMode", body) }
}

/// `fmi2CompletedIntegratorStep`. The component never asks to end here.
pub unsafe fn completed_integrator_step<C: ModelExchange>(
    component: CComponent,
    event: *mut CBoolean,
    terminate: *mut CBoolean,
) -> Status {
    let body = |instance: &mut Instance<C>| {
        // SAFETY: NULL or one writable place each, by contract.
        let (event, terminate) = unsafe {
            (
                place(event, "enterEventMode")?,
                place(terminate, "terminateSimulation")?,
            )
        };
        event.write(instance.session.component.completed_step().into());
        terminate.write(0);
        Ok(())
    };
    let function = Function::CompletedIntegratorStep;
    // SAFETY: the contract is passed on.
    unsafe { enter(component, function, "fmi2CompletedIntegratorStep", body) }
}

/// `fmi2SetTime`.
pub unsafe fn set_time<C: ModelExchange>(component: CComponent, time: f64) -> Status {
    let body = |instance: &mut Instance<C>| {
        if !time.is_finite() {
            return Err(Refusal::error(format!(
                "time = {time} s is refused; allowed is a finite number"
            )));
        }
        instance.session.time = time;
        instance.session.component.set_time(time);
        Ok(())
    };
    // SAFETY: the contract is passed on.
    unsafe { enter(component, Function::SetTime, "fmi2SetTime", body) }
}

/// `fmi2SetContinuousStates`. An integrator whose trial step has led to infinity may try a shorter one.
pub unsafe fn set_continuous_states<C: ModelExchange>(
    component: CComponent,
    states: *const f64,
    count: usize,
) -> Status {
    let body = |instance: &mut Instance<C>| {
        let keys = <C::Model as Model>::STATES;
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
    let function = Function::SetContinuousStates;
    // SAFETY: the contract is passed on.
    unsafe { enter(component, function, "fmi2SetContinuousStates", body) }
}

/// Declares a function that answers one number for each of a list.
macro_rules! answers {
    ($function:ident, $c_name:literal, $legal:ident, $count:literal, $list:expr, $answer:expr) => {
        #[doc = concat!("`", $c_name, "`.")]
        pub unsafe fn $function<C: ModelExchange>(component: CComponent, values: *mut f64, count: usize) -> Status {
            let body = |instance: &mut Instance<C>| {
                let list = $list;
                counted($count, count, list.len())?;
                // SAFETY: the array is as long as its count, by contract.
                let places = unsafe { output(values, count, "the array") }?;
                instance.refresh()?;
                let component = &instance.session.component;
                for (item, place) in list.into_iter().zip(places) {
                    place.write($answer(component, item));
                }
                Ok(())
            };
            // SAFETY: the contract is passed on.
            unsafe { enter(component, Function::$legal, $c_name, body) }
        }
    };
}

answers!(
    get_continuous_states,
    "fmi2GetContinuousStates",
    GetEquations,
    "nx",
    <C::Model as Model>::STATES,
    |c: &C, key: &RealOf<C>| c.get_real(*key)
);
answers!(
    get_derivatives,
    "fmi2GetDerivatives",
    GetEquations,
    "nx",
    <C::Model as Model>::DERIVATIVES,
    |c: &C, key: &RealOf<C>| c.get_real(*key)
);
answers!(
    get_event_indicators,
    "fmi2GetEventIndicators",
    GetEquations,
    "ni",
    0..<C::Model as Model>::EVENT_INDICATORS,
    |c: &C, index| c.event_indicator(index)
);
answers!(
    get_nominals_of_continuous_states,
    "fmi2GetNominalsOfContinuousStates",
    GetNominalsOfContinuousStates,
    "nx",
    <C::Model as Model>::STATES,
    |c: &C, key: &RealOf<C>| c.nominal(*key)
);

fn counted(name: &str, count: usize, expected: usize) -> Result<(), Refusal> {
    if count == expected {
        return Ok(());
    }
    Err(Refusal::error(format!(
        "{name} = {count} is refused; expected {expected}"
    )))
}
