//! The stretches between events: flight and sliding up to the first wall or reversal, sticking and resting up to the release.

use crate::clearance::{Bounds, Closure, Gap, first_closure};
use crate::contact::Wall;
use crate::segment::{Instant, Motion, Series, position_change, velocity_change};

/// A gap smaller than this fraction of the half-width cannot be told from none.
const GAP_RESOLUTION: f64 = 1.0 / (1u64 << 60) as f64;

/// One flight, or one stretch of sliding: the primary mass's motion, and where the particle is relative to it at the start.
#[derive(Clone, Debug)]
pub struct Flight<M> {
    pub(crate) motion: M,
    series: Series,
    /// `w` from the middle of the cavity at the start, m, and its velocity, m/s.
    start: (f64, f64),
    half_width: f64,
    /// Rounding error of `w` at the start, m: near a wall, where friction turns the particle round, the gap is made of it.
    error: f64,
    /// Constant acceleration of the particle, m/s².
    pull: f64,
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
    /// Whether the relative velocity fell to 0: the end of a stretch of sliding.
    pub reversed: bool,
    /// Evaluations of the motion.
    pub evaluations: u64,
}

impl<M: Motion> Flight<M> {
    /// A flight of a particle at `w` (m) with velocity `w'` (m/s) relative to the primary mass in `motion`, and with the constant
    /// acceleration `pull`, m/s².
    pub fn new(motion: M, start: (f64, f64), half_width: f64, pull: f64) -> Self {
        let error = 0.0;
        Self {
            series: motion.series(),
            motion,
            start,
            half_width,
            error,
            pull,
        }
    }

    /// The same flight from a start whose `w` has a rounding error, m.
    #[must_use]
    pub fn with_error(self, error: f64) -> Self {
        Self { error, ..self }
    }

    /// Follows the stretch of sliding with `w'` of the sign `direction` to the wall ahead or to `w' = 0`, or for `limit` seconds if
    /// neither is met. `slips`: it begins at `w' = 0`.
    ///
    /// Up to its reversal `w'` keeps its sign, so that the wall behind is out of reach.
    pub fn first_wall_or_reversal(&self, limit: f64, direction: f64, slips: bool) -> FlightEnd {
        let wall = Wall::ahead(direction);
        let from = if slips {
            self.clear_of_reversal(direction).min(limit)
        } else {
            0.0
        };
        let unit = 1.0 / self.motion.fastest();
        let look = |t: f64| {
            let (dw, d) = self.departure(t);
            // In the unit of length.
            let reversal = Gap {
                gap: (direction * (self.start.1 + dw.1) * unit).max(0.0),
                closing: -direction * (d[2] - self.pull) * unit,
                acceleration: -direction * d[3] * unit,
                jerk: -direction * d[4] * unit,
            };
            ([self.gap(wall, (self.start.1 * t + dw.0, dw.1), &d), reversal], d)
        };
        let speed = self.motion.derivatives_at_start()[1].abs() + self.start.1.abs();
        let resolutions = [GAP_RESOLUTION * self.half_width, 4.0 * f64::EPSILON * unit * speed];
        let scale = (self.motion.fastest(), resolutions);
        let (closure, looks) = first_closure((from, limit), scale, look, Sliding { motion: &self.motion, unit });
        match closure {
            Ok(closure) if closure.which == 0 => self.end((closure.t, closure.h), Some(wall), looks),
            Ok(closure) => FlightEnd {
                reversed: true,
                ..self.end((closure.t + closure.h, 0.0), None, looks + 1)
            },
            Err(t) => self.end((t, 0.0), None, looks + 1),
        }
    }

    /// What has changed `t` seconds after the start beyond uniform motion, of `w` (m) and `w'` (m/s), and the derivatives then.
    fn departure(&self, t: f64) -> ((f64, f64), M::Look) {
        let Instant { departure: (dx, dv), derivatives, .. } = self.motion.at(&self.series, t);
        ((dx - 0.5 * self.pull * t * t, dv - self.pull * t), derivatives)
    }

    /// How long `w'`, which is 0 at the start and grows in `direction`, certainly stays away from 0.
    ///
    /// It grows at least as `opening h²/2 - fourth h³/6`. Half of that time is kept as a margin.
    fn clear_of_reversal(&self, direction: f64) -> f64 {
        let d = self.motion.derivatives_at_start();
        let window = 2.0 / self.motion.fastest();
        let fourth = self.motion.fourth_derivative_bound(&d, window).max(f64::MIN_POSITIVE);
        let opening = (direction * d[3]).max(0.0);
        let wall = self.gap(Wall::ahead(direction), (0.0, 0.0), &d);
        let jerk = |h| self.motion.third_derivative_bound(&d, h);
        (1.5 * opening / fourth).min(wall.certainly_open(window, jerk))
    }

