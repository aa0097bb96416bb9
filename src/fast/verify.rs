//! The motion seen from the start of a flight, and the bounds that verify a prediction.
//!
//! Let `y` be the displacement of the primary mass relative to the line that follows the base signal, and `f` the forcing by the
//! rest of the base motion: `y'' + 2 delta y' + omega0² y = f`. With `R² = y'² + omega0² y²`,
//! `R R' = y' (f - 2 delta y') <= |f| R`, so that `R(t) <= R(0) + F t`, `F = max |f|`. This does not split the motion into a steady and a
//! free part, which cancel near resonance; it holds for every damping ratio and at an undamped resonance. From `R` follow bounds
//! of all derivatives, and those of `w`, from the second on, are those of `y`.
//!
//! Taylor's theorem with Lagrange's remainder then bounds each gap from below (R. E. Moore, "Interval Analysis", Prentice-Hall 1966).

use super::propagator::{Coefficients, PhasePoint};
use crate::base_motion::{BaseMotion, Drive};
use crate::oscillator::Oscillator;
use crate::system::{Moving, System};

/// Rounding error of a gap, in half-widths, and of a bound, relative.
pub(super) const GAP_ROUNDING: f64 = 1e-14;

/// Relative motion at an instant.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct RelativeMotion {
    /// `w`, m; `w'`, m/s; `w''`, m/s².
    pub w: f64,
    pub dw: f64,
    pub ddw: f64,
}

/// `|f|` is at most this while the signal is a straight line, m/s².
#[cfg_attr(not(target_arch = "wasm32"), inline(always))]
pub(super) fn harmonic_forcing(oscillator: &Oscillator, drive: &Drive) -> f64 {
    drive.amplitude.abs() * (oscillator.omega0_squared + 2.0 * oscillator.delta * drive.omega.abs())
}

/// `|f|` is at most this over the next `t` seconds, m/s².
#[inline(always)]
pub(super) fn forcing(oscillator: &Oscillator, drive: &Drive, t: f64) -> f64 {
    let forcing = harmonic_forcing(oscillator, drive);
    if drive.is_straight() {
        return forcing;
    }
    let damping = 2.0 * oscillator.delta;
    let [_, _, u2, u3] = drive.signal;
    let (u2, u3) = (u2.abs(), u3.abs() * t);
    forcing
        + oscillator.omega0_squared * t * t * (u2 + u3)
        + damping * t * (2.0 * u2 + 3.0 * u3)
        + (2.0 * u2 + 6.0 * u3)
}

/// `R²` at an instant, (m/s)².
#[inline(always)]
pub(super) fn speed_squared(oscillator: &Oscillator, at: &PhasePoint) -> f64 {
    at.dy * at.dy + oscillator.omega0_squared * (at.y * at.y)
}

impl RelativeMotion {
    /// Whether `|w| < b` up to time `t`, but for a start at a wall, for any motion with `|w'''| <= jerk`.
    ///
    /// The remainder `jerk h³/6` is at most `(jerk t/3) h²/2`, so that parabolas bound the gap to either wall from below. A concave one is
    /// above 0 if it is at the end. Only that of the wall ahead can be convex and fall at first; its least value is then in between.
    #[inline(always)]
    pub fn is_open(&self, b: f64, jerk: f64, t: f64) -> bool {
        let Self { w, dw, ddw } = *self;
        let remainder = jerk * t * (1.0 / 3.0);
        let half = 0.5 * t;
        let inside = b - GAP_ROUNDING * b;
        let end = (w + t * (dw + half * ddw)).abs() + half * t * remainder;
        let s = 1f64.copysign(dw);
        let slowing = -s * ddw - remainder;
        let turns = slowing * t > dw.abs();
        end < inside && (!turns || 0.5 * dw * dw < (inside - s * w) * slowing)
    }
}

/// An instant of a flight at which the motion is known.
#[derive(Clone, Copy)]
pub(super) struct Mark {
    /// Time since the start of the flight, s: an exact multiple of the spacing.
    pub t: f64,
    pub point: PhasePoint,
    pub sample: RelativeMotion,
}

/// The start of a flight, while the base signal is a straight line.
#[derive(Clone, Copy)]
pub(super) struct Start<'a> {
    pub system: &'a System,
    pub base: &'a BaseMotion,
    pub here: Mark,
    /// Velocity of the base's line less that of the particle, m/s.
    pub drift: f64,
    /// Constant acceleration of the particle, m/s².
    pub pull: f64,
}

