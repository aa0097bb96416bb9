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

    /// Whether its value is the component's to compute, not the master's to set.
    pub(crate) const fn computed(&self) -> bool {
        !matches!(self.causality, Causality::Parameter | Causality::Input)
    }
}

/// When a variable may be set, a set of occasions: worked out at compile time, so that a call need not look at attributes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Occasions(u8);

const SET_UP: u8 = 1;
const INITIALIZATION: u8 = 2;
const BETWEEN_STEPS: u8 = 4;
const CONTINUOUS_TIME: u8 = 8;
/// Not an occasion: the variable is an input.
const INPUT: u8 = 16;

impl Occasions {
    /// Those of each of `N` variables.
    pub const fn table<T, const N: usize>(variables: &[Variable<T>]) -> [Self; N] {
        let mut table = [Self(0); N];
        let mut i = 0;
        while i < N {
            table[i] = Self::of(&variables[i]);
            i += 1;
        }
        table
    }

    const fn of<T>(variable: &Variable<T>) -> Self {
        let mut bits = 0;
        if variable.settable_at_start(false) {
            bits |= SET_UP;
        }
        if variable.settable_at_start(true) {
            bits |= INITIALIZATION;
        }
        if variable.settable_between_steps() {
            bits |= BETWEEN_STEPS;
        }
        if variable.settable_in_continuous_time() {
            bits |= CONTINUOUS_TIME;
        }
        if matches!(variable.causality, Causality::Input) {
            bits |= INPUT;
        }
        Self(bits)
    }

    /// The one that `state` is, among states in which setting is legal at all.
    pub(crate) const fn now(state: State) -> Self {
        Self(match state {
            State::Instantiated => SET_UP,
            State::InitializationMode => INITIALIZATION,
            State::ContinuousTimeMode => CONTINUOUS_TIME,
            _ => BETWEEN_STEPS,
        })
    }

    /// All that there are.
    pub(crate) const ALL: Self = Self(u8::MAX);

    /// What both have in common.
    #[inline]
    pub(crate) const fn and(self, other: Self) -> Self {
        Self(self.0 & other.0)
    }

    /// Whether both have one in common.
    pub(crate) const fn meets(self, other: Self) -> bool {
        self.0 & other.0 != 0
    }

    pub(crate) const fn is_input(self) -> bool {
        self.0 & INPUT != 0
    }
}
