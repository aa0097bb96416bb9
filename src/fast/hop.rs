//! A hop: the particle has left the wall that presses on it, and comes back at once.
//!
//! Seen from the wall it falls with an acceleration `a` that hardly changes in so short a time: `u h - a h²/2 - j h³/6 - ...`
//! with `u` the rebound speed. Divided by `h` this falls steadily while `|w'''| h` stays below `a/8`, so that the return is
//! the first contact; the other wall is out of reach if the height `u²/(2a)` is below the half-width.

use super::FastPath;
use super::flight::{Arrival, Start};
use crate::arithmetic::Sum;
use crate::contact::Wall;
use crate::segment::Segment;

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
        let Start { rig, base, masses, .. } = start;
        let wall = if masses.w.value() > 0.0 {
            Wall::Plus
        } else {
            Wall::Minus
        };
        let s = wall.sign();
        let start = (masses.x.value(), masses.v.value());
        let motion = Segment::new(&rig.alone, **base, start);
        let d = motion.derivatives_at_start();
        let (speed, pressing) = (-s * masses.dw, s * d[2]);
        if motion.third_derivative_bound(&d, 1.25 * about) * about > 0.125 * pressing {
            return None;
        }
        self.evaluations += 1;
        let [.., d3, d4, d5, d6] = d;
        let (j, k, l, n) = (s * d3 / 3.0, s * d4 / 12.0, s * d5 / 60.0, s * d6 / 360.0);
        let mut h = about;
        for _ in 0..4 {
            h = 2.0 * speed / (pressing + h * (j + h * (k + h * (l + h * n))));
        }
        let fifth = d4 / 24.0 + h * (d5 / 120.0 + h * (d6 / 720.0));
        let gained = h * (d[2] + h * (d3 / 2.0 + h * (d4 / 6.0 + h * (d5 / 24.0 + h * d6 / 120.0))));
        let moved = h * (d[1] + h * (d[2] / 2.0 + h * (d3 / 6.0 + h * fifth)));
        let phase = base.phase.advanced(base.drive.omega, h);
        let (sin, cos) = libm::sincos(phase.radians());
        Some(Arrival {
            t: Sum::from(h),
            x: masses.x.plus(moved),
            v: masses.v.plus(gained),
            dw: masses.dw + gained,
            wall,
            phase,
            phasor: (cos, sin),
        })
    }
}
