//! The traits: what the build step generates ([`Model`], [`Key`]), what a component implements ([`Component`]), and its second
//! interface, for the master's own integrator ([`ModelExchange`]; FMI 2.0, clause 3).

use std::ops::Range;

use crate::archive::Archive;
use crate::log::Log;
use crate::refusal::Refusal;
use crate::resources::Resources;
use crate::variable::Variable;

/// A model's identity and its variables; implemented by the generated type `Model`.
pub trait Model: 'static {
    /// `modelName`.
    const NAME: &'static str;
    /// `modelIdentifier`: the name of the FMU and of the library in it.
    const IDENTIFIER: &'static str;
    /// Derived from the variable table: a library meets only the description that it was built with, unless it adopts another model.
    const GUID: &'static str;
    /// The version of the model; a serialised state of another one is refused.
    const VERSION: &'static str;
    /// The continuous states, in the order of the description's list of derivatives.
    const STATES: &'static [Self::Real];
    /// Their derivatives, in the same order.
    const DERIVATIVES: &'static [Self::Real];
    /// `numberOfEventIndicators`.
    const EVENT_INDICATORS: usize;
    /// The names of the log categories.
    const CATEGORIES: &'static [&'static str];
    /// The variables that hold a real number.
    type Real: Key<Value = f64>;
    /// The variables that hold an integer or an enumeration.
    type Integer: Key<Value = i32>;
    /// The Boolean variables.
    type Boolean: Key<Value = bool>;
    /// The variables that hold text.
    type String: Key<Value = &'static str>;
}

/// A variable of one type as a Rust enum, one variant each; generated.
pub trait Key: Copy + 'static {
    /// What start values are made of.
    type Value: 'static;
    /// The table, in the order of the variants.
    const VARIABLES: &'static [Variable<Self::Value>];
    /// All of them, in the same order.
    const ALL: &'static [Self];

    /// The variable with that value reference.
    fn find(value_reference: u32) -> Option<Self>;

    /// Its place in the table.
    fn index(self) -> usize;

    /// What the description says of it.
    fn variable(self) -> &'static Variable<Self::Value> {
        &Self::VARIABLES[self.index()]
    }
}

/// Whether a master may ever set one of `variables`.
pub(crate) const fn any_settable<T>(variables: &[Variable<T>]) -> bool {
    let mut i = 0;
    while i < variables.len() {
        if variables[i].settable_at_start(false) || variables[i].settable_between_steps() {
            return true;
        }
        i += 1;
    }
    false
}

/// The real variables of component `C`.
pub type RealOf<C> = <<C as Component>::Model as Model>::Real;
/// The integer variables of component `C`.
pub type IntegerOf<C> = <<C as Component>::Model as Model>::Integer;
/// The Boolean variables of component `C`.
pub type BooleanOf<C> = <<C as Component>::Model as Model>::Boolean;
/// The string variables of component `C`.
pub type StringOf<C> = <<C as Component>::Model as Model>::String;

