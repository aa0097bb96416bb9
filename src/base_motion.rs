//! The motion of the base: a sampled signal plus a built-in oscillator.
//!
//! `e(t) = u0 + u1 t + u2 t² + u3 t³ + E sin(phase + omega t)`, with `t` counted from now. The phase is carried
//! instead of absolute time, so that a run of any length costs no accuracy.

use crate::lane::Lane;
use serde::{Deserialize, Serialize};

/// 2π split in two: the nearest double, and what it misses.
const TAU: (f64, f64) = (core::f64::consts::TAU, 2.449_293_598_294_706_5e-16);

/// What drives the base during one communication step: held until it is changed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Drive {
    /// Coefficients of the displacement signal, m, m/s, m/s², m/s³ (a polynomial in the time since the step began;
    /// an input of derivatives d1, d2, d3 gives `[e, d1, d2/2, d3/6]`).
    pub signal: [f64; 4],
    /// Amplitude `E` of the built-in oscillator, m.
    pub amplitude: f64,
    /// Frequency `omega` of the built-in oscillator, rad/s.
    pub omega: f64,
}

impl Drive {
    /// A harmonic base motion from the built-in oscillator alone.
    pub fn harmonic(amplitude: f64, omega: f64) -> Self {
        Self {
            amplitude,
            omega,
            ..Self::default()
        }
    }

    /// A base displacement held at `displacement`, m.
    pub fn held(displacement: f64) -> Self {
        Self {
            signal: [displacement, 0.0, 0.0, 0.0],
            ..Self::default()
        }
    }

    /// Whether every value is a finite number.
    pub fn is_finite(&self) -> bool {
        self.signal.iter().all(|c| c.is_finite())
            && self.amplitude.is_finite()
            && self.omega.is_finite()
    }
}

/// A drive and the phase its oscillator has reached.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct BaseMotion {
    /// What drives the base; the signal's time is counted from now.
    pub drive: Drive,
    /// Phase of the oscillator.
    pub phase: Phase,
}

impl BaseMotion {
    /// Base displacement now, m.
    pub fn displacement(&self) -> f64 {
        let oscillator = if self.drive.amplitude == 0.0 {
            0.0
        } else {
            self.drive.amplitude * libm::sin(self.phase.0)
        };
        self.drive.signal[0] + oscillator
    }

    /// The motion from now on under another drive, its phase going on.
    pub fn with(&self, drive: Drive) -> Self {
        Self { drive, ..*self }
    }

    /// The same motion seen from `t` seconds later.
    pub fn after(&self, t: f64) -> Self {
        Self {
            drive: Drive {
                signal: shift(self.drive.signal, t),
                ..self.drive
            },
            phase: self.phase.advanced(self.drive.omega, t),
        }
    }
}

/// A phase in [0, 2π), rad, and what rounding has kept out of it.
///
/// Without the second part the rounding of equal steps adds up in one direction (1e-10 rad after a million of them).
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Phase(f64, f64);

impl Phase {
    /// The phase, rad, in [0, 2π).
    pub fn radians(self) -> f64 {
        let sum = self.0 + self.1;
        // At the seam the small part may carry it across.
        if sum < 0.0 {
            0.0
        } else if sum >= TAU.0 {
            sum - TAU.0
        } else {
            sum
        }
    }

    /// The phase and what rounding has kept out of it.
    pub(crate) fn parts(self) -> (f64, f64) {
        (self.0, self.1)
    }

    /// The phase of these parts.
    pub(crate) fn of_parts(parts: (f64, f64)) -> Self {
        Self(parts.0, parts.1)
    }

    /// The phase after a turn by `angle` (reduced to one turn, and what rounding has kept out of it) and a little more.
    #[inline]
    pub(crate) fn turned(self, angle: (f64, f64), more: f64) -> Self {
        Self::of_parts(turned(self.parts(), angle, more))
    }

    /// The phase `t` seconds later at `omega`, brought back to [0, 2π) without losing digits to the number of turns.
    pub fn advanced(self, omega: f64, t: f64) -> Self {
        let (turned, turned_missed) = product(omega, t);
        let (sum, sum_missed) = two_sum(turned, self.0);
        let turns = libm::floor(sum / TAU.0);
        let mut missed = self.1 + turned_missed + sum_missed;
        let mut rest = sum;
        if turns != 0.0 {
            let (whole, whole_missed) = product(turns, TAU.0);
            // The two are close, so that their difference is exact (Sterbenz) but for many turns, where it is nearly so.
            rest = sum - whole;
            missed -= whole_missed + turns * TAU.1;
        }
        let (mut rest, mut missed) = two_sum(rest, missed);
        if rest < 0.0 || rest >= TAU.0 {
            // The quotient was a last digit off: one turn more or less.
            let turn = if rest < 0.0 { 1.0 } else { -1.0 };
            let (turned, lost) = two_sum(rest, turn * TAU.0);
            (rest, missed) = two_sum(turned, missed + lost + turn * TAU.1);
            // -1e-17 + 2π rounds to 2π itself, which is 0.
            if !(0.0..TAU.0).contains(&rest) {
                (rest, missed) = (0.0, 0.0);
            }
        }
        Self(rest, missed)
    }
}

