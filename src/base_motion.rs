//! The motion of the base: a sampled signal plus a built-in oscillator.
//!
//! `e(t) = u0 + u1 t + u2 t² + u3 t³ + E sin(phase + omega t)`, with `t` counted from now. The phase is carried
//! instead of absolute time, so that a run of any length costs no accuracy.

use crate::arithmetic::{Sum, plus, product};
use crate::parameters::{FASTEST, InvalidValue};

/// 2π as the nearest double and its rounding error.
const TAU: (f64, f64) = (core::f64::consts::TAU, 2.449_293_598_294_706_5e-16);

const ALLOWED: &str = "a finite number from -1e100 to 1e100";

/// What drives the base during one communication step: held until it is changed.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
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
    /// Largest coefficient, in SI units.
    pub const LARGEST: f64 = 1e100;
    /// Highest frequency of the oscillator, rad/s.
    pub const FASTEST: f64 = FASTEST;

    /// A harmonic base motion from the built-in oscillator alone.
    #[inline]
    pub fn harmonic(amplitude: f64, omega: f64) -> Self {
        Self { amplitude, omega, ..Self::default() }
    }

    /// A base displacement held at `displacement`, m.
    pub fn held(displacement: f64) -> Self {
        Self { signal: [displacement, 0.0, 0.0, 0.0], ..Self::default() }
    }

    /// Whether the signal is a straight line.
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    pub(crate) fn is_straight(&self) -> bool {
        let [.., u2, u3] = self.signal.map(f64::to_bits);
        (u2 | u3) << 1 == 0
    }

    /// Whether the signal is constant.
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    pub fn is_held(&self) -> bool {
        let [_, u1, u2, u3] = self.signal.map(f64::to_bits);
        (u1 | u2 | u3) << 1 == 0
    }

    /// A step of `duration` seconds under this drive as equal steps of at most `longest` seconds, but for rounding: drive and length of each.
    /// The phase of the oscillator continues from step to step.
    pub fn parts(self, duration: f64, longest: f64) -> impl Iterator<Item = (Self, f64)> {
        let count = (duration / longest * (1.0 - 1e-9)).ceil().max(1.0);
        let part = duration / count;
        (0..count as u64).map(move |n| {
            let begin = n as f64 * part;
            (Self { signal: shift(self.signal, begin), ..self }, part)
        })
    }

    /// Checks every value.
    ///
    /// # Errors
    /// A value that is not finite or too large, with its unit and the allowed range.
    #[inline]
    pub fn validate(&self) -> Result<(), InvalidValue> {
        let [u0, u1, u2, u3] = self.signal.map(|u| u * u);
        // The sum is not a number if one of them is not.
        let sum = (u0 + u2) + (u1 + u3) + self.amplitude * self.amplitude;
        if sum < Self::LARGEST * Self::LARGEST {
            return self.validate_frequency();
        }
        self.explain()
    }

    /// Checks the frequency alone.
    #[inline(always)]
    pub(crate) fn validate_frequency(&self) -> Result<(), InvalidValue> {
        if self.omega * self.omega < FASTEST * FASTEST {
            return Ok(());
        }
        self.explain()
    }

    #[cold]
    fn explain(self) -> Result<(), InvalidValue> {
        const NAMES: [(&str, &str); 4] = [
            ("e (base displacement signal)", "m"),
            ("der(e) (slope of the base signal)", "m/s"),
            ("der(e, 2)/2 (second-order coefficient of the base signal)", "m/s^2"),
            ("der(e, 3)/6 (third-order coefficient of the base signal)", "m/s^3"),
        ];
        for (value, (name, unit)) in self.signal.into_iter().zip(NAMES) {
            InvalidValue::unless(value.abs() <= Self::LARGEST, name, value, unit, ALLOWED)?;
        }
        let name = "E (amplitude of the base oscillator)";
        InvalidValue::unless(
            self.amplitude.abs() <= Self::LARGEST,
            name,
            self.amplitude,
            "m",
            ALLOWED,
        )?;
        let name = "omega (frequency of the base oscillator)";
        let allowed = "a finite number from -1e12 to 1e12";
        InvalidValue::unless(self.omega.abs() <= FASTEST, name, self.omega, "rad/s", allowed)
    }
}

/// A drive and the phase its oscillator has reached.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct BaseMotion {
    /// What drives the base; the signal's time is counted from now.
    pub drive: Drive,
    /// Phase of the oscillator.
    pub phase: Phase,
}

impl BaseMotion {
    /// The same motion seen from `t` seconds later.
    pub fn after(&self, t: f64) -> Self {
        Self {
            drive: Drive { signal: shift(self.drive.signal, t), ..self.drive },
            phase: self.phase.advanced(self.drive.omega, t),
        }
    }
}

/// A phase in [0, 2π), rad, and its rounding error.
///
/// Without the second part the rounding of equal steps adds up in one direction (1e-10 rad after a million of them).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Phase(pub(crate) f64, pub(crate) f64);

impl Phase {
    /// The phase, rad, in [0, 2π).
    pub fn radians(self) -> f64 {
        let sum = self.0 + self.1;
        // Near 0 and 2π the rounding error, which grows with the number of turns, may carry the sum out of the range.
        let sum = if sum < 0.0 { TAU.0 + (sum + TAU.1) } else { sum };
        if sum >= TAU.0 { sum - TAU.0 } else { sum }
    }

