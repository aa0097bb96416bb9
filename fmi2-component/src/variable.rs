//! What `modelDescription.xml` says of a variable, as the build step found it (FMI 2.0, clause 2.2.7).

use std::fmt::{Debug, Display};

use crate::life_cycle::State;
use crate::refusal::Refusal;

/// Who determines the value of a variable.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Causality {
    /// Set by the master before or during initialization; a tunable one also between steps.
    Parameter,
    /// Follows from parameters.
    CalculatedParameter,
    /// Set by the master at any time between steps.
    Input,
    /// Computed by the component, for others to use.
    Output,
    /// Computed by the component, for its own use; may be read.
    Local,
    /// Time.
    Independent,
}

/// When the value of a variable may change.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Variability {
    /// Never.
    Constant,
    /// Not after initialization.
    Fixed,
    /// Between steps, at any time.
    Tunable,
    /// At events and communication points.
    Discrete,
    /// At any time.
    Continuous,
}

/// How the value at the start is found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Initial {
    /// It is the start value.
    Exact,
    /// The start value is a guess.
    Approx,
    /// It is computed from other variables.
    Calculated,
}

/// The word of the standard for a variant, for messages: its name with a small letter.
pub(crate) fn word(variant: impl Debug) -> String {
    let mut word = format!("{variant:?}");
    word[..1].make_ascii_lowercase();
    word
}

/// A variable whose values are of type `T`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Variable<T> {
    /// The structured name, for example `der(q1)`.
    pub name: &'static str,
    /// The number by which a master refers to it; unique among the variables of its type.
    pub value_reference: u32,
    /// Who determines its value.
    pub causality: Causality,
    /// When its value may change.
    pub variability: Variability,
    /// How its initial value is found; none for inputs and for time.
    pub initial: Option<Initial>,
    /// The start value, where there is one.
    pub start: Option<T>,
    /// The least value that makes sense. The shell does not enforce it.
    pub min: Option<T>,
    /// The largest value that makes sense. The shell does not enforce it.
    pub max: Option<T>,
    /// A typical magnitude, where the description gives one.
    pub nominal: Option<T>,
    /// The unit; none for a pure number.
    pub unit: Option<&'static str>,
    /// What an engineer should know of it.
    pub description: &'static str,
}

impl<T> Variable<T> {
    /// A refusal of `value` which names the variable, its unit and what is allowed.
    pub fn refuse(&self, value: impl Display, allowed: &str) -> Refusal {
        let unit = self.unit.map(|u| format!(" {u}")).unwrap_or_default();
        Refusal::error(format!(
            "{} = {value}{unit} is refused; allowed is {allowed}",
            self.name
        ))
    }

    /// Whether a master may set it while the component is being set up (FMI 2.0, clause 4.2.4, footnotes to the
    /// table of states): before initialization (`approx` guesses included), and in Initialization Mode.
    pub const fn settable_at_start(&self, in_initialization_mode: bool) -> bool {
        if matches!(self.variability, Variability::Constant) {
            return false;
        }
        match self.initial {
            Some(Initial::Exact) => true,
            Some(Initial::Approx) => !in_initialization_mode,
            Some(Initial::Calculated) => false,
            None => matches!(self.causality, Causality::Input),
        }
    }

    /// Whether a master may set it between steps: inputs and tunable parameters.
    pub const fn settable_between_steps(&self) -> bool {
        match self.causality {
            Causality::Input => true,
            Causality::Parameter => matches!(self.variability, Variability::Tunable),
            _ => false,
        }
    }

    /// Whether a master may set it while its integrator runs: continuous inputs.
    pub const fn settable_in_continuous_time(&self) -> bool {
        matches!(self.causality, Causality::Input) && matches!(self.variability, Variability::Continuous)
    }

    /// Whether a master may set it in `state`, among states in which setting is legal at all.
    #[inline]
    pub(crate) const fn settable_in(&self, state: State) -> bool {
        // A continuous input may be set in each of these states.
        self.settable_in_continuous_time()
            || match state {
                State::Instantiated => self.settable_at_start(false),
                State::InitializationMode => self.settable_at_start(true),
                State::ContinuousTimeMode => false,
                _ => self.settable_between_steps(),
            }
    }

    /// Whether its value is the component's to compute, not the master's to set.
    pub(crate) const fn computed(&self) -> bool {
        !matches!(self.causality, Causality::Parameter | Causality::Input)
    }
}
