//! The particle's free flight between the walls, up to the first instant it touches one.

use crate::clearance::{Bounds, Gap, first_closure};
use crate::contact::Wall;
use crate::segment::{Derivatives, Instant, Segment, Series, position_change, velocity_change};

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
pub struct FlightEnd {
    /// Seconds since the start of the flight.
    pub t: f64,
    /// The wall touched; `None` where the flight reached the time limit.
    pub wall: Option<Wall>,
    /// Change of position of the primary mass, m: a sum of many small changes needs all their digits.
    pub moved: f64,
    /// Change of its velocity, m/s.
    pub gained: f64,
    /// Change of the relative position `w`, m, where no wall was touched.
    pub drifted: f64,
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
    pub fn first_contact(&self, limit: f64, released: Option<Wall>) -> FlightEnd {
        let from = released.map_or(0.0, |wall| self.clear_of(wall).min(limit));
        let look = |t: f64| {
            let Instant { departure: (dx, dv), derivatives: d, .. } = self.motion.at(&self.series, t);
            (
                Wall::BOTH.map(|wall| self.gap(wall, (self.start.1 * t + dx, dv), &d)),
                d,
            )
        };
        let scale = (self.motion.fastest(), RESOLUTION * self.half_width);
        let (closure, looks) = first_closure((from, limit), scale, look, self);
        match closure {
            Ok(closure) => self.end((closure.t, closure.h), Some(Wall::BOTH[closure.which]), looks),
            Err(t) => self.end((t, 0.0), None, looks + 1),
        }
    }

    /// The state `h` seconds after the instant `t`.
    fn end(&self, (t, h): (f64, f64), wall: Option<Wall>, evaluations: u64) -> FlightEnd {
        let Instant { moved, departure: (dx, dv), derivatives: d } = self.motion.at(&self.series, t);
        FlightEnd {
            t: t + h,
            wall,
            moved: moved + position_change(&d, h),
            gained: dv + velocity_change(&d, h),
            drifted: self.start.1 * t + dx,
            evaluations,
        }
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
        let other = self.gap(Wall::ahead(-wall.sign()), (0.0, 0.0), &d);
        let jerk = |h| self.motion.third_derivative_bound(&d, h);
        (2.0 * opening / fourth).min(other.certainly_open(window, jerk))
    }
}

impl Bounds for &Flight {
    fn third(&self, d: &Derivatives, window: f64) -> f64 {
        self.motion.third_derivative_bound(d, window)
    }
}
