//! The start of a flight, and the motion seen from it.

use super::Moving;
use super::coefficients::Coefficients;
use super::grid::Mark;
use super::propagator::Point;
use super::verify::{Sample, forcing, speed_squared};
use crate::base_motion::BaseMotion;
use crate::oscillator::Oscillator;
use crate::plant::{Masses, Rig};

/// The start of a flight.
#[derive(Clone, Copy)]
pub(super) struct Start<'a> {
    pub rig: &'a Rig,
    pub base: &'a BaseMotion,
    pub masses: &'a Masses,
    pub here: Mark,
    /// Velocity of the base's line less that of the particle, m/s.
    pub drift: f64,
}

impl<'a> Start<'a> {
    #[inline(always)]
    pub fn new(moving: &'a Moving, point: Point) -> Self {
        let Moving { rig, masses, base } = moving;
        let sample = Sample { w: masses.w.value(), dw: masses.dw, ddw: 0.0 };
        Self {
            rig,
            base,
            masses,
            here: Mark { t: 0.0, point, sample },
            drift: base.drive.signal[1] - masses.particle,
        }
    }

    pub fn half_width(&self) -> f64 {
        self.rig.parameters.half_width
    }

    /// The motion at a point of the flight, `t` seconds on.
    #[inline(always)]
    pub fn mark(&self, coefficients: &Coefficients, point: Point, t: f64) -> Mark {
        let here = &self.here;
        let sample = Sample {
            w: here.sample.w + ((point.y - here.point.y) + self.drift * t),
            dw: point.dy + self.drift,
            ddw: self.acceleration(coefficients, &point),
        };
        Mark { t, point, sample }
    }

    /// Relative acceleration at a point of the flight, m/s².
    #[inline(always)]
    pub fn acceleration(&self, coefficients: &Coefficients, point: &Point) -> f64 {
        let oscillator = &self.rig.alone;
        let (f, _) = coefficients.forcing_at(point.phasor);
        self.base.drive.amplitude * f - (oscillator.omega0_squared * point.y + 2.0 * oscillator.delta * point.dy)
    }

    /// Whether `w'` certainly keeps its sign between a mark and the time `t`: the particle drifts faster than the primary mass can move.
    /// Then the wall ahead is met once, and the other one is left behind.
    #[inline(always)]
    pub fn is_monotone(&self, from: &Mark, t: f64) -> bool {
        let (oscillator, drive, t) = (&self.rig.alone, &self.base.drive, t - from.t);
        let spare = self.drift.abs() - forcing(oscillator, drive, t) * t;
        spare > 0.0 && spare * spare * (1.0 - 1e-9) > speed_squared(oscillator, &from.point)
    }

    /// `|w'''|` is at most this for `t` seconds after a mark, m/s³.
    #[inline(always)]
    pub fn jerk(&self, from: &Mark, t: f64) -> f64 {
        let Oscillator { delta, omega0_squared, omega0, .. } = self.rig.alone;
        let damping = 2.0 * delta;
        let forcing = forcing(&self.rig.alone, &self.base.drive, t);
        let speed = speed_squared(&self.rig.alone, &from.point).sqrt() + forcing * t;
        let acceleration = (omega0 + damping) * speed + forcing;
        damping * acceleration + omega0_squared * speed + self.base.drive.omega.abs() * forcing
    }

    /// Whether both walls are certainly not met between a mark and a sample at the time `t`, but for a contact at that time.
    #[inline(always)]
    pub fn is_open(&self, from: &Mark, to: &Sample, t: f64) -> bool {
        let t = t - from.t;
        let (b, jerk, half) = (self.half_width(), self.jerk(from, t), 0.5 * t);
        let backwards = Sample { dw: -to.dw, ..*to };
        t > 0.0 && from.sample.is_open(b, jerk, half) && backwards.is_open(b, jerk, half)
    }
}
