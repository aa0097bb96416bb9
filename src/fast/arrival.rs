//! The arrival at a wall, found from a point near it at which the motion is known.

use super::FastPath;
use super::coefficients::{Coefficients, NEAR};
use super::propagator::{Increment, Nearby, Point, Propagator, angle};
use super::verify::{Mark, Sample, Start};
use crate::arithmetic::Sum;
use crate::contact::Wall;

/// Points of the grid that are tried.
const MOST_POINTS: u32 = 4;
/// Steps of Newton's method.
const MOST_ITERATIONS: u32 = 6;
/// Largest error that is left, relative to the time since the mark.
const ENOUGH: f64 = 1e-16;
/// Longest last step, in reaches of a Taylor polynomial: what it adds is known to second order.
const SHORT: f64 = 1e-6;

/// A contact.
#[derive(Clone, Copy)]
pub(super) struct Arrival {
    /// Time until then, s.
    pub t: Sum,
    /// The wall touched.
    pub wall: Wall,
    /// What the motion adds to the start until then.
    pub added: Increment,
    /// The angle by which the base turns.
    pub angle: Sum,
}

impl Arrival {
    /// Whether no wall is met between a mark and this contact.
    #[inline(always)]
    pub fn is_first(&self, start: &Start, coefficients: &Coefficients, from: &Mark) -> bool {
        let there = self.added.to(&start.here.point);
        let sample = Sample {
            w: self.wall.sign() * start.rig.parameters.half_width,
            dw: start.here.sample.dw + self.added.dy,
            ddw: start.acceleration(coefficients, &there),
        };
        start.is_open(from, &sample, self.t.value())
    }
}

/// The contact at the wall ahead, if it is so near the time of `propagator` that its digits can be trusted.
#[inline(always)]
pub(super) fn arrive(coefficients: &Coefficients, propagator: &Propagator, start: &Start) -> Option<Arrival> {
    let (amplitude, here) = (start.base.drive.amplitude, &start.here);
    let wall = Wall::ahead(here.sample.dw);
    let increment = propagator.increment(amplitude, &here.point);
    let w = here.sample.w + (increment.y + start.drift * propagator.t);
    let slowness = 1.0 / (here.point.dy + increment.dy + start.drift);
    let first = (wall.sign() * start.rig.parameters.half_width - w) * slowness;
    // Not a number where the approach has no speed.
    let close = first.abs() < coefficients.near;
    if !close {
        return None;
    }
    let nearby = Nearby::<4>::new(coefficients, amplitude, &here.point, &increment);
    // Where the approach is slow and curved, the reversed series is not accurate.
    if (nearby.c[0] * slowness * first).abs() >= NEAR {
        return None;
    }
    let h = reversed(&nearby.c, first, slowness);
    Some(Arrival {
        t: Sum::of(propagator.t, h),
        wall,
        added: nearby.at(h),
        angle: propagator.angle.plus(coefficients.omega * h),
    })
}

/// The root of a Taylor polynomial by its reversed series (P. Henrici, "Applied and Computational Complex Analysis" I, Wiley 1974,
/// section 1.7): `first` is that of the tangent, `slowness` one over the slope.
#[inline(always)]
fn reversed(c: &[f64], first: f64, slowness: f64) -> f64 {
    let (a2, a3, a4) = (c[0] * slowness, c[1] * slowness, c[2] * slowness);
    let (bend, a22, first2) = (a2 * first, a2 * a2, first * first);
    let third = (a22 + a22) - a3;
    let fourth = 5.0 * (a2 * (a3 - a22)) - a4;
    first * ((1.0 - bend) + first2 * (third + first * fourth))
}

impl FastPath {
    /// The contact at `wall` about `t` seconds after the start and within the grid's reach after a mark: the reversed series leads from
    /// one point of the grid to a nearer one.
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    pub(super) fn arrive_after(&mut self, start: &Start, from: &Mark, mut t: f64, wall: Wall) -> Option<Arrival> {
        let ahead = wall.sign() * start.rig.parameters.half_width - from.sample.w;
        for _ in 0..MOST_POINTS {
            let (at, nearby) = self.near_point(start, from, t);
            let gap = ahead - (nearby.there.y + start.drift * (at - from.t));
            let slowness = 1.0 / (from.sample.dw + nearby.there.dy);
            let h = reversed(&nearby.c, gap * slowness, slowness);
            if h.abs() <= self.coefficients.reach {
                return self.polish(start, from, wall, (at, &nearby), (gap, h));
            }
            t = at + h;
            // Not a number where the approach has no speed.
            let within = t > from.t && t - from.t <= self.coefficients.span;
            if !within {
                break;
            }
        }
        None
    }

    /// The contact about `h` seconds after the time `at`, when there is a `gap` to the wall: by Newton's method on the Taylor polynomial.
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    pub(super) fn polish<const N: usize>(
        &self,
        start: &Start,
        from: &Mark,
        wall: Wall,
        (at, nearby): (f64, &Nearby<N>),
        (gap, mut h): (f64, f64),
    ) -> Option<Arrival> {
        let there = &nearby.there;
        let speed = from.sample.dw + there.dy;
        for _ in 0..MOST_ITERATIONS {
            let (deviation, gained) = nearby.change(h);
            let slowness = 1.0 / (speed + gained);
            let step = ((gap - h * speed) - deviation) * slowness;
            let within = (h + step).abs() <= self.coefficients.reach;
            if !within {
                break;
            }
            // Newton's method squares the error.
            let error = (nearby.c[0] * slowness * (step * step)).abs();
            if error <= ENOUGH * (at - from.t + h) && step.abs() <= SHORT * self.coefficients.reach {
                let phasor = nearby.phasor(h + step);
                let (y, dy) = (there.y + (h * nearby.dy + deviation), nearby.dy + gained);
                let ddw = start.acceleration(&self.coefficients, &Point { y: from.point.y + y, dy, phasor });
                let added = Increment {
                    y: (from.point.y - start.here.point.y) + (y + step * (dy + 0.5 * step * ddw)),
                    dy: (from.point.dy - start.here.point.dy)
                        + (there.dy + (gained + step * (ddw + 3.0 * step * nearby.c[1]))),
                    phasor,
                };
                h += step;
                let omega = self.coefficients.omega;
                return Some(Arrival {
                    t: Sum::of(at, h),
                    wall,
                    added,
                    angle: angle(omega, at).plus(omega * h),
                });
            }
            h += step;
        }
        None
    }
}