impl<'a> Start<'a> {
    #[inline(always)]
    pub fn new(moving: &'a Moving, point: PhasePoint) -> Self {
        let Moving { system, masses, base } = moving;
        let sample = RelativeMotion { w: masses.w.value(), dw: masses.dw, ddw: 0.0 };
        Self {
            system,
            base,
            here: Mark { t: 0.0, point, sample },
            drift: base.drive.signal[1] - masses.particle,
            pull: 0.0,
        }
    }

    /// The motion at a point of the flight, `t` seconds on.
    #[inline(always)]
    pub fn mark(&self, coefficients: &Coefficients, point: PhasePoint, t: f64) -> Mark {
        let here = &self.here;
        let sample = RelativeMotion {
            w: here.sample.w + ((point.y - here.point.y) + self.drift * t),
            dw: point.dy + self.drift,
            ddw: self.acceleration(coefficients, &point),
        };
        Mark { t, point, sample }
    }

    /// Relative acceleration at a point of the flight, m/s².
    #[inline(always)]
    pub fn acceleration(&self, coefficients: &Coefficients, point: &PhasePoint) -> f64 {
        let oscillator = &self.system.free;
        let (f, _) = coefficients.forcing_at(point.phasor);
        self.base.drive.amplitude * f - (oscillator.omega0_squared * point.y + 2.0 * oscillator.delta * point.dy)
    }

    /// Whether `w'` certainly keeps its sign between a mark and the time `t`: the particle drifts faster than the primary mass can move.
    /// Then the wall ahead is met once, and the other one is left behind.
    #[inline(always)]
    pub fn is_monotone(&self, from: &Mark, t: f64) -> bool {
        let (oscillator, drive, t) = (&self.system.free, &self.base.drive, t - from.t);
        let slowed = if self.pull == 0.0 { 0.0 } else { self.pull.abs() * t };
        let spare = (self.drift.abs() - slowed) - harmonic_forcing(oscillator, drive) * t;
        spare > 0.0 && spare * spare * (1.0 - 1e-9) > speed_squared(oscillator, &from.point)
    }

    /// `|w'''|` is at most this for `t` seconds after a mark, m/s³.
    #[inline(always)]
    pub fn jerk(&self, from: &Mark, t: f64) -> f64 {
        let Oscillator { delta, omega0_squared, omega0, .. } = self.system.free;
        let damping = 2.0 * delta;
        let forcing = harmonic_forcing(&self.system.free, &self.base.drive);
        let speed = speed_squared(&self.system.free, &from.point).sqrt() + forcing * t;
        let acceleration = (omega0 + damping) * speed + forcing;
        damping * acceleration + omega0_squared * speed + self.base.drive.omega.abs() * forcing
    }

    /// Whether both walls are certainly not met between a mark and a sample at the time `t`, but for a contact at that time.
    #[inline(always)]
    pub fn is_open(&self, from: &Mark, to: &RelativeMotion, t: f64) -> bool {
        let t = t - from.t;
        let (b, jerk, half) = (self.system.half_width, self.jerk(from, t), 0.5 * t);
        let backwards = RelativeMotion { dw: -to.dw, ..*to };
        t > 0.0 && from.sample.is_open(b, jerk, half) && backwards.is_open(b, jerk, half)
    }
}

// Horizon
//
// A time without contact that is known in advance, and that outlasts small changes of the drive.
//
// With `R`, `F` and `y` of [`super::verify`]: if the drive changes, `f` changes with it, and `R` jumps by at most what `omega0 y` and `y'`
// do. A bound with a margin for both remains true until the margin is used up. A drive that changes at every sample, as a phase-locked
// loop changes it, therefore asks for no new bound.

/// Steps ahead of the present one within which contact is looked for.
const AHEAD: f64 = 32.0;
/// Margins, as parts of `F` and of `R`.
const MARGIN: f64 = 1.0 / 16.0;

/// A time without contact.
#[derive(Clone, Copy, Debug, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Horizon {
    /// No contact for this time from now on, s,
    pub t: f64,
    /// while `F` is at most this, m/s²,
    forcing: f64,
    /// and the jumps of `R` add up to at most this, m/s.
    jumps: f64,
}

impl Horizon {
    /// No contact for `t` seconds under the drive as it is.
    pub fn unchanged(t: f64) -> Self {
        let t = if super::without("horizon") { 0.0 } else { t };
        Self { t, forcing: f64::NEG_INFINITY, jumps: 0.0 }
    }

