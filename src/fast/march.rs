//! A march over a flight in equal stretches, each verified by a bound.

use super::FastPath;
use super::arrival::{Arrival, Predicted};
use super::flight::Found;
use super::grid::{Mark, POINTS};
use super::start::Start;
use super::verify::Sample;
use crate::contact::Wall;

/// Longest flight that is marched over, in stretches.
const MOST_STRETCHES: u32 = 64;
/// Shortest stretch, in distances between points of the grid.
const SHORTEST: usize = 3;
/// So many divisions in a march, and the plain solver is cheaper.
const MOST_DIVIDED: u32 = 16;
/// Longest stretch before a predicted contact that one bound can verify, in stretches.
const LONGEST_STRETCH: f64 = 2.0;

/// Steps of Newton's method for a rough crossing.
const ROUGHLY: u32 = 3;

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
    pub(super) fn march(&mut self, start: &Start, left: f64, predicted: Option<&Predicted>) -> Found {
        let mut from = Mark { t: 0.0, point: start.point, sample: start.sample };
        // Points of the grid in the next stretch.
        let mut n = POINTS;
        let mut divided = 0;
        for _ in 0..MOST_STRETCHES {
            if let Some(predicted) = predicted
                && predicted.arrival.t.value() - from.t <= LONGEST_STRETCH * self.coefficients.stretch
                && verified(start, &from, predicted)
            {
                return Found::Contact(predicted.arrival);
            }
            let to = self.mark(start, &from, n);
            let found = match stretch(start, &from, &to) {
                Stretch::Open => {
                    from = to;
                    if from.t >= left {
                        break;
                    }
                    n = POINTS.min(2 * n);
                    continue;
                }
                Stretch::Contact(t, wall) => self.approach(start, &from, t, wall),
                Stretch::Unknown => None,
            };
            match found {
                Some(arrival) => return Found::Contact(arrival),
                None if n > SHORTEST && divided < MOST_DIVIDED => {
                    n /= 2;
                    divided += 1;
                }
                // What is verified is kept: the plain solver searches as little as possible.
                None if from.t > 0.0 => break,
                None => return Found::Nothing,
            }
        }
        Found::Free(from.t)
    }

    /// The contact at `wall` about `t` seconds after the start, verified from the last mark on.
    #[inline(always)]
    fn approach(&mut self, start: &Start, from: &Mark, t: f64, wall: Wall) -> Option<Arrival> {
        let predicted = self.arrive_after(start, from, t, wall)?;
        verified(start, from, &predicted).then_some(predicted.arrival)
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
fn stretch(start: &Start, from: &Mark, to: &Mark) -> Stretch {
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
        let value = s * (d0 + s * (a0 + s * (c3 + s * (c4 + s * c5)))) - gap;
        let slope = d0 + s * (2.0 * a0 + s * (3.0 * c3 + s * (4.0 * c4 + s * (5.0 * c5))));
        s -= value / slope;
    }
    (s > 0.0 && s <= 1.0).then_some(s)
}
