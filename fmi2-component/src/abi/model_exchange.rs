//! The names of model exchange, which some masters look up in every library (FMI 2.0, clause 3.2).

use super::entry::enter;
use super::types::CComponent;
use crate::component::Component;
use crate::instance::Instance;
use crate::life_cycle::Function;
use crate::status::Status;

/// Any function of model exchange: an error with a reason, since no state of co-simulation has it.
pub unsafe fn not_for_co_simulation<C: Component>(component: CComponent, name: &str) -> Status {
    let body = |_: &mut Instance<C>| Ok(());
    // SAFETY: the contract is passed on.
    unsafe { enter(component, Function::ModelExchange, name, body) }
}