    /// The phase later by `angle`, from -2π to 2π with its rounding error.
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    pub(crate) fn rotated(self, angle: Sum) -> Self {
        let (sum, error) = plus((self.0, self.1), (angle.value, angle.error));
        if sum < 0.0 {
            Self(sum + TAU.0, error + TAU.1)
        } else if sum < TAU.0 {
            Self(sum, error)
        } else {
            Self(sum - TAU.0, error - TAU.1)
        }
    }

    /// The phase `t` seconds later at `omega`, without losing digits to the number of turns.
    pub fn advanced(self, omega: f64, t: f64) -> Self {
        let (angle, error) = product(omega, t);
        let turns = libm::trunc(angle / TAU.0);
        let (turned, rounding) = product(turns, TAU.0);
        let rest = (angle - turned) - rounding;
        // The quotient may have been rounded to the next whole number.
        let surplus = if rest * angle < 0.0 { angle.signum() } else { 0.0 };
        self.rotated(Sum {
            value: rest + surplus * TAU.0,
            error: error - (turns - surplus) * TAU.1,
        })
    }
}

/// The polynomial's coefficients about `t` instead of 0.
pub(crate) fn shift([u0, u1, u2, u3]: [f64; 4], t: f64) -> [f64; 4] {
    [
        u0 + t * (u1 + t * (u2 + t * u3)),
        u1 + t * (2.0 * u2 + t * 3.0 * u3),
        u2 + 3.0 * t * u3,
        u3,
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_phase_stays_within_one_turn_whatever_the_step() {
        for omega in [-7.0, -1e-20, 0.0, 1e-20, 0.3, 55.0, 1e9] {
            for t in [1e-12, 0.1, 1.0, 1e3, 1e6] {
                let base = BaseMotion { drive: Drive::harmonic(1.0, omega), phase: Phase::default() };
                let phase = base.after(t).phase.radians();
                assert!((0.0..TAU.0).contains(&phase), "{omega} {t}: {phase}");
            }
        }
    }

    #[test]
    fn parts_of_a_step_are_equal_and_short_enough_and_follow_its_signal() {
        let drive = Drive { signal: [1.0, -0.5, 2.0, 0.25], amplitude: 0.3, omega: 7.0 };
        let whole = BaseMotion { drive, ..BaseMotion::default() }.after(1.0);
        for (longest, count) in [(f64::INFINITY, 1), (1.0, 1), (0.5, 2), (0.1, 10), (0.3, 4)] {
            let parts: Vec<_> = drive.parts(1.0, longest).collect();
            assert_eq!(parts.len(), count);
            assert!(
                parts
                    .iter()
                    .all(|(_, part)| *part == 1.0 / count as f64 && *part <= longest)
            );
            let ended = parts.iter().fold(BaseMotion::default(), |base, (drive, part)| {
                BaseMotion { drive: *drive, ..base }.after(*part)
            });
            assert!((ended.drive.signal[0] - whole.drive.signal[0]).abs() < 1e-14);
            assert!((ended.phase.radians() - whole.phase.radians()).abs() < 1e-14);
        }
        assert_eq!(drive.parts(1.0, 1.0).next(), Some((drive, 1.0)));
    }

    #[test]
    fn sevenths_of_a_turn_add_up_to_turns_without_losing_digits() {
        let omega = 0.990_417;
        let t = TAU.0 / omega / 7.0;
        let (angle, error) = product(omega, t);
        let (seven, rounding) = product(7.0, angle);
        // What seven steps are longer than a turn.
        let surplus = ((seven - TAU.0) + rounding) + (7.0 * error - TAU.1);
        for sign in [1.0, -1.0] {
            let mut base = BaseMotion {
                drive: Drive::harmonic(1.0, sign * omega),
                phase: Phase::default(),
            };
            for turn in 1..=100_000 {
                for _ in 0..7 {
                    base = base.after(t);
                }
                let phase = base.phase.radians();
                assert!((0.0..TAU.0).contains(&phase), "{turn}: {phase}");
                let lost = libm::remainder(phase, TAU.0) - sign * surplus * f64::from(turn);
                assert!(lost.abs() < 1e-15, "{turn}: {lost:e}");
            }
        }
    }

    #[test]
    fn the_phase_after_turns_is_the_remainder_of_a_division_by_one_turn() {
        for turns in 1..3000 {
            for beside in [-1, 0, 1] {
                let angle = f64::from_bits((f64::from(turns) * TAU.0).to_bits().wrapping_add_signed(beside));
                for omega in [-1.0, 1.0] {
                    let rest = libm::fmod(omega * angle, TAU.0);
                    let whole = libm::round((omega * angle - rest) / TAU.0);
                    let expected = Phase(0.5, 0.0).rotated(Sum { value: rest, error: -whole * TAU.1 });
                    assert_eq!(
                        Phase(0.5, 0.0).advanced(omega, angle),
                        expected,
                        "{turns} {beside} {omega}"
                    );
                }
            }
        }
    }
}
