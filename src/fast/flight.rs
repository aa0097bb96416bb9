//! The next contact of a free flight: predicted, then verified.

use super::coefficients::Coefficients;
use super::propagator::{Nearby, Point, Propagator};
use super::verify::{Envelope, Sample};
use super::{Arrival, FastPath, Next};
use crate::arithmetic::Sum;
use crate::base_motion::BaseMotion;
use crate::contact::Wall;
use crate::plant::{Masses, Rig};

/// Largest displacements, in half-widths: the digits of `w` are those of `q1`.
const WIDEST: f64 = 64.0;
/// Largest damping ratio: above it the bounds are too wide to verify anything.
const HEAVIEST: f64 = 0.5;
/// Longest flight that is marched over, in stretches.
const MOST_STRETCHES: u32 = 64;
/// Fine stretches in a coarse one.
pub(super) const FINE: usize = 4;
/// Attempts to come near enough to an arrival.
const MOST_ATTEMPTS: u32 = 4;

/// The start of a flight.
struct Start<'a> {
    rig: &'a Rig,
    base: &'a BaseMotion,
    masses: &'a Masses,
    point: Point,
    sample: Sample,
    /// Velocity of the base's line less that of the particle, m/s.
    drift: f64,
}

impl Start<'_> {
    fn half_width(&self) -> f64 {
        self.rig.parameters.half_width
    }

    /// Relative motion at a point of the flight, `t` seconds on.
    #[inline(always)]
    fn sample(&self, coefficients: &Coefficients, point: &Point, t: f64) -> Sample {
        Sample {
            w: self.sample.w + ((point.y - self.point.y) + self.drift * t),
            dw: point.dy + self.drift,
            ddw: self.acceleration(coefficients, point),
        }
    }

    #[inline(always)]
    fn acceleration(&self, coefficients: &Coefficients, point: &Point) -> f64 {
        let oscillator = &self.rig.alone;
        let (f, _) = coefficients.forcing_at(point.phasor);
        self.base.drive.amplitude * f
            - (oscillator.omega0_squared * point.y + 2.0 * oscillator.delta * point.dy)
    }

    #[inline(always)]
    fn envelope(&self, point: &Point, t: f64) -> Envelope {
        Envelope::new(&self.rig.alone, &self.base.drive, point, t)
    }
}

/// A contact that was predicted, with the motion just before it.
struct Predicted {
    arrival: Arrival,
    sample: Sample,
}

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
    /// What comes next within `left` seconds.
    #[inline]
    pub fn next(&mut self, rig: &Rig, masses: &Masses, base: &BaseMotion, left: f64) -> Next {
        if !self.enabled {
            return Next::Search;
        }
        if left < self.contact_free {
            return Next::ContactFree(left);
        }
        let point = self.point(masses, base);
        let fastest = rig.alone.fastest.max(base.drive.omega.abs());
        let soon = left * fastest <= 1.0;
        if soon && self.is_contact_free(rig, masses, base, &point, left) {
            return Next::ContactFree(left);
        }
        if !applies(rig, base, &point) {
            return Next::Search;
        }
        self.coefficients.prepare(&rig.alone, base.drive.omega);
        let mut start = Start {
            rig,
            base,
            masses,
            point,
            sample: Sample {
                w: masses.w.value(),
                dw: masses.dw,
                ddw: 0.0,
            },
            drift: base.drive.signal[1] - masses.particle,
        };
        start.sample.ddw = start.acceleration(&self.coefficients, &point);
        if !soon {
            if let Some(next) = self.as_before(&start, left) {
                return next;
            }
            if self.is_contact_free(rig, masses, base, &point, left) {
                return Next::ContactFree(left);
            }
        }
        if let Some(hop) = self.hop(rig, masses, base, start.sample.ddw, left) {
            return Next::Impact(hop);
        }
        self.march(&start, left)
    }

    /// The flight that followed the last one before, if it lies ahead again.
    #[inline(always)]
    fn as_before(&mut self, start: &Start, left: f64) -> Option<Next> {
        let wall = if start.sample.dw > 0.0 {
            Wall::Plus
        } else {
            Wall::Minus
        };
        let propagator = (self.cache).expected(&start.rig.alone, &self.coefficients)?;
        self.evaluations += 1;
        let predicted = arrive(&self.coefficients, propagator, start, wall).ok()?;
        if !verified(start, &start.point, &start.sample, (0.0, &predicted)) {
            return None;
        }
        self.cache.confirm();
        Some(self.decide(predicted.arrival, left))
    }

    /// A verified contact lies within the step or beyond its end.
    #[inline(always)]
    fn decide(&mut self, arrival: Arrival, left: f64) -> Next {
        let t = arrival.t.value();
        if t <= left {
            Next::Impact(arrival)
        } else {
            self.contact_free = t;
            Next::ContactFree(left)
        }
    }

    /// Marches over the flight until a contact is found or `left` seconds are over. Where a stretch cannot be verified, it is
    /// divided once.
    #[inline(never)]
    fn march(&mut self, start: &Start, left: f64) -> Next {
        self.cache.prepare_march(&start.rig.alone, &self.coefficients);
        let mut from = Mark {
            t: 0.0,
            point: start.point,
            sample: start.sample,
        };
        let mut fine = 0;
        for _ in 0..MOST_STRETCHES {
            let to = self.mark(start, &from, usize::from(fine > 0));
            let found = match stretch(start, &from, &to) {
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
                Some(arrival) => return self.decide(arrival, left),
                None if fine == 0 => fine = FINE,
                None => return Next::Search,
            }
        }
        self.contact_free = from.t;
        Next::ContactFree(from.t.min(left))
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
                    let sure = verified(start, &from.point, &from.sample, (from.t, &predicted));
                    return sure.then_some(predicted.arrival);
                }
                Err(better) if (better - from.t).abs() < self.coefficients.stretch => t = better,
                Err(_) => return None,
            }
        }
        None
    }
}

