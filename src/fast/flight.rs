//! The next contact of a free flight: predicted, then verified.

use super::propagator::{
    Coefficients, GRID_POINTS, Increment, Nearby, PROPAGATOR_REACH, PhasePoint, Propagator, STRETCH_POINTS,
    TAYLOR_TERMS, angle,
};
use super::verify::{Horizon, Mark, RelativeMotion, Start};
use super::{FastPath, Next, without};
use crate::arithmetic::Sum;
use crate::base_motion::BaseMotion;
use crate::contact::Wall;
use crate::system::{Moving, System};

/// Largest displacements, in half-widths: the digits of `w` are those of `q1`.
const WIDEST: f64 = 64.0;
/// Largest damping ratio: above it the stretches of a march are too short, and the plain solver needs fewer evaluations.
const HEAVIEST: f64 = 6.0;

/// What a flight leads to.
pub(super) enum FlightEnd {
    /// A verified contact, within the step or beyond its end.
    Contact(Arrival),
    /// No contact for this time, s.
    Free(f64),
    /// Nothing could be verified.
    Nothing,
}

impl FastPath {
    /// What comes next within `left` seconds of a step of `duration`.
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    pub fn next(&mut self, moving: &mut Moving, left: f64, duration: f64) -> Next {
        if !self.serves {
            return Next::Search(left);
        }
        let to_search = core::mem::take(&mut self.state.to_search);
        if to_search > 0.0 {
            return Next::Search(to_search.min(left));
        }
        let point = self.point(moving);
        let (system, base) = (&moving.system, &moving.base);
        let soon = left * system.free.fastest.max(base.drive.omega.abs()) <= 1.0;
        if left < self.state.contact_free.t || (soon && self.is_contact_free(moving, left)) {
            return self.coast(moving, &point, left, duration);
        }
        if !applies(system, base, &point) {
            return Next::Search(left);
        }
        self.coefficients.prepare(&system.free, base.drive.omega);
        if let Some(next) = self.as_before(moving, &point, left, duration) {
            return next;
        }
        let mut start = Start::new(moving, point);
        let found = match out_of_reach(&self.coefficients, &start) {
            Some(t) if t > self.coefficients.stretch => FlightEnd::Free(t),
            _ => {
                start.here.sample.ddw = start.acceleration(&self.coefficients, &point);
                let hop = self.hop(&start, left).map(FlightEnd::Contact);
                hop.unwrap_or_else(|| self.march(&start, left, None))
            }
        };
        self.take(moving, &point, &found, left, duration)
    }

    /// The contact within `left` seconds of a particle with a constant acceleration and friction in `direction`, if it certainly moves
    /// towards the wall ahead all the time: the plant has moved on to it.
    pub fn next_with_forces(&mut self, moving: &mut Moving, left: f64, direction: f64) -> Option<(Sum, Wall)> {
        let (system, base) = (&moving.system, &moving.base);
        let mut point = self.point(moving);
        point.y -= system.shift(-system.friction(direction));
        if self.state.disabled || without("forces") || !applies(system, base, &point) {
            return None;
        }
        self.coefficients.prepare(&system.free, base.drive.omega);
        let pull = system.forces.gravity + system.friction(direction);
        let start = Start { pull, ..Start::new(moving, point) };
        self.evaluations += 1;
        let expected = (self.cache)
            .expected(&self.state.sequence, &system.free, &self.coefficients)
            .and_then(|propagator| arrive::<true>(&self.coefficients, propagator, &start))
            .filter(|arrival| start.is_monotone(&start.here, arrival.t.value()));
        let Arrival { t, wall, added, angle } = match expected {
            Some(arrival) => arrival,
            None => self.rest(&start, &start.here)?,
        };
        if t.value() > left {
            return None;
        }
        self.state.sequence.learn(&self.coefficients, t.value());
        self.apply(moving, &added, angle, t.value());
        moving.masses.dw -= pull * t.value();
        moving.masses.particle += pull * t.value();
        Some((t, wall))
    }

