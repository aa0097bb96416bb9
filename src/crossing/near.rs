//! Motion near an anchor: a time at which the closed form has been worked out.

use super::{Free, NEAR, Origin, Pair, Wave, times};
use crate::base_motion::{Phase, product};
use crate::lane::Lane;
use crate::oscillator::{Oscillator, Transition};
use core::f64::consts::TAU;
use serde::{Deserialize, Serialize};

/// A time at which the closed form has been worked out; that is no time at all by default.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Anchor<T> {
    /// Seconds since the start of a flight.
    pub t: T,
    /// `omega t` reduced to one turn, rad, and what rounding has kept out of it.
    pub angle: Pair<T>,
    /// `e^{i omega t}`.
    pub turned: Pair<T>,
    /// What the free motion does in that time: the sum of both.
    pub free: (Transition<T>, Transition<T>),
}

impl Default for Anchor<f64> {
    fn default() -> Self {
        Self {
            t: 0.0,
            angle: (0.0, 0.0),
            turned: (1.0, 0.0),
            free: (Transition::NONE, Transition::default()),
        }
    }
}

/// The end of a crossing, just before the impact.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Arrival<T> {
    /// Seconds after the anchor.
    pub beyond: T,
    /// Position of the primary mass, m.
    pub x: T,
    /// Its velocity, m/s.
    pub v: T,
    /// `e^{i phase}` of the base.
    pub turn: Pair<T>,
}

impl<T: Lane> Anchor<T> {
    /// The free motion moved on to the anchor: displacement and velocity.
    #[inline(always)]
    pub fn moved(&self, (y, dy): Pair<T>) -> Pair<T> {
        let (head, tail) = &self.free;
        let (more_y, more_dy) = tail.of(y, dy);
        let (y, dy) = head.of(y, dy);
        (y + more_y, dy + more_dy)
    }
}

/// The motion about an anchor, as a Taylor polynomial in the time from there.
#[derive(Clone, Copy, Debug)]
struct Nearby<T> {
    x: T,
    v: T,
    turn: Pair<T>,
    /// `q1^(n)/n!`, n from 2 on.
    c: [T; 4],
    omega: T,
}

impl<T: Lane> Nearby<T> {
    /// Position and velocity of the primary mass and `e^{i phase}`, `h` seconds after the anchor.
    #[inline(always)]
    fn at(&self, h: T) -> (T, T, Pair<T>) {
        let n = T::splat;
        let [c2, c3, c4, c5] = self.c;
        let h2 = h * h;
        let bent = h2 * ((c2 + h * c3) + h2 * (c4 + h * c5));
        let quickened =
            h * ((n(2.0) * c2 + h * (n(3.0) * c3)) + h2 * (n(4.0) * c4 + h * (n(5.0) * c5)));
        let angle = self.omega * h;
        let angle2 = angle * angle;
        let sin = angle - angle * (angle2 * n(1.0 / 6.0));
        let cos = n(1.0) - angle2 * (n(0.5) - angle2 * n(1.0 / 24.0));
        (
            self.x + (h * self.v + bent),
            self.v + quickened,
            times(self.turn, (cos, sin)),
        )
    }
}

impl Wave<f64> {
    /// The closed form of `oscillator`, to which this wave belongs, at `t` seconds.
    pub fn anchor(&self, oscillator: &Oscillator, t: f64) -> Anchor<f64> {
        self.turned(&Anchor {
            t,
            free: oscillator.kept_transition(t),
            ..Anchor::default()
        })
    }

    /// The next anchor for a crossing that is not near the last one.
    #[cold]
    pub(crate) fn next_anchor(
        &self,
        oscillator: &Oscillator,
        start: &Origin<f64>,
        free: &Free<f64>,
        (anchor, beyond): (&Anchor<f64>, f64),
    ) -> Anchor<f64> {
        let speed = start.particle.abs();
        let distance = self.half_width - Wave::ahead(start) * start.w;
        let primary = self.speed + libm::sqrt(free.speed_squared);
        let (soonest, latest) = (distance / (speed + primary), distance / (speed - primary));
        let guess = anchor.t + beyond;
        // Far from the anchor the series may lead anywhere.
        let possible = anchor.t > 0.0 && guess >= soonest && guess <= latest;
        self.anchor(oscillator, if possible { guess } else { distance / speed })
    }

