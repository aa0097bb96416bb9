//! The numerically controlled oscillator.

use crate::real::consts::TAU;

use crate::angle::Complex;
use crate::real::{Real, Sum};

/// Phase of the internal oscillator, in turns. Subtracting a whole turn is exact in binary arithmetic, so wrapping
/// causes no rounding error however long the run is.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Oscillator {
    turns: Sum,
}

impl Oscillator {
    /// `exp(i phase)`.
    pub fn rotor(self) -> Complex {
        Complex::of_turns(self.turns.get())
    }

    /// Advances by `omega` (rad/s) times `duration` (s), less than one turn. Returns whether a new period begins.
    pub fn advance(&mut self, omega: Real, duration: Real) -> bool {
        self.turns.add(omega * duration / TAU);
        let wrapped = self.turns.get() >= 1.0;
        if wrapped {
            self.turns.add(-1.0);
        }
        wrapped
    }
}

#[cfg(all(test, not(feature = "f32")))]
mod tests {
    use super::*;

    #[test]
    fn a_million_binary_steps_return_to_exactly_zero() {
        let mut oscillator = Oscillator::default();
        let step = TAU / 128.0;
        let wraps = (0..1 << 20).filter(|_| oscillator.advance(step, 1.0)).count();
        assert_eq!(wraps, 1 << 13);
        assert_eq!(oscillator.turns.get(), 0.0);
    }
}
