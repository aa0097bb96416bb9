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
pub struct PhaseAccumulator {
    turns: Sum,
}

impl PhaseAccumulator {
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

#[cfg(test)]
#[cfg(not(feature = "f32"))]
mod tests {
    use super::*;

    #[test]
    fn a_million_binary_steps_return_to_exactly_zero() {
        let mut oscillator = PhaseAccumulator::default();
        let step = TAU / 128.0;
        let wraps = (0..1 << 20).filter(|_| oscillator.advance(step, 1.0)).count();
        assert_eq!(wraps, 1 << 13);
        assert_eq!(oscillator.turns.get(), 0.0);
    }

    #[test]
    fn the_rotor_of_a_turn_has_the_sine_and_cosine_of_its_angle() {
        for n in -100_000..300_000 {
            let turns = f64::from(n) / 100_003.0;
            let (sin, cos) = libm::sincos(TAU * turns);
            let Complex { re, im } = Complex::of_turns(turns);
            // The rounded angle alone is wrong by half a unit in its last place.
            let tolerance = f64::EPSILON * (TAU * turns).abs().max(1.0);
            assert!(
                (re - cos).abs() <= tolerance && (im - sin).abs() <= tolerance,
                "{turns}"
            );
        }
    }

    #[test]
    fn the_rotor_of_a_quarter_turn_is_exact() {
        for (turns, re, im) in [
            (0.0, 1.0, 0.0),
            (0.25, 0.0, 1.0),
            (0.5, -1.0, 0.0),
            (0.75, 0.0, -1.0),
            (1.0, 1.0, 0.0),
        ] {
            assert_eq!(Complex::of_turns(turns), Complex { re, im }, "{turns}");
        }
    }
}
