//! Bounds that verify a prediction.
//!
//! Let `y` be the displacement of the primary mass relative to the line that follows the base signal, and `f` the forcing by the
//! rest of the base motion: `y'' + 2 delta y' + omega0² y = f`. With `R² = y'² + omega0² y²`,
//! `R R' = y' (f - 2 delta y') <= |f| R`, so that `R(t) <= R(0) + F t`, `F = max |f|`. This does not split the motion into a steady and a
//! free part, which cancel near resonance; it holds for every damping ratio and at an undamped resonance. From `R` follow bounds
//! of all derivatives, and those of `w`, from the second on, are those of `y`.
//!
//! Taylor's theorem with Lagrange's remainder then bounds each gap from below (R. E. Moore, "Interval Analysis", Prentice-Hall
//! 1966).

use super::propagator::Point;
use crate::base_motion::Drive;
use crate::oscillator::Oscillator;

/// Relative rounding of a bound.
const ROUNDING: f64 = 1e-12;

/// Bounds of the motion over a time.
#[derive(Clone, Copy, Debug)]
pub(super) struct Envelope {
    /// `|w''|` is at most this, m/s².
    pub acceleration: f64,
    /// `|w'''|` is at most this, m/s³, if the signal is a straight line.
    pub jerk: f64,
}

/// A gap at an instant and how it opens: `gap + speed t + acceleration t²/2 + ...`.
#[derive(Clone, Copy, Debug)]
struct Gap {
    gap: f64,
    speed: f64,
    acceleration: f64,
}

/// Relative motion at an instant.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Sample {
    /// `w`, m; `w'`, m/s; `w''`, m/s².
    pub w: f64,
    pub dw: f64,
    pub ddw: f64,
}

impl Envelope {
    /// Bounds over the next `t` seconds for a motion that is at `start`.
    #[inline(always)]
    pub fn new(oscillator: &Oscillator, drive: &Drive, start: &Point, t: f64) -> Self {
        let Oscillator {
            delta,
            omega0_squared,
            omega0,
            ..
        } = *oscillator;
        let damping = 2.0 * delta;
        let omega = drive.omega.abs();
        let mut forcing = drive.amplitude.abs() * (omega0_squared + damping * omega);
        let [_, _, u2, u3] = drive.signal;
        if u2 != 0.0 || u3 != 0.0 {
            let (u2, u3) = (u2.abs(), u3.abs() * t);
            forcing += omega0_squared * t * t * (u2 + u3)
                + damping * t * (2.0 * u2 + 3.0 * u3)
                + (2.0 * u2 + 6.0 * u3);
        }
        let speed = start.dy * start.dy + omega0_squared * (start.y * start.y);
        let speed = speed.sqrt() + forcing * t;
        let acceleration = (omega0 + damping) * speed + forcing;
        Self {
            acceleration,
            jerk: damping * acceleration + omega0_squared * speed + omega * forcing,
        }
    }

    /// Whether both walls, at `w = ±b`, are certainly not met within `t` after an instant with this `w` and `w'`.
    #[inline(always)]
    pub fn open_from(&self, b: f64, w: f64, dw: f64, t: f64) -> bool {
        // The bound is concave: it is above 0 in between if it is at the end.
        let lost = 0.5 * self.acceleration * t * t;
        let (moved, rounding) = (dw * t, ROUNDING * (dw.abs() * t + lost));
        let open = |s: f64| (b - s * w) - s * moved - lost > rounding;
        open(1.0) & open(-1.0)
    }

    /// Whether both walls are certainly not met between two samples `t` apart, but for a contact at the second one.
    #[inline(always)]
    pub fn open_between(&self, b: f64, from: &Sample, to: &Sample, t: f64) -> bool {
        let half = 0.5 * t;
        let remainder = self.jerk * half * (1.0 / 3.0);
        let forwards = |s: f64| Gap {
            gap: b - s * from.w,
            speed: -s * from.dw,
            acceleration: -s * from.ddw - remainder,
        };
        let backwards = |s: f64| Gap {
            gap: b - s * to.w,
            speed: s * to.dw,
            acceleration: -s * to.ddw - remainder,
        };
        let rounding = ROUNDING * 0.01 * b;
        forwards(1.0).is_open(half, rounding)
            && backwards(1.0).is_open(half, rounding)
            && forwards(-1.0).is_open(half, rounding)
            && backwards(-1.0).is_open(half, rounding)
    }
}

impl Gap {
    /// Whether the parabola is above 0 up to time `t`, but for a start at 0.
    #[inline(always)]
    fn is_open(&self, t: f64, rounding: f64) -> bool {
        let Self {
            gap,
            speed,
            acceleration,
        } = *self;
        let at_end = gap + t * (speed + 0.5 * t * acceleration) > rounding;
        // A convex parabola that falls at first has its least value in between.
        let dips = speed <= 0.0 && acceleration > 0.0 && -speed < acceleration * t;
        at_end && gap >= 0.0 && (!dips || 0.5 * speed * speed < (gap - rounding) * acceleration)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_gap_verified_as_open_is_open(
            gap in 0.0..1.0f64, speed in -2.0..2.0f64, acceleration in -3.0..3.0f64, t in 0.01..3.0f64,
        ) {
            let open = Gap { gap, speed, acceleration }.is_open(t, 1e-14);
            let least = (1..=400).map(|n| {
                let h = t * f64::from(n) / 400.0;
                gap + h * (speed + 0.5 * h * acceleration)
            }).fold(f64::INFINITY, f64::min);
            prop_assert!(!open || least > 0.0, "{least}");
            prop_assert!(open || least < 1e-3, "{least}");
        }
    }
}
