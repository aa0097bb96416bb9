//! The numerically controlled oscillator, and the complex numbers of its rotor.

use crate::real::consts::TAU;
use crate::real::{self, Real, Sum};

/// A complex number. A rotor is `exp(i phase)`.
///
/// Not `num-complex`: whether that takes `hypot` and `atan2` from libm or from the system depends on the features that
/// other crates of the same build enable, and the controller must give the same bits in every build.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Complex {
    pub re: Real,
    pub im: Real,
}

impl Complex {
    /// `exp(i angle)`, angle in rad.
    pub fn unit(angle: Real) -> Self {
        let (im, re) = real::sincos(angle);
        Self { re, im }
    }

    /// `exp(2 pi i turns)` for a few turns. The angle within its quarter of a turn is exact, so no reduction modulo pi/2 is needed.
    pub fn of_turns(turns: Real) -> Self {
        let quarter = real::rint(4.0 * turns);
        let Self { re, im } = Self::unit(TAU * (turns - 0.25 * quarter));
        match quarter as i32 & 3 {
            0 => Self { re, im },
            1 => Self { re: -im, im: re },
            2 => Self { re: -re, im: -im },
            _ => Self { re: im, im: -re },
        }
    }

    pub fn times(self, other: Self) -> Self {
        Self {
            re: self.re * other.re - self.im * other.im,
            im: self.re * other.im + self.im * other.re,
        }
    }

    pub fn conjugate(self) -> Self {
        Self { re: self.re, im: -self.im }
    }

    /// The length; the parts are those of readings, whose squares cause no overflow.
    pub fn magnitude(self) -> Real {
        real::sqrt(self.re * self.re + self.im * self.im)
    }

    pub fn argument(self) -> Real {
        real::atan2(self.im, self.re)
    }
}

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
mod tests;
