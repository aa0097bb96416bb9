//! A march over a flight in equal stretches, each verified by a bound, until the rest of the flight is verified at once.

use super::FastPath;
use super::arrival::Arrival;
use super::coefficients::{POINTS, STRETCH, TERMS};
use super::flight::Found;
use super::propagator::{Increment, Nearby};
use super::verify::{Mark, Sample, Start};
use crate::contact::Wall;

/// Longest flight that is marched over, in stretches.
const MOST_STRETCHES: u32 = 64;
/// Shortest stretch, in distances between points of the grid.
const SHORTEST: usize = 3;
/// So many divisions in a march, and the plain solver is cheaper.
const MOST_DIVIDED: u32 = 16;
/// Longest stretch before a predicted contact that one bound can verify, in stretches.
const LONGEST_STRETCH: f64 = 2.0;
/// Up to here after a mark, in distances between points, it serves as its own point.
const ITSELF: f64 = 0.65;
/// Steps of Newton's method for a rough crossing.
const ROUGHLY: u32 = 2;

/// How a stretch of a march ends.
enum Stretch {
    Open,
    /// A contact is expected at this time, s, at this wall.
    Contact(f64, Wall),
    Unknown,
}

impl FastPath {
    /// Marches over the flight until a contact is found or `left` seconds are over. Where a stretch cannot be verified, it is
    /// halved, down to [`SHORTEST`].
    #[inline(never)]
    pub(super) fn march(&mut self, start: &Start, left: f64, predicted: Option<&Arrival>) -> Found {
        let mut from = start.here;
        // Points of the grid in the next stretch.
        let mut n = STRETCH;
        let mut divided = 0;
        for _ in 0..MOST_STRETCHES {
            if let Some(arrival) = predicted
                && arrival.t.value() - from.t <= LONGEST_STRETCH * self.coefficients.stretch
                && arrival.is_first(start, &self.coefficients, &from)
            {
                return Found::Contact(*arrival);
            }
            // The start of a predicted flight has been tried.
            if (predicted.is_none() || from.t > 0.0)
                && let Some(arrival) = self.rest(start, &from)
            {
                return Found::Contact(arrival);
            }
            let to = self.mark(start, &from, n);
            let found = match stretch(start, &from, &to) {
                Stretch::Open => {
                    from = to;
                    if from.t >= left {
                        break;
                    }
                    n = STRETCH.min(2 * n);
                    continue;
                }
                Stretch::Contact(t, wall) => (self.arrive_after(start, &from, t, wall))
                    .filter(|arrival| arrival.is_first(start, &self.coefficients, &from)),
                Stretch::Unknown => None,
            };
            match found {
                Some(arrival) => return Found::Contact(arrival),
                None if n > SHORTEST && divided < MOST_DIVIDED => {
                    n /= 2;
                    divided += 1;
                }
                // What is verified is kept: the plain solver searches as little as possible.
                None if from.t > 0.0 => {
                    self.to_search = self.coefficients.stretch;
                    break;
                }
                None => return Found::Nothing,
            }
        }
        Found::Free(from.t)
    }

    /// The contact after a mark, if it is near and the particle certainly drifts towards it all the time.
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    fn rest(&mut self, start: &Start, from: &Mark) -> Option<Arrival> {
        let wall = Wall::ahead(start.drift);
        // If the primary mass stood still.
        let t = (wall.sign() * start.rig.parameters.half_width - from.sample.w) / start.drift;
        if t > self.coefficients.span || !start.is_monotone(from, from.t + t) {
            return None;
        }
        let arrival = self.arrive_after(start, from, from.t + t, wall)?;
        start.is_monotone(from, arrival.t.value()).then_some(arrival)
    }

