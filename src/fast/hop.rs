//! A hop: the particle has left the wall that presses on it, and comes back at once.
//!
//! Seen from the wall it falls with an acceleration `a` that hardly changes in so short a time: `u h - a h²/2 - j h³/6 - ...`
//! with `u` the rebound speed. Divided by `h` this falls steadily while `|w'''| h` stays below `a/8`, so that the return is
//! the first contact; the other wall is out of reach if the height `u²/(2a)` is below the half-width.

use super::FastPath;
use super::arrival::Arrival;
use super::verify::Start;
use crate::contact::Wall;

/// Longest hop, in units of the fastest rate's time: it ends within reach of the start's Taylor polynomial.
const LONGEST: f64 = 1.0 / 20.0;

impl FastPath {
    /// The return to the wall that the particle has just left, if it is a short hop that ends within `left` seconds.
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    pub(super) fn hop(&mut self, start: &Start, left: f64) -> Option<Arrival> {
        let (here, b) = (&start.here.sample, start.rig.parameters.half_width);
        if here.w.abs() != b {
            return None;
        }
        let s = 1f64.copysign(here.w);
        let (speed, pressing) = (-s * here.dw, s * here.ddw);
        let about = 2.0 * speed / pressing;
        let fastest = (start.rig.free.fastest).max(start.base.drive.omega.abs());
        let short = speed > 0.0
            && pressing > 0.0
            && about * fastest <= LONGEST
            && 1.25 * about < left
            && speed * speed < pressing * b;
        if short { self.short_hop(start, about) } else { None }
    }

    #[inline(never)]
    fn short_hop(&mut self, start: &Start, about: f64) -> Option<Arrival> {
        let here = &start.here;
        if start.jerk(here, 1.25 * about) * about > 0.125 * here.sample.ddw.abs() {
            return None;
        }
        let (at, nearby) = self.near_point(start, here, 0.0);
        self.polish(start, here, Wall::ahead(here.sample.w), (at, &nearby), (0.0, about))
    }
}