/// Whether the motion is such that bounds can verify anything, and displacements such that `w` has all its digits.
#[inline(always)]
fn applies(rig: &Rig, base: &BaseMotion, point: &Point) -> bool {
    let oscillator = &rig.alone;
    let [offset, slope, u2, u3] = base.drive.signal;
    let widest = WIDEST * rig.parameters.half_width;
    let fastest = widest * oscillator.omega0;
    u2 == 0.0
        && u3 == 0.0
        && base.drive.omega >= 0.0
        && oscillator.delta <= HEAVIEST * oscillator.omega0
        && offset.abs().max(base.drive.amplitude.abs()).max(point.y.abs()) <= widest
        && slope.abs().max(point.dy.abs()) <= fastest
}

/// Whether no wall is met between an instant of the flight, `from` seconds after its start, and a predicted contact.
#[inline(always)]
fn verified(
    start: &Start,
    point: &Point,
    sample: &Sample,
    (from, predicted): (f64, &Predicted),
) -> bool {
    let t = predicted.arrival.t.value() - from;
    let envelope = start.envelope(point, t);
    t > 0.0 && envelope.open_between(start.half_width(), sample, &predicted.sample, t)
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
    let wall = if to.sample.w > 0.0 {
        Wall::Plus
    } else {
        Wall::Minus
    };
    match crossing(wall.sign() * b, &from.sample, &to.sample, t) {
        Some(after) => Stretch::Contact(from.t + after, wall),
        None => Stretch::Unknown,
    }
}

/// When `w` crosses `target` on the quintic through both samples, `t` seconds apart; `to` is behind the target.
fn crossing(target: f64, from: &Sample, to: &Sample, t: f64) -> Option<f64> {
    let (d0, d1) = (from.dw * t, to.dw * t);
    let (a0, a1) = (0.5 * from.ddw * t * t, 0.5 * to.ddw * t * t);
    let rise = (to.w - from.w) - d0 - a0;
    let slope = d1 - d0 - 2.0 * a0;
    let curvature = a1 - a0;
    let (c3, c4, c5) = (
        10.0 * rise - 4.0 * slope + curvature,
        -15.0 * rise + 7.0 * slope - 2.0 * curvature,
        6.0 * rise - 3.0 * slope + curvature,
    );
    let gap = target - from.w;
    // From behind, so that a start on this very wall is not found again.
    let mut s = if gap == 0.0 { 1.0 } else { gap / (to.w - from.w) };
    for _ in 0..4 {
        let value = s * (d0 + s * (a0 + s * (c3 + s * (c4 + s * c5)))) - gap;
        let slope = d0 + s * (2.0 * a0 + s * (3.0 * c3 + s * (4.0 * c4 + s * (5.0 * c5))));
        s -= value / slope;
    }
    (s > 0.0 && s <= 1.0).then_some(s * t)
}

/// The contact at `wall`, if it is so near the time of `propagator` that its digits can be trusted; else a better guess of
/// its time, s.
///
/// From the propagator's time on the motion is its Taylor polynomial, and the root the polynomial's reversed series (P. Henrici,
/// "Applied and Computational Complex Analysis" I, Wiley 1974, section 1.7).
#[inline(always)]
fn arrive(
    coefficients: &Coefficients,
    propagator: &Propagator,
    start: &Start,
    wall: Wall,
) -> Result<Predicted, f64> {
    let amplitude = start.base.drive.amplitude;
    let increment = propagator.increment(amplitude, &start.point);
    let w = start.sample.w + (increment.y + start.drift * propagator.t);
    let slowness = 1.0 / (start.point.dy + increment.dy + start.drift);
    let first = (wall.sign() * start.half_width() - w) * slowness;
    if !(first.abs() < 256.0 * coefficients.near) {
        return Err(propagator.t + first);
    }
    let nearby = Nearby::new(coefficients, amplitude, &start.point, &increment);
    let [c2, c3, c4, _] = nearby.c;
    let (a2, a3, a4) = (c2 * slowness, c3 * slowness, c4 * slowness);
    let (bend, a22, first2) = (a2 * first, a2 * a2, first * first);
    let third = (a22 + a22) - a3;
    let fourth = 5.0 * (a2 * (a3 - a22)) - a4;
    let h = first * ((1.0 - bend) + first2 * (third + first * fourth));
    // Far away, or where the approach is slow and curved, the reversed series is not accurate.
    if !(first.abs() < coefficients.near && bend.abs() < 1.0 / 4096.0) {
        return Err(propagator.t + h);
    }
    let at = nearby.at(h);
    let t = Sum::new(propagator.t, h);
    let dw = start.sample.dw + at.dy;
    let masses = start.masses;
    Ok(Predicted {
        sample: Sample {
            w: wall.sign() * start.half_width(),
            dw,
            ddw: 2.0 * c2 + h * (6.0 * c3),
        },
        arrival: Arrival {
            t,
            x: masses.x.plus(at.y + start.base.drive.signal[1] * t.value()),
            v: masses.v.plus(at.dy),
            dw,
            wall,
            phase: (start.base.phase).rotated(propagator.angle, coefficients.omega * h),
            phasor: at.phasor,
        },
    })
}