    /// What a bound from the start alone shows: no contact for `t` seconds or more, or nothing.
    pub(super) fn ahead(moving: &Moving, start: &PhasePoint, t: f64) -> Self {
        let Moving { system, masses, base } = moving;
        let (b, w, dw, reach) = (system.half_width, masses.w.value(), masses.dw, AHEAD * t);
        let forcing = forcing(&system.free, &base.drive, reach) * (1.0 + MARGIN);
        let speed = speed_squared(&system.free, start).sqrt() + forcing * reach;
        let jumps = MARGIN * speed;
        let acceleration = (system.free.omega0 + 2.0 * system.free.delta) * (speed + jumps) + forcing;
        // The bound of the gap to either wall is concave: it is above 0 in between if it is at the end.
        let open = |t: f64| {
            let (moved, lost) = (dw * t, t * (jumps + 0.5 * acceleration * t));
            b - (w + moved).abs() - lost > GAP_ROUNDING * (moved.abs() + lost)
        };
        // Where the bound of the gap ahead ends.
        let (gap, closing) = (b - w * 1f64.copysign(dw), dw.abs() + jumps);
        let end = 2.0 * gap / (closing + (closing * closing + 2.0 * acceleration * gap).sqrt());
        let far = reach.min(end * (1.0 - 1e-6));
        match [far, t].into_iter().find(|&one| one >= t && open(one)) {
            Some(t) if !base.drive.is_straight() => Self { t, forcing: f64::NEG_INFINITY, jumps: 0.0 },
            Some(t) => Self { t, forcing, jumps },
            None => Self::default(),
        }
    }

    /// The drive changes.
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    pub fn drive_changed(&mut self, oscillator: &Oscillator, drive: &Drive) {
        if harmonic_forcing(oscillator, drive) > self.forcing {
            self.t = 0.0;
        }
    }

    /// The base jumps to another drive, and the velocity of the primary mass changes by `kick`, m/s.
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    pub fn jump(&mut self, oscillator: &Oscillator, before: &Drive, drive: &Drive, kick: f64) {
        let ([u0, u1, ..], [v0, v1, ..]) = (before.signal, drive.signal);
        self.jumps -= kick.abs() + oscillator.omega0 * (v0 - u0).abs() + (v1 - u1).abs();
        if self.jumps < 0.0 || !drive.is_straight() {
            self.t = 0.0;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_sample_verified_as_open_is_open(
            w in -1.0..=1.0f64, dw in -2.0..2.0f64, ddw in -3.0..3.0f64, jerk in 0.0..2.0f64, t in 0.01..3.0f64,
        ) {
            let open = RelativeMotion { w, dw, ddw }.is_open(1.0, jerk, t);
            let farthest = (1..=400).map(|n| {
                let h = t * f64::from(n) / 400.0;
                (w + h * (dw + 0.5 * h * ddw)).abs() + jerk * h * h * h / 6.0
            }).fold(0.0, f64::max);
            prop_assert!(!open || farthest < 1.0, "{farthest}");
        }

        #[test]
        fn the_forcing_by_a_signal_is_bounded_by_its_values_at_the_end_if_it_never_falls(
            delta in 0.0..3.0f64, omega0 in 0.1..4.0f64, u2 in 0.0..2.0f64, u3 in 0.0..2.0f64, t in 0.0..3.0f64,
        ) {
            let oscillator = Oscillator::new(1.0, omega0 * omega0, 2.0 * delta);
            let [by_value, by_slope] = [t * t * (u2 + t * u3), t * (2.0 * u2 + 3.0 * t * u3)];
            let exact = omega0 * omega0 * by_value + 2.0 * delta * by_slope + (2.0 * u2 + 6.0 * t * u3);
            for signs in [[1.0, 1.0], [1.0, -1.0]] {
                let signal = [0.3, -0.7, signs[0] * u2, signs[1] * u3];
                let bound = forcing(&oscillator, &Drive { signal, ..Drive::default() }, t);
                prop_assert!((bound - exact).abs() <= 1e-12 * exact, "{bound} {exact}");
            }
        }

        #[test]
        fn a_clear_sample_is_verified(w in -0.5..0.5f64, dw in -0.2..0.2f64, ddw in -0.1..0.1f64) {
            let open = RelativeMotion { w, dw, ddw }.is_open(1.0, 0.1, 1.0);
            prop_assert!(open);
        }

        #[test]
        fn a_start_on_a_wall_is_open_only_if_it_leaves(dw in -2.0..2.0f64) {
            let open = RelativeMotion { w: 1.0, dw, ddw: 0.0 }.is_open(1.0, 1e-3, 0.1);
            prop_assert_eq!(open, dw < -1e-5);
        }
    }
}
