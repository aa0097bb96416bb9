//! The next contact of a free flight: predicted, then verified.

use super::coefficients::{Coefficients, NEAR};
use super::propagator::{Increment, Nearby, Point, Propagator};
use super::verify::{Envelope, Sample, is_monotone};
use super::{FastPath, Moving, Next};
use crate::arithmetic::Sum;
use crate::base_motion::{BaseMotion, Phase, shift};
use crate::contact::Wall;
use crate::plant::{Masses, Rig};

/// Largest displacements, in half-widths: the digits of `w` are those of `q1`.
const WIDEST: f64 = 64.0;
/// Largest damping ratio: above it the bounds are too wide to verify anything.
const HEAVIEST: f64 = 0.5;
/// Longest flight that is marched over, in stretches.
const MOST_STRETCHES: u32 = 64;
/// Fine stretches in a coarse one.
pub(super) const FINE: usize = 3;
/// Longest stretch before a predicted contact that one bound can verify, in stretches.
const LONGEST_STRETCH: f64 = 2.0;
/// Attempts to come near enough to an arrival.
const MOST_ATTEMPTS: u32 = 4;

/// The start of a flight.
#[derive(Clone, Copy)]
pub(super) struct Start<'a> {
    pub rig: &'a Rig,
    pub base: &'a BaseMotion,
    pub masses: &'a Masses,
    pub point: Point,
    pub sample: Sample,
    /// Velocity of the base's line less that of the particle, m/s.
    drift: f64,
}

impl<'a> Start<'a> {
    #[inline(always)]
    fn new(moving: &'a Moving, point: Point) -> Self {
        let (masses, base) = (&*moving.masses, &*moving.base);
        Self {
            rig: moving.rig,
            base,
            masses,
            point,
            sample: Sample {
                w: masses.w.value(),
                dw: masses.dw,
                ddw: 0.0,
            },
            drift: base.drive.signal[1] - masses.particle,
        }
    }

    fn half_width(&self) -> f64 {
        self.rig.parameters.half_width
    }

    /// The wall that the particle is approaching.
    #[inline(always)]
    fn wall_ahead(&self) -> Wall {
        if self.sample.dw > 0.0 { Wall::Plus } else { Wall::Minus }
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

    /// Relative acceleration at a point of the flight, m/s².
    #[inline(always)]
    pub(super) fn acceleration(&self, coefficients: &Coefficients, point: &Point) -> f64 {
        let oscillator = &self.rig.alone;
        let (f, _) = coefficients.forcing_at(point.phasor);
        self.base.drive.amplitude * f - (oscillator.omega0_squared * point.y + 2.0 * oscillator.delta * point.dy)
    }

    /// Its rate of change at a mark, m/s³.
    #[inline(always)]
    fn jerk(&self, coefficients: &Coefficients, mark: &Mark) -> f64 {
        let oscillator = &self.rig.alone;
        let (_, df) = coefficients.forcing_at(mark.point.phasor);
        self.base.drive.amplitude * df
            - (oscillator.omega0_squared * mark.point.dy + 2.0 * oscillator.delta * mark.sample.ddw)
    }

    #[inline(always)]
    fn envelope(&self, point: &Point, t: f64) -> Envelope {
        Envelope::new(&self.rig.alone, &self.base.drive, point, t)
    }
}

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

/// What a flight leads to.
enum Found {
    /// A verified contact, within the step or beyond its end.
    Contact(Arrival),
    /// No contact for this time, s.
    Free(f64),
    /// No contact to the end of the step: what that adds, and the phase of the base then.
    FreeAsBefore(Increment, Phase),
    /// Nothing could be verified.
    Nothing,
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
    /// What comes next within `left` seconds of a step of `duration`.
    #[inline]
    pub fn next(&mut self, moving: &mut Moving, left: f64, duration: f64) -> Next {
        if !self.enabled {
            return Next::Search;
        }
        let point = self.point(moving);
        let (rig, base) = (moving.rig, &*moving.base);
        let soon = left * rig.alone.fastest.max(base.drive.omega.abs()) <= 1.0;
        if left < self.contact_free || (soon && self.is_contact_free(moving, &point, left)) {
            return self.coast(moving, &point, left, duration);
        }
        if !applies(rig, base, &point) {
            return Next::Search;
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
            Found::Contact(arrival) if arrival.t.value() <= left => self.land(moving, &arrival),
            Found::Contact(arrival) => {
                self.contact_free = arrival.t.value();
                self.coast(moving, &point, left, duration)
            }
            Found::Free(t) => {
                self.contact_free = t;
                self.coast(moving, &point, t.min(left), duration)
            }
            Found::FreeAsBefore(increment, phase) => {
                self.apply(moving, &increment, phase, left);
                Next::ContactFree(left)
            }
            Found::Nothing => Next::Search,
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
        self.contact_free = 0.0;
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
            self.cache.confirm();
            return Some(Found::FreeAsBefore(increment, phase));
        }
        let predicted = arrive(&self.coefficients, propagator, start, start.wall_ahead()).ok()?;
        if !monotone(predicted.arrival.t.value()) {
            start.sample.ddw = start.acceleration(&self.coefficients, &point);
            return Some(self.march(start, left, Some(&predicted)));
        }
        self.cache.confirm();
        Some(Found::Contact(predicted.arrival))
    }

    /// Marches over the flight until a contact is found or `left` seconds are over. Where a stretch cannot be verified, it is
    /// divided once.
    #[inline(never)]
    fn march(&mut self, start: &Start, left: f64, predicted: Option<&Predicted>) -> Found {
        self.cache.prepare_march(&start.rig.alone, &self.coefficients);
        let mut from = Mark {
            t: 0.0,
            point: start.point,
            sample: start.sample,
        };
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
        let jerk = start.jerk(coefficients, mark);
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

/// The contact at `wall`, if it is so near the time of `propagator` that its digits can be trusted; else a better guess of
/// its time, s.
///
/// From the propagator's time on the motion is its Taylor polynomial, and the root the polynomial's reversed series (P. Henrici,
/// "Applied and Computational Complex Analysis" I, Wiley 1974, section 1.7).
#[inline(always)]
fn arrive(coefficients: &Coefficients, propagator: &Propagator, start: &Start, wall: Wall) -> Result<Predicted, f64> {
    let amplitude = start.base.drive.amplitude;
    let increment = propagator.increment(amplitude, &start.point);
    let w = start.sample.w + (increment.y + start.drift * propagator.t);
    let slowness = 1.0 / (start.point.dy + increment.dy + start.drift);
    let first = (wall.sign() * start.half_width() - w) * slowness;
    // Not a number where the approach has no speed.
    let close = first.abs() < 256.0 * coefficients.near;
    if !close {
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
    if !(first.abs() < coefficients.near && bend.abs() < NEAR) {
        return Err(propagator.t + h);
    }
    let at = nearby.at(h);
    let t = Sum::of(propagator.t, h);
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
