//! The second interface of a component: its equations, for the master's own integrator (FMI 2.0, clause 3).

use crate::component::{Component, RealOf};
use crate::log::Log;
use crate::model::Key;
use crate::refusal::Refusal;

/// A component whose equations a master can integrate by itself.
///
/// Which variables are states and derivatives, the description says in `ModelStructure`; the shell reads them by
/// [`Component::get_real`]. What is left is to set a state, to tell the event indicators, and what happens at an event.
pub trait ModelExchange: Component {
    /// Says that this instance is for model exchange; called right after [`Component::new`].
    fn select(&mut self);

    /// Sets a continuous state to a finite value.
    fn set_state(&mut self, state: RealOf<Self>, value: f64);

    /// The event indicator at `index`: an event happens where it goes from above 0 to 0 or below, or back.
    fn event_indicator(&self, index: usize) -> f64;

    /// Applies what happens at an event, the one at the start included; called until nothing more is to be done.
    ///
    /// # Errors
    /// An event after which the equations make no sense.
    fn new_discrete_states(&mut self, time: f64, log: &Log) -> Result<Discrete, Refusal>;

    /// Sets the time; for equations that contain it.
    fn set_time(&mut self, time: f64) {
        let _ = time;
    }

    /// Begins an event: inputs may jump from now on.
    fn enter_event_mode(&mut self) {}

    /// Called when the integrator has completed a step. Returns whether an event must be handled now, even if no indicator has
    /// shown it.
    fn completed_step(&mut self) -> bool {
        false
    }

    /// A typical magnitude of a state, above 0; by default the description's `nominal`, or 1.
    fn nominal(&self, state: RealOf<Self>) -> f64 {
        state.variable().nominal.unwrap_or(1.0)
    }
}

/// What an event has led to.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Discrete {
    /// The event is not over: another call is needed.
    pub again: bool,
    /// The simulation is to be ended.
    pub terminate: bool,
    /// States have jumped.
    pub states_changed: bool,
    /// Nominal values have changed.
    pub nominals_changed: bool,
    /// When the next event is due by the clock, if one is.
    pub next_event_time: Option<f64>,
}
