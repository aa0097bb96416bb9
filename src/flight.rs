//! The particle's free flight between the walls, up to the first instant it touches one.

use crate::clearance::{Bounds, Gap, first_closure};
use crate::contact::Wall;
use crate::segment::{Derivatives, Segment, Series, nearby, velocity_change};

/// A gap smaller than this fraction of the half-width cannot be told from none.
const RESOLUTION: f64 = 1.0 / (1u64 << 60) as f64;

/// One flight: the primary mass's motion, and where the particle is relative to it at the start.
#[derive(Clone, Copy, Debug)]
pub struct Flight {
    motion: Segment,
    series: Series,
    /// `w = q1 - q2` at the start, m, and its velocity, m/s.
    start: (f64, f64),
    half_width: f64,
}

/// How a flight ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Landing {
    /// Seconds since the start of the flight.
    pub t: f64,
    /// The wall touched; `None` where the flight reached the time limit.
    pub wall: Option<Wall>,
    /// Position (m) and velocity (m/s) of the primary mass.
    pub primary: (f64, f64),
    /// Relative position `w` (m) and velocity (m/s).
    pub relative: (f64, f64),
    /// Evaluations of the motion.
    pub evaluations: u64,
}

impl Flight {
    /// A flight of a particle at `w` (m) with velocity `w'` (m/s) relative to the primary mass in `motion`.
    pub fn new(motion: Segment, start: (f64, f64), half_width: f64) -> Self {
        Self { series: motion.series(), motion, start, half_width }
    }

    /// Follows the flight to its first contact, or for `limit` seconds if there is none.
    ///
    /// `released` names the wall that has just ceased to push, if the flight begins so.
    pub fn first_contact(&self, limit: f64, released: Option<Wall>) -> Landing {
        let from = released.map_or(0.0, |wall| self.clear_of(wall).min(limit));
        let look = |t: f64| {
            let (change, d) = self.relative_change(t);
            (Wall::BOTH.map(|wall| self.gap(wall, change, &d)), d)
        };
        let scale = (self.motion.fastest(), RESOLUTION * self.half_width);
        let (closure, looks) = first_closure((from, limit), scale, look, self);
        match closure {
            Some(closure) => {
                let wall = Wall::BOTH[closure.which];
                let d = &closure.derivatives;
                let (_, dw_change) = self.relative_change(closure.t).0;
                Landing {
                    t: closure.t + closure.h,
                    wall: Some(wall),
                    primary: nearby(d, closure.h),
                    relative: (
                        wall.sign() * self.half_width,
                        self.start.1 + (dw_change + velocity_change(d, closure.h)),
                    ),
                    evaluations: looks,
                }
            }
            None => Landing { evaluations: looks + 1, ..self.unhindered(limit) },
        }
    }

    /// The state after `t` seconds, with no regard to walls.
    fn unhindered(&self, t: f64) -> Landing {
        let ((w_change, dw_change), d) = self.relative_change(t);
        Landing {
            t,
            wall: None,
            primary: (d[0], d[1]),
            relative: (self.start.0 + w_change, self.start.1 + dw_change),
            evaluations: 1,
        }
    }

    /// How `w` and its velocity have changed since the start, and the primary mass's derivatives.
    fn relative_change(&self, t: f64) -> ((f64, f64), Derivatives) {
        if t == 0.0 {
            return ((0.0, 0.0), self.motion.derivatives_at_start());
        }
        let now = self.motion.at(&self.series, t);
        let (dx, dv) = now.departure;
        ((self.start.1 * t + dx, dv), now.derivatives)
    }

    /// The particle flies straight on, so that beyond the first derivative `w` moves as the primary mass does.
    fn gap(&self, wall: Wall, change: (f64, f64), d: &Derivatives) -> Gap {
        let s = wall.sign();
        // On the wall the bracket is exactly 0: what is left is the change alone, with all its digits.
        let gap = (self.half_width - s * self.start.0) - s * change.0;
        Gap {
            gap: gap.max(0.0),
            closing: s * (self.start.1 + change.1),
            acceleration: s * d[2],
            jerk: s * d[3],
        }
    }

    /// How long the wall that has just ceased to push is certainly out of reach, and the other one too.
    ///
    /// Speed and acceleration relative to the first are 0, and its gap grows as `opening h³/6`. Half of the opening is kept as a margin.
    fn clear_of(&self, wall: Wall) -> f64 {
        let d = self.motion.derivatives_at_start();
        let window = 2.0 / self.motion.fastest();
        let fourth = d[4].abs() + window * self.motion.fifth_derivative_bound(&d, window);
        let opening = (-wall.sign() * d[3]).max(0.0);
        let fourth = fourth.max(f64::MIN_POSITIVE);
        let other = self.gap(wall.other(), (0.0, 0.0), &d);
        let jerk = |h| self.motion.third_derivative_bound(&d, h);
        (2.0 * opening / fourth).min(other.certainly_open(window, jerk))
    }
}

impl Bounds for &Flight {
    fn third(&self, d: &Derivatives, window: f64) -> f64 {
        self.motion.third_derivative_bound(d, window)
    }
}
