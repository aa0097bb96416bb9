//! The arrival at a wall, found near a propagator's time.

use super::FastPath;
use super::coefficients::{Coefficients, NEAR};
use super::grid::{Mark, NearPoint};
use super::propagator::{Increment, Nearby, Propagator, angle};
use super::start::Start;
use super::verify::Sample;
use crate::arithmetic::Sum;
use crate::base_motion::Phase;
use crate::contact::Wall;

/// Steps of Newton's method.
const MOST_ITERATIONS: u32 = 6;
/// Largest error that is left, in reaches of a Taylor polynomial.
const ENOUGH: f64 = 1e-15;

/// The state just before a contact.
#[derive(Clone, Copy)]
pub(super) struct Arrival {
    /// Time until then, s.
    pub t: Sum,
    /// Displacement and velocity of the primary mass, m and m/s.
    pub x: Sum,
    pub v: Sum,
    /// Relative velocity, m/s.
    pub dw: f64,
    /// The wall touched.
    pub wall: Wall,
    /// Phase of the base, and `e^{i phase}`.
    pub phase: Phase,
    pub phasor: (f64, f64),
}

/// A contact that was predicted, with the motion just before it.
pub(super) struct Predicted {
    pub arrival: Arrival,
    pub sample: Sample,
}

/// The contact at `wall`, if it is so near the time of `propagator` that its digits can be trusted.
///
/// From the propagator's time on the motion is its Taylor polynomial, and the root the polynomial's reversed series (P. Henrici,
/// "Applied and Computational Complex Analysis" I, Wiley 1974, section 1.7).
#[inline(always)]
pub(super) fn arrive(
    coefficients: &Coefficients,
    propagator: &Propagator,
    start: &Start,
    wall: Wall,
) -> Option<Predicted> {
    let amplitude = start.base.drive.amplitude;
    let increment = propagator.increment(amplitude, &start.point);
    let w = start.sample.w + (increment.y + start.drift * propagator.t);
    let slowness = 1.0 / (start.point.dy + increment.dy + start.drift);
    let first = (wall.sign() * start.half_width() - w) * slowness;
    // Not a number where the approach has no speed.
    let close = first.abs() < coefficients.near;
    if !close {
        return None;
    }
    let nearby = Nearby::<4>::new(coefficients, amplitude, &start.point, &increment);
    let [c2, c3, c4, _] = nearby.c;
    let (a2, a3, a4) = (c2 * slowness, c3 * slowness, c4 * slowness);
    let (bend, a22, first2) = (a2 * first, a2 * a2, first * first);
    // Where the approach is slow and curved, the reversed series is not accurate.
    if bend.abs() >= NEAR {
        return None;
    }
    let third = (a22 + a22) - a3;
    let fourth = 5.0 * (a2 * (a3 - a22)) - a4;
    let h = first * ((1.0 - bend) + first2 * (third + first * fourth));
    let at = nearby.at(h);
    let t = Sum::of(propagator.t, h);
    let angle = (propagator.angle, coefficients.omega * h);
    let ddw = 2.0 * c2 + h * (6.0 * c3);
    Some(Predicted::new(start, wall, (t, angle), at, ddw))
}

impl Predicted {
    /// The contact at `wall` after a time and an angle of the base; `added` is what the motion has added to the start until then, and
    /// `ddw` the relative acceleration there.
    #[inline(always)]
    pub fn new(start: &Start, wall: Wall, (t, angle): (Sum, ((f64, f64), f64)), added: Increment, ddw: f64) -> Self {
        let masses = start.masses;
        let dw = start.sample.dw + added.dy;
        Self {
            sample: Sample { w: wall.sign() * start.half_width(), dw, ddw },
            arrival: Arrival {
                t,
                x: masses.x.plus(added.y + start.base.drive.signal[1] * t.value()),
                v: masses.v.plus(added.dy),
                dw,
                wall,
                phase: start.base.phase.rotated(angle.0, angle.1),
                phasor: added.phasor,
            },
        }
    }
}

impl FastPath {
    /// The contact at `wall` about `t` seconds after the start and at most a stretch after a mark, by Newton's method on the
    /// Taylor polynomial about the nearest point of the grid.
    #[inline(always)]
    pub(super) fn arrive_after(&mut self, start: &Start, from: &Mark, t: f64, wall: Wall) -> Option<Predicted> {
        let near = self.near_point(start, from, t);
        let NearPoint { nearby, increment, .. } = &near;
        let drift = start.drift;
        // The gap at the point, and how fast it closes.
        let gap = (wall.sign() * start.half_width() - from.sample.w) - (increment.y + drift * near.since);
        let speed = from.sample.dw + increment.dy;
        let mut h = t - near.t;
        for _ in 0..MOST_ITERATIONS {
            let (bent, quickened) = nearby.change(h);
            let slowness = 1.0 / (speed + quickened);
            let step = ((gap - h * speed) - bent) * slowness;
            h += step;
            // Not a number where the approach has no speed.
            let within = h.abs() <= near.reach;
            if !within {
                return None;
            }
            // Newton's method squares the error.
            if (nearby.c[0] * slowness * (step * step)).abs() <= ENOUGH * near.reach {
                let at = nearby.at(h);
                let added = Increment {
                    y: (from.point.y - start.point.y) + at.y,
                    dy: (from.point.dy - start.point.dy) + at.dy,
                    phasor: at.phasor,
                };
                let omega = self.coefficients.omega;
                let when = (Sum::of(near.t, h), (angle(omega, near.t), omega * h));
                let [c2, c3, c4, ..] = nearby.c;
                let ddw = 2.0 * c2 + h * (6.0 * c3 + h * (12.0 * c4));
                return Some(Predicted::new(start, wall, when, added, ddw));
            }
        }
        None
    }
}