    /// Does what was found.
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    fn take(&mut self, moving: &mut Moving, point: &PhasePoint, found: &FlightEnd, left: f64, duration: f64) -> Next {
        match found {
            FlightEnd::Contact(arrival) => self.meet(moving, point, arrival, left, duration),
            FlightEnd::Free(t) => {
                self.state.contact_free = Horizon::unchanged(*t);
                self.coast(moving, point, t.min(left), duration)
            }
            FlightEnd::Nothing => Next::Search(left),
        }
    }

    /// Moves on to a verified contact, or to the end of the step before it.
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    fn meet(&mut self, moving: &mut Moving, point: &PhasePoint, arrival: &Arrival, left: f64, duration: f64) -> Next {
        let t = arrival.t.value();
        if t > left {
            self.state.contact_free = Horizon::unchanged(t);
            return self.coast(moving, point, left, duration);
        }
        self.state.sequence.learn(&self.coefficients, t);
        self.apply(moving, &arrival.added, arrival.angle, t);
        self.state.contact_free = Horizon::default();
        Next::Contact(arrival.t, arrival.wall)
    }

    /// The flight that followed the last one before, or the end of a step that did, if it lies ahead again.
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    fn as_before(&mut self, moving: &mut Moving, point: &PhasePoint, left: f64, duration: f64) -> Option<Next> {
        let propagator = (self.cache).expected(&self.state.sequence, &moving.system.free, &self.coefficients)?;
        self.evaluations += 1;
        let mut start = Start::new(moving, *point);
        let drive = &start.base.drive;
        if (propagator.t - left).abs() < self.coefficients.near {
            let h = left - propagator.t;
            let increment = propagator.increment(drive.amplitude, point);
            let increment = Nearby::<4>::new(&self.coefficients, drive.amplitude, point, &increment).at(h);
            let w = start.here.sample.w + (increment.y + start.drift * left);
            if w.abs() >= start.system.half_width || !start.is_monotone(&start.here, left) {
                return None;
            }
            let angle = propagator.angle.plus(self.coefficients.omega * h);
            self.state.sequence.learn(&self.coefficients, left);
            let dx = self.apply(moving, &increment, angle, left);
            self.drift(moving, dx, left);
            return Some(Next::ContactFree(left));
        }
        let arrival = arrive::<false>(&self.coefficients, propagator, &start)?;
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
fn applies(system: &System, base: &BaseMotion, point: &PhasePoint) -> bool {
    let oscillator = &system.free;
    let [offset, slope, ..] = base.drive.signal;
    let widest = WIDEST * system.half_width;
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
    let (b, here) = (start.system.half_width, &start.here);
    let steady = coefficients.forcing.steady()? * start.base.drive.amplitude;
    let particle = here.point.y - here.sample.w;
    let room = b * (1.0 - 1e-9) - particle.abs() - steady.l1_norm();
    if room <= 0.0 || start.base.drive.signal[1] != 0.0 {
        return None;
    }
    let PhasePoint { y, dy, phasor: (cos, sin) } = here.point;
    let y = y - (steady.re * sin + steady.im * cos);
    let dy = dy - coefficients.omega * (steady.re * cos - steady.im * sin);
    let omega0 = start.system.free.omega0;
    let room = room - (y * y + (dy / omega0) * (dy / omega0)).sqrt();
    (room > 0.0).then(|| room / start.drift.abs())
}

// Hop: the particle has left the wall that presses on it, and comes back at once.
//
// Seen from the wall it falls with an acceleration `a` that hardly changes in so short a time: `u h - a h²/2 - j h³/6 - ...`
// with `u` the rebound speed. Divided by `h` this falls steadily while `|w'''| h` stays below `a/8`, so that the return is
// the first contact; the other wall is out of reach if the height `u²/(2a)` is below the half-width.

/// Longest hop, in units of the fastest rate's time: it ends within reach of the start's Taylor polynomial.
const LONGEST_HOP: f64 = 1.0 / 20.0;

impl FastPath {
    /// The return to the wall that the particle has just left, if it is a short hop that ends within `left` seconds.
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    pub(super) fn hop(&mut self, start: &Start, left: f64) -> Option<Arrival> {
        let (here, b) = (&start.here.sample, start.system.half_width);
        if here.w.abs() != b || without("hop") {
            return None;
        }
        let s = 1f64.copysign(here.w);
        let (speed, pressing) = (-s * here.dw, s * here.ddw);
        let about = 2.0 * speed / pressing;
        let fastest = (start.system.free.fastest).max(start.base.drive.omega.abs());
        let short = speed > 0.0
            && pressing > 0.0
            && about * fastest <= LONGEST_HOP
            && 1.25 * about < left
            && speed * speed < pressing * b;
        if short { self.short_hop(start, about) } else { None }
    }

    #[inline(never)]
    fn short_hop(&mut self, start: &Start, about: f64) -> Option<Arrival> {
        let here = &start.here;
        if start.jerk(here, 1.25 * about) * about > 0.125 * here.sample.ddw.abs() {
            return None;
        }
        let (at, nearby) = self.near_point(start, here, 0.0);
        self.polish(start, here, Wall::ahead(here.sample.w), (at, &nearby), (0.0, about))
    }
}

// March: over a flight in equal stretches, each verified by a bound, until the rest of the flight is verified at once.

/// Longest flight that is marched over, in stretches.
const MOST_STRETCHES: u32 = 64;
/// Shortest stretch, in distances between points of the grid.
const SHORTEST_STRETCH: usize = 3;
/// So many divisions in a march, and the plain solver is cheaper.
const MOST_DIVIDED: u32 = 16;
/// Longest stretch before a predicted contact that one bound can verify, in stretches.
const LONGEST_STRETCH: f64 = 2.0;
/// Up to this time after a mark, in distances between points, the mark itself serves as the point.
const NEAR_MARK: f64 = 0.65;
/// Steps of Newton's method for a rough crossing.
const ROUGH_ITERATIONS: u32 = 2;

/// How a stretch of a march ends.
enum Stretch {
    Open,
    /// A contact is expected at this time, s, at this wall.
    Contact(f64, Wall),
    Unknown,
}

impl FastPath {
    /// Marches over the flight until a contact is found or `left` seconds are over. Where a stretch cannot be verified, it is
    /// halved, down to [`SHORTEST_STRETCH`].
    #[inline(never)]
    pub(super) fn march(&mut self, start: &Start, left: f64, predicted: Option<&Arrival>) -> FlightEnd {
        if without("march") {
            return FlightEnd::Nothing;
        }
        let mut from = start.here;
        // Points of the grid in the next stretch.
        let mut n = STRETCH_POINTS;
        let mut divided = 0;
        for _ in 0..MOST_STRETCHES {
            if let Some(arrival) = predicted
                && arrival.t.value() - from.t <= LONGEST_STRETCH * self.coefficients.stretch
                && arrival.is_first(start, &self.coefficients, &from)
            {
                return FlightEnd::Contact(*arrival);
            }
            // The start of a predicted flight has been tried.
            if (predicted.is_none() || from.t > 0.0)
                && let Some(arrival) = self.rest(start, &from)
            {
                return FlightEnd::Contact(arrival);
            }
            let to = self.mark(start, &from, n);
            let found = match stretch(start, &from, &to) {
                Stretch::Open => {
                    from = to;
                    if from.t >= left {
                        break;
                    }
                    n = STRETCH_POINTS.min(2 * n);
                    continue;
                }
                Stretch::Contact(t, wall) => (self.arrive_after(start, &from, t, wall))
                    .filter(|arrival| arrival.is_first(start, &self.coefficients, &from)),
                Stretch::Unknown => None,
            };
            match found {
                Some(arrival) => return FlightEnd::Contact(arrival),
                None if n > SHORTEST_STRETCH && divided < MOST_DIVIDED => {
                    n /= 2;
                    divided += 1;
                }
                // What is verified is kept: the plain solver searches as little as possible.
                None if from.t > 0.0 => {
                    self.state.to_search = self.coefficients.stretch;
                    break;
                }
                None => return FlightEnd::Nothing,
            }
        }
        FlightEnd::Free(from.t)
    }

    /// The contact after a mark, if it is near and the particle certainly drifts towards it all the time.
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    fn rest(&mut self, start: &Start, from: &Mark) -> Option<Arrival> {
        let wall = Wall::ahead(start.drift);
        // If the primary mass stood still.
        let t = (wall.sign() * start.system.half_width - from.sample.w) / start.drift;
        if t > self.coefficients.span || !start.is_monotone(from, from.t + t) {
            return None;
        }
        let arrival = self.arrive_after(start, from, from.t + t, wall)?;
        start.is_monotone(from, arrival.t.value()).then_some(arrival)
    }

    /// The time of a point of the grid after a mark, and the motion near it: the point is the nearest one to the time `t`.
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    pub(super) fn near_point(&mut self, start: &Start, from: &Mark, t: f64) -> (f64, Nearby<TAYLOR_TERMS>) {
        self.evaluations += 1;
        let (coefficients, amplitude) = (&self.coefficients, start.base.drive.amplitude);
        // Near the mark the mark itself: it needs no propagator.
        let n = match (t - from.t) / coefficients.spacing {
            part if part < NEAR_MARK => 0,
            part => ((part + 0.5) as usize).min(GRID_POINTS),
        };
        let increment = match n {
            0 => Increment { y: 0.0, dy: 0.0, phasor: from.point.phasor },
            _ => (self.cache.grid)
                .over(&start.system.free, coefficients, n)
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
            mark = self.mark(start, &mark, GRID_POINTS);
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
        self.state.rotations += 1;
        let propagator = (self.cache.grid).over(&start.system.free, &self.coefficients, n);
        let increment = propagator.increment(start.base.drive.amplitude, &from.point);
        start.mark(&self.coefficients, increment.to(&from.point), from.t + propagator.t)
    }
}

/// What happens between two marks.
#[cfg_attr(not(target_arch = "wasm32"), inline(always))]
fn stretch(start: &Start, from: &Mark, to: &Mark) -> Stretch {
    let (b, t) = (start.system.half_width, to.t - from.t);
    if to.sample.w.abs() < b {
        return if start.is_open(from, &to.sample, to.t) {
            Stretch::Open
        } else {
            Stretch::Unknown
        };
    }
    let wall = Wall::ahead(to.sample.w);
    let shape = |RelativeMotion { w, dw, ddw }: RelativeMotion| [w, dw * t, ddw * (t * t / 2.0)];
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
    for _ in 0..ROUGH_ITERATIONS {
        let square = s * s;
        let value = s * ((d0 + s * a0) + square * ((c3 + s * c4) + square * c5)) - gap;
        let slope = (d0 + s * (2.0 * a0)) + square * ((3.0 * c3 + s * (4.0 * c4)) + square * (5.0 * c5));
        s -= value / slope;
    }
    (s > 0.0 && s <= 1.0).then_some(s)
}

// Arrival: at a wall, found from a point near it at which the motion is known.

/// Points of the grid that are tried.
const MOST_POINTS: u32 = 4;
/// Steps of Newton's method.
const MOST_ITERATIONS: u32 = 6;
/// Largest remaining error, relative to the time since the mark.
const LARGEST_ERROR: f64 = 1e-16;
/// Longest last step, in reaches of a Taylor polynomial: what it adds is known to second order.
const LONGEST_LAST_STEP: f64 = 1e-6;

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
        let sample = RelativeMotion {
            w: self.wall.sign() * start.system.half_width,
            dw: start.here.sample.dw + self.added.dy,
            ddw: start.acceleration(coefficients, &there),
        };
        start.is_open(from, &sample, self.t.value())
    }
}

/// The contact at the wall ahead, if it is so near the time of `propagator` that its digits can be trusted.
#[inline(always)]
pub(super) fn arrive<const FORCED: bool>(
    coefficients: &Coefficients,
    propagator: &Propagator,
    start: &Start,
) -> Option<Arrival> {
    let (amplitude, here) = (start.base.drive.amplitude, &start.here);
    let wall = Wall::ahead(here.sample.dw);
    let increment = propagator.increment(amplitude, &here.point);
    let (t, half) = (propagator.t, if FORCED { 0.5 * start.pull } else { 0.0 });
    // Without forces these terms cost nothing.
    let drift = |rate: f64| if FORCED { start.drift - rate * t } else { start.drift };
    let w = here.sample.w + (increment.y + drift(half) * t);
    let slowness = 1.0 / (here.point.dy + increment.dy + drift(start.pull));
    let first = (wall.sign() * start.system.half_width - w) * slowness;
    // Not a number where the approach has no speed.
    let close = first.abs() < coefficients.near;
    if !close {
        return None;
    }
    let nearby = Nearby::<4>::new(coefficients, amplitude, &here.point, &increment);
    // Where the approach is slow and curved, the reversed series is not accurate.
    let [c2, c3, c4, _] = nearby.c;
    let c2 = c2 - half;
    if (c2 * slowness * first).abs() >= PROPAGATOR_REACH {
        return None;
    }
    let h = reversed(&[c2, c3, c4], first, slowness);
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
        let ahead = wall.sign() * start.system.half_width - from.sample.w;
        for _ in 0..MOST_POINTS {
            let (at, nearby) = self.near_point(start, from, t);
            let (elapsed, half) = (at - from.t, 0.5 * start.pull);
            let gap = ahead - (nearby.there.y + (start.drift - half * elapsed) * elapsed);
            let slowness = 1.0 / (from.sample.dw + nearby.there.dy - start.pull * elapsed);
            let [c2, c3, c4, ..] = nearby.c;
            let h = reversed(&[c2 - half, c3, c4], gap * slowness, slowness);
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
        let speed = from.sample.dw + there.dy - start.pull * (at - from.t);
        let half = 0.5 * start.pull;
        for _ in 0..MOST_ITERATIONS {
            let (deviation, gained) = nearby.change(h);
            let slowness = 1.0 / (speed + (gained - start.pull * h));
            let step = ((gap - h * speed) - (deviation - half * h * h)) * slowness;
            let within = (h + step).abs() <= self.coefficients.reach;
            if !within {
                break;
            }
            // Newton's method squares the error.
            let error = ((nearby.c[0] - half) * slowness * (step * step)).abs();
            if error <= LARGEST_ERROR * (at - from.t + h) && step.abs() <= LONGEST_LAST_STEP * self.coefficients.reach {
                let phasor = nearby.phasor(h + step);
                let (y, dy) = (there.y + (h * nearby.dy + deviation), nearby.dy + gained);
                let ddw = start.acceleration(&self.coefficients, &PhasePoint { y: from.point.y + y, dy, phasor });
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parameters::Parameters;
    use crate::plant::{Plant, State};

    #[test]
    fn a_hop_is_predicted_only_if_the_acceleration_towards_the_wall_hardly_changes_in_it() {
        // Both particles come back: in the second case sooner, because the acceleration grows by far more than an eighth.
        for (q1, dq1, is_predicted) in [(-0.4, 0.0, true), (-0.05, -1.0, false)] {
            let start = State { q1, dq1, q2: q1 - 1.0, dq2: dq1 + 1e-3 };
            let mut plant = Plant::new(Parameters::dimensionless(0.1, 0.0, 0.5), start).expect("a plant");
            let Plant { moving, fast, .. } = &mut plant;
            let point = fast.point(moving);
            fast.coefficients.prepare(&moving.system.free, 0.0);
            let mut start = Start::new(moving, point);
            start.here.sample.ddw = start.acceleration(&fast.coefficients, &point);
            let hop = fast.hop(&start, 1.0).map(|arrival| arrival.t.value());
            assert_eq!(hop.is_some(), is_predicted, "{q1} {hop:?}");
            assert!(hop.is_none_or(|t| (t / 5e-3 - 1.0).abs() < 1e-2), "{hop:?}");
        }
    }
}
