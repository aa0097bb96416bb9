//! A hop: the particle has left the wall that presses on it, and comes back at once.
//!
//! Seen from the wall it falls with an acceleration `a` that hardly changes in so short a time: `u h - a h²/2 - j h³/6 - ...`
//! with `u` the rebound speed. Divided by `h` this falls steadily while `|w'''| h` stays below `a/8`, so that the return is
//! the first contact; the other wall is out of reach if the height `u²/(2a)` is below the half-width.

use super::FastPath;
use super::arrival::{Arrival, Predicted};
use super::grid::Mark;
use super::start::Start;
use crate::arithmetic::Sum;

/// Longest hop, in units of the fastest rate's time: Taylor polynomials then leave out less than 1e-17.
const LONGEST: f64 = 1.0 / 512.0;

impl FastPath {
    /// The return to the wall that the particle has just left, if it is a short hop that ends within `left` seconds.
    #[inline(always)]
    pub(super) fn hop(&mut self, start: &Start, left: f64) -> Option<Arrival> {
        let (w, b) = (start.masses.w.value(), start.rig.parameters.half_width);
        if w.abs() != b {
            return None;
        }
        let s = 1f64.copysign(w);
        let (speed, pressing) = (-s * start.masses.dw, s * start.sample.ddw);
        let about = 2.0 * speed / pressing;
        let fastest = (start.rig.alone.fastest).max(start.base.drive.omega.abs());
        let short = speed > 0.0
            && pressing > 0.0
            && about * fastest <= LONGEST
            && 1.25 * about < left
            && speed * speed < pressing * b;
        if short { self.short_hop(start, about) } else { None }
    }

    #[inline(never)]
    fn short_hop(&mut self, start: &Start, about: f64) -> Option<Arrival> {
        let wall = start.wall_ahead().other();
        let s = wall.sign();
        let (speed, pressing) = (-s * start.sample.dw, s * start.sample.ddw);
        if start.envelope(&start.point, 1.25 * about).jerk * about > 0.125 * pressing {
            return None;
        }
        let here = Mark { t: 0.0, point: start.point, sample: start.sample };
        let near = self.near_point(start, &here, 0.0).nearby;
        // Newton's method.
        let mut h = about;
        for _ in 0..4 {
            let (bent, quickened) = near.change(h);
            h -= (s * bent - speed * h) / (s * quickened - speed);
        }
        let when = (Sum::from(h), ((0.0, 0.0), self.coefficients.omega * h));
        Some(Predicted::new(start, wall, when, near.at(h), 0.0).arrival)
    }
}