/// The polynomial's coefficients about `t` instead of 0.
fn shift([u0, u1, u2, u3]: [f64; 4], t: f64) -> [f64; 4] {
    if u1 == 0.0 && u2 == 0.0 && u3 == 0.0 {
        return [u0, 0.0, 0.0, 0.0];
    }
    [
        u0 + t * (u1 + t * (u2 + t * u3)),
        u1 + t * (2.0 * u2 + t * 3.0 * u3),
        u2 + 3.0 * t * u3,
        u3,
    ]
}

/// [`Phase::turned`] for the parts of a phase, or of several abreast.
#[inline(always)]
pub(crate) fn turned<T: Lane>(phase: (T, T), angle: (T, T), more: T) -> (T, T) {
    let turn = angle.0 + more;
    let (sum, missed) = two_sum(phase.0, turn);
    let missed = missed + (phase.1 + angle.1 + (more - (turn - angle.0)));
    // `more` is small: a turn of less than none, or of more than two, is not to be had.
    let around = sum.below(T::splat(TAU.0));
    (
        T::choose(around, sum, sum - T::splat(TAU.0)),
        T::choose(around, missed, missed - T::splat(TAU.1)),
    )
}

/// `a + b` as a rounded sum and its rounding error (Knuth).
#[inline(always)]
pub(crate) fn two_sum<T: Lane>(a: T, b: T) -> (T, T) {
    let sum = a + b;
    let part = sum - a;
    (sum, (a - (sum - part)) + (b - part))
}

/// The leading half of the digits, and the rest (Veltkamp).
pub(crate) fn halves(x: f64) -> (f64, f64) {
    let scaled = 134_217_729.0 * x; // 2^27 + 1
    let high = scaled - (scaled - x);
    (high, x - high)
}

/// A coefficient that is used again and again, given with what rounding has kept out of it, in two parts: the product with
/// both has no error that is the same every time.
///
/// Added to a product that has been rounded already, so small a number as the rounding error would be lost at every turn.
/// The first part is short, so that the second is large enough to count.
pub(crate) fn evenly(coefficient: f64, missed: f64) -> (f64, f64) {
    let (head, rest) = halves(coefficient);
    if head.is_finite() {
        (head, rest + missed)
    } else {
        // Beyond 1e300 the splitting overflows.
        (coefficient, 0.0)
    }
}

/// `a b` as a rounded product and its rounding error (Dekker, with Veltkamp's splitting: no FMA instruction needed).
pub(crate) fn product(a: f64, b: f64) -> (f64, f64) {
    let rounded = a * b;
    let ((a1, a2), (b1, b2)) = (halves(a), halves(b));
    let error = ((a1 * b1 - rounded) + a1 * b2 + a2 * b1) + a2 * b2;
    // Beyond 1e300 the splitting overflows; the rounding of such a product is nobody's concern.
    (rounded, if error.is_finite() { error } else { 0.0 })
}

/// Sine and cosine of `omega t`, exact to the last digits even after millions of turns; `omega` is a frequency and what
/// rounding has kept out of it.
pub(crate) fn sincos_of_product((omega, omega_missed): (f64, f64), t: f64) -> (f64, f64) {
    let (angle, missed) = product(omega, t);
    let missed = missed + omega_missed * t;
    let (sin, cos) = libm::sincos(angle);
    (sin + missed * cos, cos - missed * sin)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_phase_stays_within_one_turn_whatever_the_step() {
        for omega in [-7.0, -1e-20, 0.0, 1e-20, 0.3, 55.0, 1e9] {
            for t in [1e-12, 0.1, 1.0, 1e3, 1e6] {
                let base = BaseMotion {
                    drive: Drive::harmonic(1.0, omega),
                    phase: Phase::default(),
                };
                let phase = base.after(t).phase.radians();
                assert!((0.0..TAU.0).contains(&phase), "{omega} {t}: {phase}");
            }
        }
    }

    #[test]
    fn a_million_turns_in_one_step_and_in_a_million_agree() {
        // 2^-4 is exact, so that both runs mean the same instants.
        let drive = Drive::harmonic(1.0, 1.000_1);
        let one = BaseMotion {
            drive,
            phase: Phase(0.5, 0.0),
        }
        .after(62_500.0);
        let mut many = BaseMotion {
            drive,
            phase: Phase(0.5, 0.0),
        };
        for _ in 0..1_000_000 {
            many = many.after(0.062_5);
        }
        let difference = libm::remainder(one.phase.radians() - many.phase.radians(), TAU.0);
        assert!(difference.abs() < 1e-12, "{difference:e}");
    }

    #[test]
    fn the_signal_seen_later_is_the_same_signal() {
        let base = BaseMotion {
            drive: Drive {
                signal: [1.0, -2.0, 0.5, 0.25],
                ..Drive::default()
            },
            phase: Phase::default(),
        };
        let direct = base.after(1.5).displacement();
        let in_two = base.after(0.7).after(0.8).displacement();
        assert!((direct - (1.0 - 3.0 + 0.5 * 2.25 + 0.25 * 3.375)).abs() < 1e-15);
        assert!((direct - in_two).abs() < 1e-15);
    }
}