    /// The time of a point of the grid after a mark, and the motion near it: the point is the nearest one to the time `t`.
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    pub(super) fn near_point(&mut self, start: &Start, from: &Mark, t: f64) -> (f64, Nearby<TERMS>) {
        self.evaluations += 1;
        let (coefficients, amplitude) = (&self.coefficients, start.base.drive.amplitude);
        // Near the mark the mark itself: it needs no propagator.
        let n = match (t - from.t) / coefficients.spacing {
            part if part < ITSELF => 0,
            part => ((part + 0.5) as usize).min(POINTS),
        };
        let increment = match n {
            0 => Increment { y: 0.0, dy: 0.0, phasor: from.point.phasor },
            _ => (self.cache.grid)
                .over(&start.rig.free, coefficients, n)
                .increment(amplitude, &from.point),
        };
        (
            from.t + n as f64 * coefficients.spacing,
            Nearby::new(coefficients, amplitude, &from.point, &increment),
        )
    }

    /// What the motion adds in `t` seconds after the start.
    pub(super) fn after(&mut self, start: &Start, t: f64) -> Increment {
        let here = start.here.point;
        let mut mark = start.here;
        while t - mark.t > self.coefficients.span {
            mark = self.mark(start, &mark, POINTS);
        }
        let (at, nearby) = self.near_point(start, &mark, t);
        let Increment { y, dy, phasor } = nearby.at(t - at);
        Increment {
            y: (mark.point.y - here.y) + y,
            dy: (mark.point.dy - here.dy) + dy,
            phasor,
        }
    }

    /// The motion `n` points after a mark.
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    pub(super) fn mark(&mut self, start: &Start, from: &Mark, n: usize) -> Mark {
        self.evaluations += 1;
        self.rotations += 1;
        let propagator = (self.cache.grid).over(&start.rig.free, &self.coefficients, n);
        let increment = propagator.increment(start.base.drive.amplitude, &from.point);
        start.mark(&self.coefficients, increment.to(&from.point), from.t + propagator.t)
    }
}

/// What happens between two marks.
#[cfg_attr(not(target_arch = "wasm32"), inline(always))]
fn stretch(start: &Start, from: &Mark, to: &Mark) -> Stretch {
    let (b, t) = (start.rig.parameters.half_width, to.t - from.t);
    if to.sample.w.abs() < b {
        return if start.is_open(from, &to.sample, to.t) {
            Stretch::Open
        } else {
            Stretch::Unknown
        };
    }
    let wall = Wall::ahead(to.sample.w);
    let shape = |Sample { w, dw, ddw }: Sample| [w, dw * t, ddw * (t * t / 2.0)];
    match crossing(wall.sign() * b, shape(from.sample), shape(to.sample)) {
        Some(part) => Stretch::Contact(from.t + part * t, wall),
        None => Stretch::Unknown,
    }
}

/// The part of a stretch after which `w` crosses `target`, roughly: on the polynomial of degree 5 that has the same value and the
/// same two Taylor coefficients at both ends; the end is behind the target.
fn crossing(target: f64, from: [f64; 3], to: [f64; 3]) -> Option<f64> {
    let [w0, d0, a0] = from;
    let [w1, d1, a1] = to;
    let (e0, e1, e2) = ((w1 - w0) - (d0 + a0), d1 - (d0 + 2.0 * a0), a1 - a0);
    let c3 = 10.0 * e0 - 4.0 * e1 + e2;
    let c4 = -15.0 * e0 + 7.0 * e1 - 2.0 * e2;
    let c5 = 6.0 * e0 - 3.0 * e1 + e2;
    let gap = target - w0;
    // From behind, so that a start on this very wall is not found again.
    let mut s = if gap == 0.0 { 1.0 } else { gap / (w1 - w0) };
    for _ in 0..ROUGHLY {
        let square = s * s;
        let value = s * ((d0 + s * a0) + square * ((c3 + s * c4) + square * c5)) - gap;
        let slope = (d0 + s * (2.0 * a0)) + square * ((3.0 * c3 + s * (4.0 * c4)) + square * (5.0 * c5));
        s -= value / slope;
    }
    (s > 0.0 && s <= 1.0).then_some(s)
}
