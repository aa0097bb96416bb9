//! When a variable may be set, worked out at compile time: one byte each, so that a call need not look at attributes.

use crate::life_cycle::State;
use crate::variable::{Causality, Variable};

/// A set of occasions.
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
