//! The next contact of a free flight: predicted, then verified.

use super::arrival::{Arrival, arrive};
use super::coefficients::Coefficients;
use super::horizon::Horizon;
use super::propagator::{Nearby, Point};
use super::verify::Start;
use super::{FastPath, Next};
use crate::base_motion::BaseMotion;
use crate::moving::{Moving, Rig};

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
        let to_search = core::mem::take(&mut self.to_search);
        if to_search > 0.0 {
            return Next::Search(to_search.min(left));
        }
        let point = self.point(moving);
        let (rig, base) = (&moving.rig, &moving.base);
        let soon = left * rig.free.fastest.max(base.drive.omega.abs()) <= 1.0;
        if left < self.contact_free.t || (soon && self.is_contact_free(moving, left)) {
            return self.coast(moving, &point, left, duration);
        }
        if !applies(rig, base, &point) {
            return Next::Search(left);
        }
        self.coefficients.prepare(&rig.free, base.drive.omega);
        if let Some(next) = self.as_before(moving, &point, left, duration) {
            return next;
        }
        let mut start = Start::new(moving, point);
        let found = match out_of_reach(&self.coefficients, &start) {
            Some(t) if t > self.coefficients.stretch => Found::Free(t),
            _ => {
                start.here.sample.ddw = start.acceleration(&self.coefficients, &point);
                let hop = self.hop(&start, left).map(Found::Contact);
                hop.unwrap_or_else(|| self.march(&start, left, None))
            }
        };
        self.take(moving, &point, &found, left, duration)
    }

    /// Does what was found.
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    fn take(&mut self, moving: &mut Moving, point: &Point, found: &Found, left: f64, duration: f64) -> Next {
        match found {
            Found::Contact(arrival) => self.meet(moving, point, arrival, left, duration),
            Found::Free(t) => {
                self.contact_free = Horizon::unchanged(*t);
                self.coast(moving, point, t.min(left), duration)
            }
            Found::Nothing => Next::Search(left),
        }
    }

    /// Moves on to a verified contact, or to the end of the step before it.
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    fn meet(&mut self, moving: &mut Moving, point: &Point, arrival: &Arrival, left: f64, duration: f64) -> Next {
        let t = arrival.t.value();
        if t > left {
            self.contact_free = Horizon::unchanged(t);
            return self.coast(moving, point, left, duration);
        }
        self.cache.learn(&self.coefficients, t);
        self.apply(moving, &arrival.added, arrival.angle, t);
        self.contact_free = Horizon::default();
        Next::Contact(arrival.t, arrival.wall)
    }

    /// The flight that followed the last one before, or the end of a step that did, if it lies ahead again.
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    fn as_before(&mut self, moving: &mut Moving, point: &Point, left: f64, duration: f64) -> Option<Next> {
        let propagator = (self.cache).expected(&moving.rig.free, &self.coefficients)?;
        self.evaluations += 1;
        let mut start = Start::new(moving, *point);
        let drive = &start.base.drive;
        if (propagator.t - left).abs() < self.coefficients.near {
            let h = left - propagator.t;
            let increment = propagator.increment(drive.amplitude, point);
            let increment = Nearby::<4>::new(&self.coefficients, drive.amplitude, point, &increment).at(h);
            let w = start.here.sample.w + (increment.y + start.drift * left);
            if w.abs() >= start.rig.parameters.half_width || !start.is_monotone(&start.here, left) {
                return None;
            }
            let angle = propagator.angle.plus(self.coefficients.omega * h);
            self.cache.learn(&self.coefficients, left);
            let dx = self.apply(moving, &increment, angle, left);
            self.drift(moving, dx, left);
            return Some(Next::ContactFree(left));
        }
        let arrival = arrive(&self.coefficients, propagator, &start)?;
        if start.is_monotone(&start.here, arrival.t.value()) {
            return Some(self.meet(moving, point, &arrival, left, duration));
        }
        start.here.sample.ddw = start.acceleration(&self.coefficients, point);
        let found = self.march(&start, left, Some(&arrival));
        Some(self.take(moving, point, &found, left, duration))
    }
}

/// Whether the motion is such that bounds can verify anything, and displacements such that `w` has all its digits.
#[cfg_attr(not(target_arch = "wasm32"), inline(always))]
fn applies(rig: &Rig, base: &BaseMotion, point: &Point) -> bool {
    let oscillator = &rig.free;
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
#[cfg_attr(not(target_arch = "wasm32"), inline(always))]
fn out_of_reach(coefficients: &Coefficients, start: &Start) -> Option<f64> {
    let (b, here) = (start.rig.parameters.half_width, &start.here);
    let steady = coefficients.forcing.steady()? * start.base.drive.amplitude;
    let particle = here.point.y - here.sample.w;
    let room = b * (1.0 - 1e-9) - particle.abs() - steady.l1_norm();
    if room <= 0.0 || start.base.drive.signal[1] != 0.0 {
        return None;
    }
    let Point { y, dy, phasor: (cos, sin) } = here.point;
    let y = y - (steady.re * sin + steady.im * cos);
    let dy = dy - coefficients.omega * (steady.re * cos - steady.im * sin);
    let omega0 = start.rig.free.omega0;
    let room = room - (y * y + (dy / omega0) * (dy / omega0)).sqrt();
    (room > 0.0).then(|| room / start.drift.abs())
}
