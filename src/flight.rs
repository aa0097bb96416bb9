//! The particle's free flight between the walls, up to the first instant it touches one.

use crate::clearance::{Bounds, Closure, Gap, first_closure};
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

// Sticking
//
// Persistent contact: both masses move as one while the wall must push, and part at the instant it need not.

/// How a stretch of sticking ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sticking {
    /// Seconds since the start of the stretch.
    pub t: f64,
    /// Whether the wall ceased to push; else the time limit was reached.
    pub released: bool,
    /// Position (m) and velocity (m/s) of both masses.
    pub state: [f64; 2],
    /// Evaluations of the motion.
    pub evaluations: u64,
}

/// Follows both masses, stuck together at `wall`, until the wall ceases to push or for `limit` seconds.
///
/// The wall at `w = +b` pushes while the joint acceleration is positive, that at `w = -b` while it is negative.
/// `noise` (m/s²) is the rounding of that acceleration: a push is said to have ceased only below `-noise`, so that two
/// masses at rest do not part over a last digit. Below that they part at once, even if the push rises: the base may change its
/// velocity or acceleration at the start of the stretch, without a jump.
pub fn until_released(motion: &Segment, wall: Wall, limit: f64, noise: f64) -> Sticking {
    let s = wall.sign();
    let series = motion.series();
    let look = |t: f64| {
        let d = motion.at(&series, t).derivatives;
        let push = Gap {
            gap: s * d[2] + noise,
            closing: -s * d[3],
            acceleration: -s * d[4],
            jerk: -s * d[5],
        };
        ([push], d)
    };
    let scale = (motion.fastest(), noise);
    let (closure, evaluations) = first_closure((0.0, limit), scale, look, motion);
    let (released, evaluations) = (closure.is_ok(), evaluations + u64::from(closure.is_err()));
    let (t, h, d) = match closure {
        Ok(Closure { t, h, derivatives, .. }) => (t, h, derivatives),
        Err(t) => (t, 0.0, motion.at(&series, t).derivatives),
    };
    let state = [d[0] + position_change(&d, h), d[1] + velocity_change(&d, h)];
    Sticking { t: t + h, released, state, evaluations }
}

/// Bounds of the push, which is the second derivative of the motion.
impl Bounds for &Segment {
    fn third(&self, d: &Derivatives, window: f64) -> f64 {
        self.fifth_derivative_bound(d, window)
    }

    fn first(&self, d: &Derivatives, window: f64) -> f64 {
        self.third_derivative_bound(d, window)
    }
}
