//! The next contact of a free flight: predicted, then verified.

use super::arrival::{Arrival, arrive};
use super::coefficients::Coefficients;
use super::horizon::Horizon;
use super::propagator::{Increment, Point};
use super::start::Start;
use super::verify::is_monotone;
use super::{FastPath, Moving, Next};
use crate::base_motion::{BaseMotion, Phase, shift};
use crate::plant::Rig;

/// Largest displacements, in half-widths: the digits of `w` are those of `q1`.
const WIDEST: f64 = 64.0;
/// Largest damping ratio: above it the stretches of a march are too short, and the plain solver needs fewer evaluations.
const HEAVIEST: f64 = 6.0;

/// What a flight leads to.
pub(super) enum Found {
    /// A verified contact, within the step or beyond its end.
    Contact(Arrival),
    /// No contact for this time, s.
    Free(f64),
    /// No contact to the end of the step: what that adds, and the phase of the base then.
    FreeAsBefore(Increment, Phase),
    /// Nothing could be verified.
    Nothing,
}

impl FastPath {
    /// What comes next within `left` seconds of a step of `duration`.
    #[inline]
    pub fn next(&mut self, moving: &mut Moving, left: f64, duration: f64) -> Next {
        if self.disabled {
            return Next::Search(left);
        }
        let point = self.point(moving);
        let (rig, base) = (moving.rig, &*moving.base);
        let soon = left * rig.alone.fastest.max(base.drive.omega.abs()) <= 1.0;
        if left < self.contact_free.t || (soon && self.is_contact_free(moving, &point, left)) {
            return self.coast(moving, &point, left, duration);
        }
        if !applies(rig, base, &point) {
            return Next::Search(left);
        }
        self.coefficients.prepare(&rig.alone, base.drive.omega);
        let mut start = Start::new(moving, point);
        let found = match self.as_before(&mut start, left) {
            Some(found) => found,
            None => match out_of_reach(&self.coefficients, &start) {
                Some(t) if t > self.coefficients.stretch => Found::Free(t),
                _ => self.look(&mut start, left),
            },
        };
        match found {
            Found::Contact(arrival) if arrival.t.value() <= left => {
                self.cache.learn(&self.coefficients, arrival.t.value());
                self.land(moving, &arrival)
            }
            Found::Contact(arrival) => {
                self.contact_free = Horizon::unchanged(arrival.t.value());
                self.coast(moving, &point, left, duration)
            }
            Found::Free(t) => {
                self.contact_free = Horizon::unchanged(t);
                self.coast(moving, &point, t.min(left), duration)
            }
            Found::FreeAsBefore(increment, phase) => {
                self.cache.learn(&self.coefficients, left);
                self.apply(moving, &increment, phase, left);
                Next::ContactFree(left)
            }
            Found::Nothing => Next::Search(self.coefficients.stretch.min(left)),
        }
    }

    /// A short hop, or a march.
    #[inline(always)]
    fn look(&mut self, start: &mut Start, left: f64) -> Found {
        start.sample.ddw = start.acceleration(&self.coefficients, &start.point);
        match self.hop(start, left) {
            Some(hop) => Found::Contact(hop),
            None => self.march(start, left, None),
        }
    }

    /// Moves on to a verified contact.
    #[inline(always)]
    fn land(&mut self, moving: &mut Moving, arrival: &Arrival) -> Next {
        let Moving { masses, base, .. } = moving;
        let signal = &mut base.drive.signal;
        if signal[1] != 0.0 {
            *signal = shift(*signal, arrival.t.value());
        }
        masses.x = arrival.x;
        masses.v = arrival.v;
        masses.dw = arrival.dw;
        self.turned(base, arrival.phase, arrival.phasor);
        self.contact_free = Horizon::default();
        Next::Contact(arrival.t, arrival.wall)
    }

    /// The flight that followed the last one before, or the end of a step that did, if it lies ahead again.
    #[inline(always)]
    fn as_before(&mut self, start: &mut Start, left: f64) -> Option<Found> {
        let propagator = (self.cache).expected(&start.rig.alone, &self.coefficients)?;
        self.evaluations += 1;
        let (oscillator, drive) = (&start.rig.alone, &start.base.drive);
        let (point, drift) = (start.point, start.drift);
        let monotone = |t: f64| is_monotone(oscillator, drive, &point, (drift, t));
        if (propagator.t - left).abs() < self.coefficients.near {
            let coefficients = &self.coefficients;
            let h = left - propagator.t;
            let increment = propagator.shortly(coefficients, drive.amplitude, &start.point, h);
            let w = start.sample.w + (increment.y + start.drift * left);
            if w.abs() >= start.half_width() || !monotone(left) {
                return None;
            }
            let phase = (start.base.phase).rotated(propagator.angle, coefficients.omega * h);
            return Some(Found::FreeAsBefore(increment, phase));
        }
        let predicted = arrive(&self.coefficients, propagator, start, start.wall_ahead())?;
        if !monotone(predicted.arrival.t.value()) {
            start.sample.ddw = start.acceleration(&self.coefficients, &point);
            return Some(self.march(start, left, Some(&predicted)));
        }
        Some(Found::Contact(predicted.arrival))
    }
}

/// Whether the motion is such that bounds can verify anything, and displacements such that `w` has all its digits.
#[inline(always)]
fn applies(rig: &Rig, base: &BaseMotion, point: &Point) -> bool {
    let oscillator = &rig.alone;
    let [offset, slope, ..] = base.drive.signal;
    let widest = WIDEST * rig.parameters.half_width;
    let fastest = widest * oscillator.omega0;
    base.drive.is_straight()
        && base.drive.omega >= 0.0
        && oscillator.delta <= HEAVIEST * oscillator.omega0
        && offset.abs().max(base.drive.amplitude.abs()).max(point.y.abs()) <= widest
        && slope.abs().max(point.dy.abs()) <= fastest
}

/// How long the particle stays where the primary mass, at its largest displacement, cannot reach it with a wall, s.
///
/// That displacement is at most the amplitude of the steady response and that of the free motion, which never grows.
#[inline(always)]
fn out_of_reach(coefficients: &Coefficients, start: &Start) -> Option<f64> {
    let amplitude = start.base.drive.amplitude;
    let steady = coefficients.forcing.steady()? * amplitude;
    let (b, particle) = (start.half_width(), start.point.y - start.sample.w);
    let room = b * (1.0 - 1e-9) - particle.abs() - steady.l1_norm();
    if room <= 0.0 || start.base.drive.signal[1] != 0.0 {
        return None;
    }
    let (cos, sin) = start.point.phasor;
    let y = start.point.y - (steady.re * sin + steady.im * cos);
    let dy = start.point.dy - coefficients.omega * (steady.re * cos - steady.im * sin);
    let omega0 = start.rig.alone.omega0;
    let room = room - (y * y + (dy / omega0) * (dy / omega0)).sqrt();
    (room > 0.0).then(|| room / start.masses.particle.abs())
}
