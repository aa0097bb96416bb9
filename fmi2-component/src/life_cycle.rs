//! Which function may be called in which state, of both interfaces, as one table (FMI 2.0, clauses 3.2.3 and 4.2.4).

use std::fmt;

/// Which of the two interfaces an instance was made for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Interface {
    ModelExchange,
    CoSimulation,
}

impl Interface {
    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::ModelExchange => "model exchange",
            Self::CoSimulation => "co-simulation",
        }
    }
}

/// Declares the states, with the names that the standard gives them.
macro_rules! states {
    ($($state:ident $name:literal)*) => {
        /// A state of a component. The first two and the last three are in both interfaces.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        #[repr(u8)]
        pub(crate) enum State {
            $($state,)*
        }

        impl State {
            pub(crate) const ALL: &'static [Self] = &[$(Self::$state),*];

            pub(crate) const fn name(self) -> &'static str {
                match self {
                    $(Self::$state => $name,)*
                }
            }

            #[inline]
            const fn bit(self) -> u16 {
                1 << self as u8
            }
        }
    };
}

states! {
    Instantiated "instantiated"
    InitializationMode "Initialization Mode"
    EventMode "Event Mode"
    ContinuousTimeMode "Continuous-Time Mode"
    StepComplete "stepComplete"
    StepInProgress "stepInProgress"
    StepFailed "stepFailed"
    StepCanceled "stepCanceled"
    Terminated "terminated"
    Error "error"
    Fatal "fatal"
}

/// A set of states.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) struct States(u16);

impl States {
    const fn of(states: &[State]) -> Self {
        let mut bits = 0;
        let mut i = 0;
        while i < states.len() {
            bits |= states[i].bit();
            i += 1;
        }
        Self(bits)
    }

    #[inline]
    pub(crate) const fn contains(self, state: State) -> bool {
        self.0 & state.bit() != 0
    }
}

impl fmt::Display for States {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let names = State::ALL.iter().filter(|state| self.contains(**state));
        let names: Vec<_> = names.map(|state| state.name()).collect();
        f.write_str(&names.join(", "))
    }
}

/// Declares the functions, and with them the table.
macro_rules! functions {
    ($($(#[$note:meta])* $function:ident: $($state:ident)|*;)*) => {
        /// A group of C functions that are legal in the same states.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub(crate) enum Function {
            $($(#[$note])* $function,)*
        }

        impl Function {
            #[cfg(test)]
            pub(crate) const ALL: &'static [Self] = &[$(Self::$function),*];

            /// The states that it is legal in.
            #[inline]
            pub(crate) const fn legal_in(self) -> States {
                match self {
                    $(Self::$function => const { States::of(&[$(State::$state),*]) },)*
                }
            }

            #[cfg(test)]
            /// Its name without the prefix `fmi2`.
            pub(crate) const fn name(self) -> &'static str {
                match self {
                    $(Self::$function => stringify!($function),)*
                }
            }
        }
    };
}

functions! {
    SetDebugLogging: Instantiated | InitializationMode | EventMode | ContinuousTimeMode | StepComplete | StepInProgress | StepFailed | StepCanceled | Terminated | Error;
    SetupExperiment: Instantiated;
    EnterInitializationMode: Instantiated;
    ExitInitializationMode: InitializationMode;
    /// Which variables, their causality and variability decide.
    SetReal: Instantiated | InitializationMode | EventMode | ContinuousTimeMode | StepComplete;
    /// `fmi2SetInteger`, `Boolean` and `String`: none of them is continuous.
    SetDiscrete: Instantiated | InitializationMode | EventMode | StepComplete;
    /// `fmi2GetReal`, `Integer`, `Boolean` and `String`.
    GetValues: InitializationMode | EventMode | ContinuousTimeMode | StepComplete | StepFailed | StepCanceled | Terminated | Error;
    GetDirectionalDerivative: InitializationMode | EventMode | ContinuousTimeMode | StepComplete | StepFailed | StepCanceled | Terminated | Error;
    /// `fmi2GetFMUstate`, `Set` and `Free`; `fmi2SerializedFMUstateSize`, `Serialize` and `DeSerialize`.
    FMUstate: Instantiated | InitializationMode | EventMode | ContinuousTimeMode | StepComplete | StepFailed | StepCanceled | Terminated | Error;
    Terminate: EventMode | ContinuousTimeMode | StepComplete | StepFailed;
    Reset: Instantiated | InitializationMode | EventMode | ContinuousTimeMode | StepComplete | StepFailed | StepCanceled | Terminated | Error;
    SetRealInputDerivatives: Instantiated | InitializationMode | StepComplete;
    GetRealOutputDerivatives: StepComplete | StepFailed | StepCanceled | Terminated | Error;
    DoStep: StepComplete;
    CancelStep: StepInProgress;
    /// `fmi2GetStatus`, and `fmi2GetRealStatus`, `Integer`, `Boolean` and `String`.
    GetStatus: StepComplete | StepInProgress | StepFailed | Terminated;
    EnterEventMode: EventMode | ContinuousTimeMode;
    NewDiscreteStates: EventMode;
    EnterContinuousTimeMode: EventMode;
    CompletedIntegratorStep: ContinuousTimeMode;
    SetTime: EventMode | ContinuousTimeMode;
    SetContinuousStates: ContinuousTimeMode;
    /// `fmi2GetContinuousStates`, `fmi2GetDerivatives` and `fmi2GetEventIndicators`.
    GetEquations: InitializationMode | EventMode | ContinuousTimeMode | Terminated | Error;
    GetNominalsOfContinuousStates: Instantiated | InitializationMode | EventMode | ContinuousTimeMode | Terminated | Error;
}

impl Function {
    /// The interface that alone has it; none where both do.
    #[inline]
    pub(crate) const fn only_in(self) -> Option<Interface> {
        match self {
            Self::SetRealInputDerivatives
            | Self::GetRealOutputDerivatives
            | Self::DoStep
            | Self::CancelStep
            | Self::GetStatus => Some(Interface::CoSimulation),
            Self::EnterEventMode
            | Self::NewDiscreteStates
            | Self::EnterContinuousTimeMode
            | Self::CompletedIntegratorStep
            | Self::SetTime
            | Self::SetContinuousStates
            | Self::GetEquations
            | Self::GetNominalsOfContinuousStates => Some(Interface::ModelExchange),
            _ => None,
        }
    }

    /// Whether an instance for `interface` may be asked in `state`.
    #[inline]
    pub(crate) const fn legal(self, interface: Interface, state: State) -> bool {
        let there = match self.only_in() {
            None => true,
            Some(only) => only as u8 == interface as u8,
        };
        there && self.legal_in().contains(state)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The table as the crate's documentation shows it.
    fn rendered() -> String {
        let states: Vec<_> = State::ALL.iter().map(|state| state.name()).collect();
        let mut text = format!("| `fmi2…` | {} |\n", states.join(" | "));
        text += &format!("|---|{}\n", ":-:|".repeat(states.len()));
        for function in Function::ALL {
            let mark = |state: &State| if function.legal_in().contains(*state) { "x" } else { "" };
            let marks: Vec<_> = State::ALL.iter().map(mark).collect();
            text += &format!("| {} | {} |\n", function.name(), marks.join(" | "));
        }
        text
    }

    #[test]
    fn the_documentation_shows_this_table() {
        assert_eq!(include_str!("life_cycle.md"), rendered());
    }
}
