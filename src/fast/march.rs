//! A march over a flight in equal stretches, each verified by a bound.

use super::FastPath;
use super::arrival::{Arrival, Predicted, arrive};
use super::coefficients::Coefficients;
use super::flight::Found;
use super::propagator::Point;
use super::start::Start;
use super::verify::Sample;
use crate::contact::Wall;

/// Longest flight that is marched over, in stretches.
const MOST_STRETCHES: u32 = 64;
/// Fine stretches in a coarse one.
pub(super) const FINE: usize = 3;
/// Longest stretch before a predicted contact that one bound can verify, in stretches.
const LONGEST_STRETCH: f64 = 2.0;
/// Attempts to come near enough to an arrival.
const MOST_ATTEMPTS: u32 = 4;

/// An end of a stretch of a march.
#[derive(Clone, Copy)]
struct Mark {
    t: f64,
    point: Point,
    sample: Sample,
}

/// How a stretch of a march ends.
enum Stretch {
    Open,
    /// A contact is expected at this time, s, at this wall.
    Contact(f64, Wall),
    Unknown,
}

impl FastPath {
    /// Marches over the flight until a contact is found or `left` seconds are over. Where a stretch cannot be verified, it is
    /// divided once.
    #[inline(never)]
    pub(super) fn march(&mut self, start: &Start, left: f64, predicted: Option<&Predicted>) -> Found {
        self.cache.prepare_march(&start.rig.alone, &self.coefficients);
        let mut from = Mark { t: 0.0, point: start.point, sample: start.sample };
        let mut fine = 0;
        for _ in 0..MOST_STRETCHES {
            if let Some(predicted) = predicted
                && predicted.arrival.t.value() - from.t <= LONGEST_STRETCH * self.coefficients.stretch
                && verified(start, &from, predicted)
            {
                self.cache.confirm();
                return Found::Contact(predicted.arrival);
            }
            let to = self.mark(start, &from, usize::from(fine > 0));
            let found = match stretch(&self.coefficients, start, &from, &to) {
                Stretch::Open => {
                    from = to;
                    fine = if fine > 0 { fine - 1 } else { 0 };
                    if from.t >= left {
                        break;
                    }
                    continue;
                }
                Stretch::Contact(t, wall) => self.approach(start, &from, t, wall),
                Stretch::Unknown => None,
            };
            match found {
                Some(arrival) => return Found::Contact(arrival),
                None if fine == 0 => fine = FINE,
                None => return Found::Nothing,
            }
        }
        Found::Free(from.t)
    }

    /// The motion one stretch further on.
    #[inline(always)]
    fn mark(&mut self, start: &Start, from: &Mark, fineness: usize) -> Mark {
        self.evaluations += 1;
        let propagator = &self.cache.march[fineness];
        let point = propagator.roughly(start.base.drive.amplitude, &from.point);
        let t = from.t + propagator.t;
        Mark {
            t,
            point,
            sample: start.sample(&self.coefficients, &point, t),
        }
    }

    /// The contact at `wall` about `t` seconds after the start, verified from the last mark on.
    #[inline(always)]
    fn approach(&mut self, start: &Start, from: &Mark, t: f64, wall: Wall) -> Option<Arrival> {
        let mut t = t;
        for _ in 0..MOST_ATTEMPTS {
            let propagator = self.cache.near(&start.rig.alone, &self.coefficients, t);
            self.evaluations += 1;
            match arrive(&self.coefficients, propagator, start, wall) {
                Ok(predicted) => {
                    let sure = verified(start, from, &predicted);
                    return sure.then_some(predicted.arrival);
                }
                Err(better) if (better - from.t).abs() < self.coefficients.stretch => t = better,
                Err(_) => return None,
            }
        }
        None
    }
}

/// Whether no wall is met between a mark and a predicted contact.
#[inline(always)]
fn verified(start: &Start, from: &Mark, predicted: &Predicted) -> bool {
    let t = predicted.arrival.t.value() - from.t;
    let envelope = start.envelope(&from.point, t);
    t > 0.0 && envelope.open_between(start.half_width(), &from.sample, &predicted.sample, t)
}

/// What happens between two marks.
#[inline(always)]
fn stretch(coefficients: &Coefficients, start: &Start, from: &Mark, to: &Mark) -> Stretch {
    let (b, t) = (start.half_width(), to.t - from.t);
    if to.sample.w.abs() < b {
        let envelope = start.envelope(&from.point, t);
        return if envelope.open_between(b, &from.sample, &to.sample, t) {
            Stretch::Open
        } else {
            Stretch::Unknown
        };
    }
    let wall = if to.sample.w > 0.0 { Wall::Plus } else { Wall::Minus };
    let shape = |mark: &Mark| {
        let Sample { w, dw, ddw } = mark.sample;
        let jerk = start.jerk(coefficients, &mark.point, ddw);
        [w, dw * t, ddw * (t * t / 2.0), jerk * (t * t * t / 6.0)]
    };
    match crossing(wall.sign() * b, shape(from), shape(to)) {
        Some(part) => Stretch::Contact(from.t + part * t, wall),
        None => Stretch::Unknown,
    }
}

/// The part of a stretch after which `w` crosses `target`, on the polynomial of degree 7 that has the same value and the same three
/// Taylor coefficients at both ends; the end is behind the target.
fn crossing(target: f64, from: [f64; 4], to: [f64; 4]) -> Option<f64> {
    let [w0, d0, a0, j0] = from;
    let [w1, d1, a1, j1] = to;
    let e0 = (w1 - w0) - (d0 + a0 + j0);
    let e1 = d1 - (d0 + 2.0 * a0 + 3.0 * j0);
    let e2 = a1 - (a0 + 3.0 * j0);
    let e3 = j1 - j0;
    let c4 = 35.0 * e0 - 15.0 * e1 + 5.0 * e2 - e3;
    let c5 = -84.0 * e0 + 39.0 * e1 - 14.0 * e2 + 3.0 * e3;
    let c6 = 70.0 * e0 - 34.0 * e1 + 13.0 * e2 - 3.0 * e3;
    let c7 = -20.0 * e0 + 10.0 * e1 - 4.0 * e2 + e3;
    let gap = target - w0;
    // From behind, so that a start on this very wall is not found again.
    let mut s = if gap == 0.0 { 1.0 } else { gap / (w1 - w0) };
    for _ in 0..3 {
        let high = c4 + s * (c5 + s * (c6 + s * c7));
        let dhigh = 4.0 * c4 + s * (5.0 * c5 + s * (6.0 * c6 + s * (7.0 * c7)));
        let (s2, s3) = (s * s, s * s * s);
        let value = s * d0 + s2 * (a0 + s * j0 + s2 * high) - gap;
        let slope = d0 + s * (2.0 * a0) + s2 * (3.0 * j0) + s3 * dhigh;
        s -= value / slope;
    }
    (s > 0.0 && s <= 1.0).then_some(s)
}
