//! The particle at a wall: impact, rest, release.

use super::{Contact, Event, Plant, UNRESOLVED};
use crate::oscillator::Oscillator;
use crate::sticking::until_released;
use crate::wall::Wall;

/// Rebounds that last less than this fraction of the fastest rate's time are not followed one by one.
const SHORTEST_HOP: f64 = 1e-9;
/// Above this coefficient of restitution a chatter has too many hops to be followed to its end.
const LIVELY: f64 = 0.999;
/// Such a particle stays on the wall once its hops last less than this fraction of the fastest rate's time: its position is
/// then known to 1.3e-13 and its velocity to 5e-7, in units of the wall's acceleration and that time.
const SHORTEST_RIDE: f64 = 1e-6;
/// Relative rounding of an acceleration put together from a few terms.
const ROUNDING: f64 = 8.0 * f64::EPSILON;

/// An acceleration so small against `omega0² b` is none.
const NOTHING: f64 = 1e-200;

/// When something happens within an advance, and how much of the advance is left then, s.
#[derive(Clone, Copy, Debug)]
pub(super) struct Moment {
    pub now: f64,
    pub left: f64,
}

impl Plant {
    pub(super) fn wall_touched(&self) -> Option<Wall> {
        Wall::BOTH
            .into_iter()
            .find(|wall| wall.sign() * self.here.w >= self.parameters.half_width)
    }

    /// The particle is at `wall` with relative velocity `dw`: impact if it approaches, then rest if it cannot leave.
    /// Returns the relative velocity after that, which has more digits than the difference of two large velocities.
    pub(super) fn touch(
        &mut self,
        wall: Wall,
        dw: f64,
        moment: Moment,
        tell: &mut impl FnMut(Event),
    ) -> f64 {
        let s = wall.sign();
        let mut dw = dw;
        self.here.w = s * self.parameters.half_width;
        if s * dw > 0.0 {
            let after = self.law.rebound(self.here.v, dw);
            let t = moment.now;
            self.tally.impacts += 1;
            self.tally.impact_time = self.time + t;
            self.tally.impact_velocity = dw;
            self.tally.dissipated += after.dissipated;
            tell(Event::Impact {
                t,
                wall,
                velocity: dw,
            });
            self.here.v = after.primary;
            self.here.particle = after.particle;
            dw = after.relative;
        }
        if self.rests(wall, dw, moment.left) {
            let (velocity, lost) = self.law.join(self.here.v, dw);
            self.here.v = velocity;
            self.here.particle = velocity;
            self.tally.dissipated += lost;
            self.contact = Contact::Stuck(wall);
            tell(Event::Stuck {
                t: moment.now,
                wall,
            });
            dw = 0.0;
        }
        dw
    }

    /// Whether a particle that leaves `wall` with relative velocity `dw` is in truth at rest on it.
    ///
    /// Its hops are then below resolution (height `u²/(2a)`), and they die out within `2u/(a (1 - r))`. Letting both masses
    /// move as one from now on conserves momentum exactly; what is neglected is the stiffness force on a gap of at most
    /// that height for that time, which is of third order in `u` (docs/accuracy.md).
    ///
    /// With hardly any loss they would never die out: such a particle *rides* on the wall once its hops are shorter than
    /// [`SHORTEST_RIDE`].
    fn rests(&mut self, wall: Wall, dw: f64, left: f64) -> bool {
        let s = wall.sign();
        let speed = -s * dw;
        let fastest = self.alone.oscillator.fastest;
        let lively = self.parameters.restitution > LIVELY;
        let lowest = UNRESOLVED * self.parameters.half_width;
        // Far from rest, whatever the acceleration: no need to work it out.
        let most = self.acceleration_bound();
        if speed * speed > 2.0 * lowest * most
            && !(lively && 2.0 * speed * fastest <= SHORTEST_RIDE * most)
        {
            return false;
        }
        let motion = self.alone.motion(&self.base, self.here.primary());
        let pressing = s * motion.derivatives_at_start()[2];
        if speed == 0.0 {
            return pressing >= -self.acceleration_noise();
        }
        if pressing <= 0.0 {
            return false;
        }
        let height = 0.5 * speed * speed / pressing;
        let dies_out = height <= lowest
            && (self.law.chatter_duration(speed, pressing) <= left
                || speed * fastest <= SHORTEST_HOP * pressing);
        dies_out || (lively && 2.0 * speed * fastest <= SHORTEST_RIDE * pressing)
    }

    /// The acceleration of the primary mass is certainly not above this, m/s²: the sum of its terms.
    fn acceleration_bound(&self) -> f64 {
        let Oscillator {
            delta,
            omega0_squared,
            ..
        } = self.alone.oscillator;
        let drive = &self.base.drive;
        let position = self.here.x.abs() + drive.signal[0].abs() + drive.amplitude.abs();
        let velocity =
            self.here.v.abs() + drive.signal[1].abs() + (drive.amplitude * drive.omega).abs();
        (omega0_squared * position + 2.0 * delta * velocity) * (1.0 + 1e-9)
    }

    /// Rounding of an acceleration here, m/s².
    fn acceleration_noise(&self) -> f64 {
        // Motion that has died out to where numbers end has no digits at all.
        let nothing = NOTHING * self.parameters.half_width * self.alone.oscillator.omega0_squared;
        ROUNDING * self.acceleration_bound() + nothing
    }

    /// Both masses move as one for at most `left` seconds, until the wall ceases to push. Returns the time passed, s, and
    /// whether the particle was let go.
    pub(super) fn stay(&mut self, wall: Wall, left: f64) -> (f64, bool) {
        let noise = self.acceleration_noise();
        let motion = self.joint.motion(&self.base, self.here.primary());
        let parting = until_released(&motion, wall, left, noise);
        self.base = self.base.after(parting.t);
        (self.here.x, self.here.v) = parting.joint;
        self.here.particle = parting.joint.1;
        if parting.released {
            self.contact = Contact::Released(wall);
        }
        (parting.t, parting.released)
    }
}
