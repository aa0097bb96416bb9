//! The trait that a component implements.

use crate::archive::Archive;
use crate::log::Log;
use crate::model::{Key, Model, any_settable};
use crate::refusal::Refusal;

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
