//! Persistent contact: both masses move as one while the wall must push, and part at the instant it need not.

use crate::clearance::{Bounds, Closure, Gap, first_closure};
use crate::contact::Wall;
use crate::segment::{Derivatives, Segment, position_change, velocity_change};

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