    /// The same instant at the frequency that this wave has.
    pub fn turned(&self, anchor: &Anchor<f64>) -> Anchor<f64> {
        let (angle, missed) = product(self.omega, anchor.t);
        let (sin, cos) = libm::sincos(angle);
        Anchor {
            angle: if angle < TAU {
                (angle, missed)
            } else {
                Phase::default().advanced(self.omega, anchor.t).parts()
            },
            turned: (cos - missed * sin, sin + missed * cos),
            ..*anchor
        }
    }

    /// Whether two times are near each other: an anchor at one serves for the other.
    #[inline]
    pub fn are_near(&self, t: f64, other: f64) -> bool {
        (t - other).abs() < self.near
    }
}

impl<T: Lane> Wave<T> {
    #[inline(always)]
    fn nearby(&self, start: &Origin<T>, free: &Free<T>, anchor: &Anchor<T>) -> Nearby<T> {
        let (y, dy) = anchor.moved((free.y, free.dy));
        let turn = times(start.turn, anchor.turned);
        let s = times(self.steady, turn);
        let term = |n: usize, s: T| {
            let (per_y, per_dy) = self.free[n - 2];
            per_y * y + per_dy * dy + self.forced[n - 2] * s
        };
        Nearby {
            x: self.offset + y + s.1,
            v: dy + self.omega * s.0,
            turn,
            c: [term(2, s.1), term(3, s.0), term(4, s.1), term(5, s.0)],
            omega: self.omega,
        }
    }

    /// The state `t` seconds after the start, near an anchor, as long as no wall is met.
    #[inline(always)]
    pub fn shortly(&self, start: &Origin<T>, anchor: &Anchor<T>, t: T) -> Origin<T> {
        let nearby = self.nearby(start, &self.free_motion(start), anchor);
        let (x, v, turn) = nearby.at(t - anchor.t);
        Origin {
            x,
            v,
            w: start.w + ((x - start.x) - start.particle * t),
            particle: start.particle,
            turn,
        }
    }

    /// The arrival at the wall ahead, and whether it is near enough to the anchor for its digits to be trusted. If not,
    /// `beyond` is still a better guess.
    #[inline(always)]
    pub fn arrival(
        &self,
        start: &Origin<T>,
        free: &Free<T>,
        anchor: &Anchor<T>,
    ) -> (Arrival<T>, T::Mask) {
        let n = T::splat;
        let nearby = self.nearby(start, free, anchor);
        let w = start.w + ((nearby.x - start.x) - start.particle * anchor.t);
        let target = Self::ahead(start) * self.half_width;
        let slowness = (nearby.v - start.particle).inverse();
        let y = (target - w) * slowness;
        let [c2, c3, c4, _] = nearby.c;
        let (a2, a3, a4) = (c2 * slowness, c3 * slowness, c4 * slowness);
        let (bend, a22, y2) = (a2 * y, a2 * a2, y * y);
        let third = (a22 + a22) - a3;
        let fourth = n(5.0) * (a2 * (a3 - a22)) - a4;
        let h = y * ((n(1.0) - bend) + y2 * (third + y * fourth));

        // The primary mass is where its own motion takes it. Where the particle is would serve as well, but bring the
        // rounding of the instant into the spring's energy.
        let (x, v, turn) = nearby.at(h);
        let arrival = Arrival {
            beyond: h,
            x,
            v,
            turn,
        };
        // Far from the anchor, or where the approach is slow and bent, the reversed series means nothing.
        let near = T::both(y.abs().below(self.near), bend.abs().below(n(NEAR)));
        (arrival, near)
    }
}
