//! The particle at a wall: impact, then rest if it cannot leave.

use super::advance::Step;
use super::{Event, Plant};
use crate::arithmetic::Sum;
use crate::contact::{Contact, Departure, Wall};
use crate::oscillator::Oscillator;

/// Relative rounding error of an acceleration that is the sum of a few terms.
const ROUNDING: f64 = 8.0 * f64::EPSILON;
/// Accelerations this small against `omega0² b` are zero: subnormal values carry no significant digits.
const NOTHING: f64 = 1e-200;

impl Plant {
    /// The wall that the particle touches.
    #[inline]
    pub(super) fn wall_touched(&self) -> Option<Wall> {
        let (w, b) = (self.masses.w.value(), self.rig.parameters.half_width);
        if w >= b {
            Some(Wall::Plus)
        } else if w <= -b {
            Some(Wall::Minus)
        } else {
            None
        }
    }

    /// The particle is at `wall`: impact if it approaches, then rest if it cannot leave.
    pub(super) fn touch(&mut self, wall: Wall, step: &mut Step<impl FnMut(Event)>) {
        let (s, velocity) = (wall.sign(), self.masses.dw);
        self.masses.w = Sum::from(s * self.rig.parameters.half_width);
        if s * velocity > 0.0 {
            let v = self.masses.v.value();
            let after = self.rig.law.rebound(v, velocity);
            let t = step.now();
            self.totals.impacts += 1;
            self.totals.impact_time = self.time + t;
            self.totals.impact_velocity = velocity;
            self.totals.dissipated += after.dissipated;
            step.outcome.impacts += 1;
            (step.on_event)(Event::Impact { t, wall, velocity });
            self.masses.v = Sum::from(after.primary);
            self.masses.particle = after.particle;
            self.masses.dw = after.relative;
        }
        if self.rests(wall, step.left.value()) {
            let (velocity, lost) = self.rig.law.join(self.masses.v.value(), self.masses.dw);
            self.masses.v = Sum::from(velocity);
            self.masses.particle = velocity;
            self.masses.dw = 0.0;
            self.totals.dissipated += lost;
            self.contact = Contact::Stuck(wall);
            step.outcome.stuck += 1;
            let t = step.now();
            (step.on_event)(Event::Stuck { t, wall });
        }
    }

    /// Whether the particle that leaves `wall` is in truth at rest on it.
    #[inline(always)]
    fn rests(&self, wall: Wall, left: f64) -> bool {
        let speed = -wall.sign() * self.masses.dw;
        let (fastest, half_width) = (self.rig.alone.fastest, self.rig.parameters.half_width);
        let largest = self.acceleration_bound();
        if (self.rig.law).certainly_leaves(speed, largest, (fastest, half_width)) {
            return false;
        }
        self.rig.law.rests(&Departure {
            speed,
            pressing: (wall.sign() * self.acceleration(), self.acceleration_error()),
            fastest,
            half_width,
            left,
        })
    }

    /// Acceleration of the primary mass alone, m/s².
    fn acceleration(&self) -> f64 {
        let Oscillator {
            delta,
            omega0_squared,
            ..
        } = self.rig.alone;
        let drive = &self.base.drive;
        let (cos, sin) = self.fast.phasor();
        let stretch = self.masses.x.value() - (drive.signal[0] + drive.amplitude * sin);
        let slip = self.masses.v.value() - (drive.signal[1] + drive.amplitude * drive.omega * cos);
        -2.0 * delta * slip - omega0_squared * stretch
    }

    /// An upper bound of the acceleration's magnitude, m/s²: the sum of its terms.
    #[inline(always)]
    fn acceleration_bound(&self) -> f64 {
        let Oscillator {
            delta,
            omega0_squared,
            ..
        } = self.rig.alone;
        let drive = &self.base.drive;
        let position = self.masses.x.value().abs() + drive.signal[0].abs() + drive.amplitude.abs();
        let velocity = self.masses.v.value().abs()
            + drive.signal[1].abs()
            + (drive.amplitude * drive.omega).abs();
        (omega0_squared * position + 2.0 * delta * velocity) * (1.0 + 1e-9)
    }

    /// Rounding error of the acceleration, m/s².
    pub(super) fn acceleration_error(&self) -> f64 {
        let nothing = NOTHING * self.rig.parameters.half_width * self.rig.alone.omega0_squared;
        ROUNDING * self.acceleration_bound() + nothing
    }
}
