//! From set-up to termination (FMI 2.0, clauses 2.1.6 and 4.2.2).

use super::entry::enter;
use super::types::{CBoolean, CComponent};
use crate::component::Component;
use crate::instance::Instance;
use crate::life_cycle::{Function, State};
use crate::refusal::Status;

/// `fmi2SetupExperiment`. The tolerance is checked and not used: what a component cannot do exactly it decides for itself.
pub unsafe fn setup_experiment<C: Component>(
    component: CComponent,
    tolerance_defined: CBoolean,
    tolerance: f64,
    start_time: f64,
    stop_time_defined: CBoolean,
    stop_time: f64,
) -> Status {
    let stop_time = (stop_time_defined != 0).then_some(stop_time);
    let tolerance = (tolerance_defined != 0).then_some(tolerance);
    let body = |instance: &mut Instance<C>| instance.set_up(tolerance, start_time, stop_time);
    let function = Function::SetupExperiment;
    // SAFETY: the contract is passed on.
    unsafe { enter(component, function, "fmi2SetupExperiment", body) }
}

/// `fmi2EnterInitializationMode`.
pub unsafe fn enter_initialization_mode<C: Component>(component: CComponent) -> Status {
    let body = |instance: &mut Instance<C>| {
        instance.session.state = State::InitializationMode;
        Ok(())
    };
    let function = Function::EnterInitializationMode;
    // SAFETY: the contract is passed on.
    unsafe { enter(component, function, "fmi2EnterInitializationMode", body) }
}

/// `fmi2ExitInitializationMode`.
pub unsafe fn exit_initialization_mode<C: Component>(component: CComponent) -> Status {
    let body = |instance: &mut Instance<C>| instance.leave_initialization();
    let function = Function::ExitInitializationMode;
    // SAFETY: the contract is passed on.
    unsafe { enter(component, function, "fmi2ExitInitializationMode", body) }
}

/// `fmi2Terminate`.
pub unsafe fn terminate<C: Component>(component: CComponent) -> Status {
    let body = |instance: &mut Instance<C>| {
        instance.session.state = State::Terminated;
        Ok(())
    };
    // SAFETY: the contract is passed on.
    unsafe { enter(component, Function::Terminate, "fmi2Terminate", body) }
}

/// `fmi2Reset`: the instance is as if instantiated anew; its FMU states and log categories are kept.
pub unsafe fn reset<C: Component>(component: CComponent) -> Status {
    let body = |instance: &mut Instance<C>| instance.reset();
    // SAFETY: the contract is passed on.
    unsafe { enter(component, Function::Reset, "fmi2Reset", body) }
}

/// `fmi2DoStep`. Whether the master may come back to an earlier point makes no difference here.
#[inline]
pub unsafe fn do_step<C: Component>(component: CComponent, time: f64, step: f64) -> Status {
    let body = |instance: &mut Instance<C>| instance.do_step(time, step);
    // SAFETY: the contract is passed on.
    unsafe { enter(component, Function::DoStep, "fmi2DoStep", body) }
}

/// `fmi2CancelStep`: never legal, since no step continues in the background.
pub unsafe fn cancel_step<C: Component>(component: CComponent) -> Status {
    let body = |_: &mut Instance<C>| Ok(());
    // SAFETY: the contract is passed on.
    unsafe { enter(component, Function::CancelStep, "fmi2CancelStep", body) }
}
