//! The particle at a wall: impact, then rest if it cannot leave.

use super::advance::Step;
use super::{Event, Plant};
use crate::arithmetic::Sum;
use crate::contact::{Resolution, Wall};
use crate::moving::Masses;
use crate::oscillator::Oscillator;
use crate::segment::Segment;

/// A hop lower than this fraction of the half-width cannot be told from contact in double precision.
const LOWEST_HOP: f64 = 1.0 / (1u64 << 56) as f64;
/// Relative rounding error of an acceleration that is the sum of a few terms.
const ROUNDING: f64 = 8.0 * f64::EPSILON;
/// Accelerations this small against `omega0² b` are zero: subnormal values carry no significant digits.
const NOTHING: f64 = 1e-200;

impl Plant {
    /// The wall that the particle touches.
    #[inline]
    pub(super) fn wall_touched(&self) -> Option<Wall> {
        let (w, b) = (self.moving.masses.w.value(), self.moving.rig.parameters.half_width);
        (w.abs() >= b).then(|| Wall::ahead(w))
    }

    /// The particle is at `wall`: impact if it approaches, then rest if it cannot leave.
    #[inline]
    pub(super) fn touch(&mut self, wall: Wall, step: &mut Step<impl FnMut(Event)>) {
        let half_width = self.moving.rig.parameters.half_width;
        self.moving.masses.w = Sum::from(wall.sign() * half_width);
        let resolution = Resolution {
            lowest_hop: LOWEST_HOP * half_width,
            longest_chatter: step.left.value(),
            fastest: self.moving.rig.free.fastest,
            elastic: true,
        };
        let Masses { primary, particle, dw, .. } = self.moving.masses;
        let velocities = (primary.values[1], particle, dw);
        let touch = self.moving.rig.law.touch(wall, velocities, |primary, speed| {
            let largest = self.acceleration_bound(primary);
            !(self.moving.rig.law).certainly_leaves(speed, largest, &resolution)
                && (self.moving.rig.law).rests(speed, self.pressing(wall, primary), &resolution)
        });
        self.moving.masses.primary = self.moving.masses.primary.plus([0.0, touch.kick]);
        self.moving.masses.particle = touch.particle;
        self.moving.masses.dw = touch.relative;
        let t = step.now();
        self.totals.add(&touch, self.time + t);
        if let Some(velocity) = touch.impact {
            step.outcome.impacts += 1;
            (step.on_event)(Event::Impact { t, wall, velocity });
        }
        if touch.stuck {
            self.contact = Some(wall);
            step.outcome.stuck += 1;
            (step.on_event)(Event::Stuck { t, wall });
        }
    }

    /// Acceleration of `wall` towards the particle while the primary mass moves alone, and its rounding error, m/s².
    fn pressing(&self, wall: Wall, velocity: f64) -> (f64, f64) {
        let start = (self.moving.masses.primary.values[0], velocity);
        let motion = Segment::new(&self.moving.rig.free, self.moving.base, start);
        let acceleration = motion.derivatives_at_start()[2];
        (wall.sign() * acceleration, self.acceleration_error(velocity))
    }

    /// An upper bound of the acceleration's magnitude, m/s²: the sum of its terms.
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    fn acceleration_bound(&self, velocity: f64) -> f64 {
        let Oscillator { delta, omega0_squared, .. } = self.moving.rig.free;
        let drive = &self.moving.base.drive;
        let position = self.moving.masses.primary.values[0].abs() + drive.signal[0].abs() + drive.amplitude.abs();
        let velocity = velocity.abs() + drive.signal[1].abs() + (drive.amplitude * drive.omega).abs();
        (omega0_squared * position + 2.0 * delta * velocity) * (1.0 + 1e-9)
    }

    /// Rounding error of the acceleration, m/s².
    pub(super) fn acceleration_error(&self, velocity: f64) -> f64 {
        let nothing = NOTHING * self.moving.rig.parameters.half_width * self.moving.rig.free.omega0_squared;
        ROUNDING * self.acceleration_bound(velocity) + nothing
    }
}
