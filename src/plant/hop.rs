//! A hop: the particle has left the wall that presses on it, and comes back at once.
//!
//! Seen from the wall it falls with an acceleration `a` that hardly changes in so short a time: `u h - a h²/2 - j h³/6 - ...`
//! with `u` the rebound speed. Divided by `h` this falls steadily while `|w'''| h` stays below `a/8`, so that the return is
//! the first contact; the other wall is out of reach if the height `u²/(2a)` is below the half-width.

use super::contact::Moment;
use super::{Contact, Event, Plant};
use crate::span::Span;
use crate::wall::Wall;

/// Longest hop, in units of the fastest rate's time: what the Taylor polynomials leave out is below 1e-17 then.
const LONGEST: f64 = 1.0 / 512.0;

impl Plant {
    /// Follows one hop, if that is what lies ahead and it ends within `left`. Returns what is left after it, and the
    /// relative velocity then.
    pub(super) fn hop(
        &mut self,
        dw: f64,
        left: Span,
        moment: impl Fn(Span) -> Moment,
        tell: &mut impl FnMut(Event),
    ) -> Option<(Span, f64)> {
        let b = self.parameters.half_width;
        let wall = Wall::BOTH
            .into_iter()
            .find(|wall| self.here.w == wall.sign() * b && wall.sign() * dw < 0.0)?;
        if self.contact != Contact::Free {
            return None;
        }
        let s = wall.sign();
        let speed = -s * dw;
        let motion = self.alone.motion(&self.base, self.here.primary());
        let d = motion.derivatives_at_start();
        let pressing = s * d[2];
        let about = 2.0 * speed / pressing;
        let small = pressing > 0.0
            && about * motion.fastest() <= LONGEST
            && 1.25 * about < left.seconds()
            && speed * speed < pressing * b;
        if !small || motion.third_derivative_bound(&d, 1.25 * about) * about > 0.125 * pressing {
            return None;
        }
        let (j, k, l, n) = (
            s * d[3] / 3.0,
            s * d[4] / 12.0,
            s * d[5] / 60.0,
            s * d[6] / 360.0,
        );
        let mut h = about;
        for _ in 0..4 {
            h = 2.0 * speed / (pressing + h * (j + h * (k + h * (l + h * n))));
        }
        let gained = h
            * (d[2] + h * (d[3] / 2.0 + h * (d[4] / 6.0 + h * (d[5] / 24.0 + h * (d[6] / 120.0)))));
        self.here.x += h
            * (d[1]
                + h * (d[2] / 2.0
                    + h * (d[3] / 6.0
                        + h * (d[4] / 24.0 + h * (d[5] / 120.0 + h * (d[6] / 720.0))))));
        self.here.v += gained;
        self.base = self.base.after(h);
        let left = left.plus(-h);
        self.afresh();
        Some((left, self.touch(wall, dw + gained, moment(left), tell)))
    }
}
