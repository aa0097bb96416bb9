//! The start of a flight, and the motion seen from it.

use super::Moving;
use super::coefficients::Coefficients;
use super::propagator::Point;
use super::verify::{Envelope, Sample};
use crate::base_motion::BaseMotion;
use crate::contact::Wall;
use crate::plant::{Masses, Rig};

/// The start of a flight.
#[derive(Clone, Copy)]
pub(super) struct Start<'a> {
    pub rig: &'a Rig,
    pub base: &'a BaseMotion,
    pub masses: &'a Masses,
    pub point: Point,
    pub sample: Sample,
    /// Velocity of the base's line less that of the particle, m/s.
    pub drift: f64,
}

impl<'a> Start<'a> {
    #[inline(always)]
    pub fn new(moving: &'a Moving, point: Point) -> Self {
        let (masses, base) = (&*moving.masses, &*moving.base);
        Self {
            rig: moving.rig,
            base,
            masses,
            point,
            sample: Sample { w: masses.w.value(), dw: masses.dw, ddw: 0.0 },
            drift: base.drive.signal[1] - masses.particle,
        }
    }

    pub fn half_width(&self) -> f64 {
        self.rig.parameters.half_width
    }

    /// The wall that the particle is approaching.
    #[inline(always)]
    pub fn wall_ahead(&self) -> Wall {
        if self.sample.dw > 0.0 { Wall::Plus } else { Wall::Minus }
    }

    /// Relative motion at a point of the flight, `t` seconds on.
    #[inline(always)]
    pub fn sample(&self, coefficients: &Coefficients, point: &Point, t: f64) -> Sample {
        Sample {
            w: self.sample.w + ((point.y - self.point.y) + self.drift * t),
            dw: point.dy + self.drift,
            ddw: self.acceleration(coefficients, point),
        }
    }

    /// Relative acceleration at a point of the flight, m/s².
    #[inline(always)]
    pub fn acceleration(&self, coefficients: &Coefficients, point: &Point) -> f64 {
        let oscillator = &self.rig.alone;
        let (f, _) = coefficients.forcing_at(point.phasor);
        self.base.drive.amplitude * f - (oscillator.omega0_squared * point.y + 2.0 * oscillator.delta * point.dy)
    }

    #[inline(always)]
    pub fn envelope(&self, point: &Point, t: f64) -> Envelope {
        Envelope::new(&self.rig.alone, &self.base.drive, point, t)
    }
}