/// A component: values to set, values to get, a start and a step. The shell does the rest.
///
/// Life cycle, NULL pointers, value references, NaN and infinity are handled before the component is called.
/// A component that panics ends in the state *fatal*; the panic does not leave the call.
///
/// Getters and setters of a type that the model has variables of must be written; leaving one out does not compile.
pub trait Component: Clone + Send + 'static {
    /// The type `Model` that the build step generates.
    type Model: Model;

    /// Whether the setters take every finite value of an input. The shell then makes no copy of the component, by
    /// which it undoes a call with a later value that is refused; for components in a fast loop.
    const TAKES_EVERY_INPUT: bool = false;

    /// A component without any start value: the shell sets those of the variable table right after, by the setters.
    fn new() -> Self;

    /// Makes this component, which has the start values of the table, one of another model: that of the description with this GUID,
    /// which was written together with the resources. Called once, where the master's GUID is not [`Model::GUID`]; what it has
    /// become is what a reset leads back to. Such a model is for co-simulation. Its description has variables of the table, with
    /// the table's value references, and the outputs of [`Component::further`].
    ///
    /// # Errors
    /// A GUID that belongs to no model of this library, and resources that are missing or damaged.
    fn adopt(&mut self, guid: &str, resources: &Resources) -> Result<(), Refusal> {
        let _ = resources;
        Err(foreign::<Self::Model>(guid))
    }

    /// The value references of real outputs that are not in the table, of an adopted model.
    fn further(&self) -> Range<u32> {
        0..0
    }

    /// The value of one of [`Component::further`].
    fn get_further(&self, reference: u32) -> f64 {
        unreachable!("the component has no output with the value reference {reference}")
    }

    /// The value of a real variable.
    fn get_real(&self, variable: RealOf<Self>) -> f64 {
        const { must_be_absent::<RealOf<Self>>() };
        unreachable!("no real variable has index {}", variable.index())
    }

    /// The value of an integer variable.
    fn get_integer(&self, variable: IntegerOf<Self>) -> i32 {
        const { must_be_absent::<IntegerOf<Self>>() };
        unreachable!("no integer variable has index {}", variable.index())
    }

    /// The value of a Boolean variable.
    fn get_boolean(&self, variable: BooleanOf<Self>) -> bool {
        const { must_be_absent::<BooleanOf<Self>>() };
        unreachable!("no Boolean variable has index {}", variable.index())
    }

    /// The value of a string variable.
    fn get_string(&self, variable: StringOf<Self>) -> &str {
        const { must_be_absent::<StringOf<Self>>() };
        unreachable!("no string variable has index {}", variable.index())
    }

    /// Sets a real variable to a finite value. Called only for variables that may be set in the present state.
    ///
    /// Where one of several values set by one call is refused, none of them counts: the shell goes back to a copy of the
    /// component made before.
    ///
    /// # Errors
    /// A value that makes no sense whatever the others are; values that depend on each other are checked in
    /// [`Component::initialise`].
    fn set_real(&mut self, variable: RealOf<Self>, value: f64) -> Result<(), Refusal> {
        const { must_not_be_settable::<RealOf<Self>>() };
        Err(variable.variable().refuse(value, "no value at all"))
    }

    /// Sets an integer variable.
    ///
    /// # Errors
    /// As for [`Component::set_real`].
    fn set_integer(&mut self, variable: IntegerOf<Self>, value: i32) -> Result<(), Refusal> {
        const { must_not_be_settable::<IntegerOf<Self>>() };
        Err(variable.variable().refuse(value, "no value at all"))
    }

    /// Sets a Boolean variable.
    ///
    /// # Errors
    /// As for [`Component::set_real`].
    fn set_boolean(&mut self, variable: BooleanOf<Self>, value: bool) -> Result<(), Refusal> {
        const { must_not_be_settable::<BooleanOf<Self>>() };
        Err(variable.variable().refuse(value, "no value at all"))
    }

    /// Sets a string variable.
    ///
    /// # Errors
    /// As for [`Component::set_real`].
    fn set_string(&mut self, variable: StringOf<Self>, value: &str) -> Result<(), Refusal> {
        const { must_not_be_settable::<StringOf<Self>>() };
        Err(variable.variable().refuse(value, "no value at all"))
    }

    /// Makes the initial state from the values that have been set, and refuses values that do not fit together.
    ///
    /// Called on leaving Initialization Mode, and in it before an output is read after something was set. It may thus
    /// be called many times, and must start each time from the values set, not from where an earlier call has led.
    ///
    /// # Errors
    /// Values that make no sense. The component stays in Initialization Mode.
    fn initialise(&mut self, start_time: f64, log: &Log) -> Result<(), Refusal>;

    /// Says that Initialization Mode has been left: from now on only what the standard calls known may change. Called once,
    /// after the last [`Component::initialise`].
    fn leave_initialization(&mut self) {}

    /// Whether a step of that length (finite, above 0) can be done at all. Asked before every step.
    ///
    /// # Errors
    /// A step that would not end. Nothing changes then, and the master may make a shorter one.
    fn accept_step(&self, step: f64) -> Result<(), Refusal> {
        let _ = step;
        Ok(())
    }

    /// Advances from `time` by `step` seconds, which is finite and above 0. Inputs are as set before the step.
    ///
    /// # Errors
    /// [`Refusal::discard`] where the step cannot be done and the component is as it was before; the master learns
    /// that the component wants to end. [`Refusal::error`] where the simulation can continue only after a reset.
    fn step(&mut self, time: f64, step: f64, log: &Log) -> Result<(), Refusal>;

    /// Sets the time derivative of that order (1 or above) of a real input, as it is at the start of the next step.
    ///
    /// # Errors
    /// Orders that the component does not use; by default all.
    fn set_real_input_derivative(
        &mut self,
        variable: RealOf<Self>,
        order: u32,
        value: f64,
        log: &Log,
    ) -> Result<(), Refusal> {
        let _ = (value, log);
        Err(Refusal::error(format!(
            "derivative {order} of {} is refused; the component takes no input derivatives",
            variable.variable().name
        )))
    }

    /// The time derivative of that order (1 or above) of a real output at the end of the last step.
    ///
    /// # Errors
    /// Orders that the component does not know; by default all.
    fn get_real_output_derivative(&self, variable: RealOf<Self>, order: u32) -> Result<f64, Refusal> {
        Err(Refusal::error(format!(
            "derivative {order} of {} is not known; the component has no output derivatives",
            variable.variable().name
        )))
    }

    /// The partial derivative of `unknown` by `known`; the shell sums them up along the direction asked for. Discrete outputs
    /// are not asked for: between events they have no slope.
    ///
    /// # Errors
    /// Pairs that the component has no derivative of; by default all.
    fn partial_derivative(&self, unknown: RealOf<Self>, known: RealOf<Self>) -> Result<f64, Refusal> {
        Err(Refusal::error(format!(
            "the derivative of {} by {} is not known; the component has no directional derivatives",
            unknown.variable().name,
            known.variable().name
        )))
    }

    /// Writes the whole component to `archive`, or reads it from there; where the component derives serde's traits, by
    /// `archive.whole(self)`.
    ///
    /// # Errors
    /// Invalid contents; by default always, because a component need not use serde.
    fn archive(&mut self, archive: &mut Archive<'_>) -> Result<(), Refusal> {
        let _ = archive;
        Err(Refusal::error("the component cannot be serialised"))
    }
}

/// Refusal of a GUID that is not the library's.
pub fn foreign<M: Model>(guid: &str) -> Refusal {
    Refusal::error(format!(
        "fmuGUID is {guid}, but the library of {} was built with {}: modelDescription.xml and library do not belong together",
        M::IDENTIFIER,
        M::GUID
    ))
}

const fn must_be_absent<K: Key>() {
    assert!(
        K::VARIABLES.is_empty(),
        "the model has variables of a type that the component writes no getter for"
    );
}

const fn must_not_be_settable<K: Key>() {
    assert!(
        !any_settable(K::VARIABLES),
        "the model has settable variables of a type that the component writes no setter for"
    );
}

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