    /// Follows the flight to its first contact, or for `limit` seconds if there is none.
    ///
    /// `released` names the wall that has just ceased to push, if the flight begins so.
    pub fn first_contact(&self, limit: f64, released: Option<Wall>) -> FlightEnd {
        let from = released.map_or(0.0, |wall| self.clear_of(wall).min(limit));
        let look = |t: f64| {
            let (dw, d) = self.departure(t);
            (
                Wall::BOTH.map(|wall| self.gap(wall, (self.start.1 * t + dw.0, dw.1), &d)),
                d,
            )
        };
        let scale = (self.motion.fastest(), [GAP_RESOLUTION * self.half_width; 2]);
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
            drifted: self.start.1 * t + (dx - 0.5 * self.pull * t * t),
            reversed: false,
            evaluations,
        }
    }

    /// The acceleration of the particle is constant, so that beyond the second derivative `w` moves as the primary mass does.
    fn gap(&self, wall: Wall, change: (f64, f64), d: &M::Look) -> Gap {
        let s = wall.sign();
        // On the wall the bracket is exactly 0: what is left is the change alone, with all its digits.
        let gap = (self.half_width - s * self.start.0) - s * (self.error + change.0);
        Gap {
            gap: gap.max(0.0),
            closing: s * (self.start.1 + change.1),
            acceleration: s * (d[2] - self.pull),
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

impl<M: Motion> Bounds<M::Look> for &Flight<M> {
    fn third(&self, d: &M::Look, window: f64) -> f64 {
        self.motion.third_derivative_bound(d, window)
    }

    fn open(&self, which: usize, gap: &Gap, d: &M::Look, window: f64) -> f64 {
        self.motion.certainly_open(Wall::BOTH[which].sign(), gap, d, window)
    }
}

/// Bounds of the gap to the wall ahead and of the relative velocity, in the unit of length.
struct Sliding<'a, M> {
    motion: &'a M,
    unit: f64,
}

impl<M: Motion> Bounds<M::Look> for Sliding<'_, M> {
    fn third(&self, d: &M::Look, window: f64) -> f64 {
        self.motion.third_derivative_bound(d, window)
    }

    fn open(&self, which: usize, gap: &Gap, d: &M::Look, window: f64) -> f64 {
        gap.certainly_open(window, |h| match which {
            0 => self.third(d, h),
            _ => self.unit * self.motion.fourth_derivative_bound(d, h),
        })
    }
}

// Sticking and resting: both masses move as one while wall and friction can transmit the force that this needs, and part at the instant they cannot.

/// How a stretch of sticking or resting ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sticking {
    /// Seconds since the start of the stretch.
    pub t: f64,
    /// Sign of the relative velocity `w'` with which the particle goes on, if it was released; else the time limit was reached.
    pub released: Option<f64>,
    /// Position (m) and velocity (m/s) of both masses.
    pub state: [f64; 2],
    /// Evaluations of the motion.
    pub evaluations: u64,
}

/// What holds the particle, and how much it can transmit.
#[derive(Clone, Copy, Debug)]
pub struct Grip {
    /// The wall that pushes without limit.
    pub wall: Option<Wall>,
    /// Acceleration of the particle by gravity, m/s².
    pub gravity: f64,
    /// Largest acceleration by static friction, m/s².
    pub holding: f64,
    /// Rounding error of the joint acceleration, m/s².
    pub noise: f64,
}

/// Follows both masses as one until the particle is released or for `limit` seconds.
///
/// The acceleration that the particle needs beyond gravity is `n = q'' - a_g`. Static friction gives it up to `mu_s g_n` either way;
/// the wall at `w = +b` adds to it without limit, that at `w = -b` takes from it. A limit is said to be exceeded only beyond the
/// rounding error of the acceleration, so that two masses at rest do not part over a last digit. There they part at once, even if the
/// force falls: the base may change its velocity or acceleration at the start of the stretch, without a jump.
pub fn until_released<M: Motion>(motion: &M, grip: &Grip, limit: f64) -> Sticking {
    match grip.wall {
        Some(wall) => until_one_released(motion, grip, limit, [-wall.sign()]),
        None => until_one_released(motion, grip, limit, [1.0, -1.0]),
    }
}

/// The same; `directions` are the signs of `w'` with which the particle can be released.
fn until_one_released<M: Motion, const N: usize>(
    motion: &M,
    grip: &Grip,
    limit: f64,
    directions: [f64; N],
) -> Sticking {
    let series = motion.series();
    let look = |t: f64| {
        let d = motion.at(&series, t).derivatives;
        let spare = directions.map(|direction| Gap {
            gap: (grip.holding - direction * (d[2] - grip.gravity)) + grip.noise,
            closing: direction * d[3],
            acceleration: direction * d[4],
            jerk: direction * d[5],
        });
        (spare, d)
    };
    let scale = (motion.fastest(), [grip.noise; N]);
    let (closure, evaluations) = first_closure((0.0, limit), scale, look, Held(motion));
    let (released, evaluations) = (closure.is_ok(), evaluations + u64::from(closure.is_err()));
    let (t, h, which, d) = match closure {
        Ok(Closure { t, h, which, derivatives }) => (t, h, which, derivatives),
        Err(t) => (t, 0.0, 0, motion.at(&series, t).derivatives),
    };
    let state = [d[0] + position_change(&d, h), d[1] + velocity_change(&d, h)];
    let released = released.then_some(directions[which]);
    Sticking { t: t + h, released, state, evaluations }
}

/// Bounds of the force that is left, which moves as the second derivative of the motion.
struct Held<'a, M>(&'a M);

impl<M: Motion> Bounds<M::Look> for Held<'_, M> {
    fn third(&self, d: &M::Look, window: f64) -> f64 {
        self.0.fifth_derivative_bound(d, window)
    }

    fn first(&self, d: &M::Look, window: f64) -> f64 {
        self.0.third_derivative_bound(d, window)
    }
}
