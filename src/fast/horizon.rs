//! A time without contact that is known in advance, and that outlasts small changes of the drive.
//!
//! With `R`, `F` and `y` of [`super::verify`]: if the drive changes, `f` changes with it, and `R` jumps by at most what `omega0 y` and `y'`
//! do. A bound with a margin for both remains true until the margin is used up. A drive that changes at every sample, as a phase-locked
//! loop changes it, therefore asks for no new bound.

use super::propagator::Point;
use super::verify::{ROUNDING, forcing, harmonic_forcing, speed_squared};
use crate::base_motion::Drive;
use crate::moving::Moving;
use crate::oscillator::Oscillator;

/// Contact is looked for so many steps ahead.
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
        Self { t, forcing: f64::NEG_INFINITY, jumps: 0.0 }
    }

    /// What a bound from the start alone shows: no contact for `t` seconds or more, or nothing.
    pub(super) fn ahead(moving: &Moving, start: &Point, t: f64) -> Self {
        let Moving { rig, masses, base } = moving;
        let (b, w, dw, reach) = (rig.parameters.half_width, masses.w.value(), masses.dw, AHEAD * t);
        let forcing = forcing(&rig.free, &base.drive, reach) * (1.0 + MARGIN);
        let speed = speed_squared(&rig.free, start).sqrt() + forcing * reach;
        let jumps = MARGIN * speed;
        let acceleration = (rig.free.omega0 + 2.0 * rig.free.delta) * (speed + jumps) + forcing;
        // The bound of the gap to either wall is concave: it is above 0 in between if it is at the end.
        let open = |t: f64| {
            let (moved, lost) = (dw * t, t * (jumps + 0.5 * acceleration * t));
            b - (w + moved).abs() - lost > ROUNDING * (moved.abs() + lost)
        };
        // Where the bound of the gap ahead ends.
        let (gap, closing) = (b - w * 1f64.copysign(dw), dw.abs() + jumps);
        let end = 2.0 * gap / (closing + (closing * closing + 2.0 * acceleration * gap).sqrt());
        let far = reach.min(end * (1.0 - 1e-6));
        match [far, t].into_iter().find(|&one| one >= t && open(one)) {
            Some(t) if !base.drive.is_straight() => Self::unchanged(t),
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
