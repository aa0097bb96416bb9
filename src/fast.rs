//! The fast path: predict with whatever is cheap, then verify with a bound.
//!
//! The next contact is *predicted* from cached propagators: the flight time that followed the last one, or a march over the
//! flight in equal stretches. A prediction may be wrong. It is *verified* with a bound ([`verify`]): between two instants at which the
//! motion is known exactly, the gaps to both walls are certainly open if a Taylor bound from the left and one from the right say
//! so, each over half of the time. What cannot be verified is left to the plain solver's search. Results therefore never
//! depend on a guess, only the cost does.
//!
//! Everything kept between steps lives in [`Cache`], and each entry carries its key: the time it belongs to and
//! the frequency of the base. An entry whose key differs is not used; nothing else invalidates it.

mod cache;
mod coefficients;
mod flight;
mod hop;
mod propagator;
mod short_step;
mod verify;

use crate::arithmetic::Sum;
use crate::base_motion::{BaseMotion, Phase};
use crate::contact::Wall;
use crate::plant::{Masses, Rig};
use crate::segment::Segment;
#[cfg(feature = "serde")]
pub(crate) use cache::Keys;
use cache::Cache;
use coefficients::Coefficients;
use propagator::{Increment, Point};
use verify::Envelope;

/// How often a phasor is rotated before it is computed from the phase again.
const ROTATIONS: u32 = 16;
/// Contact is looked for so many steps ahead: where it is far, most steps need not look at all.
const AHEAD: f64 = 4.0;

/// What comes next.
pub(crate) enum Next {
    /// No contact for this time, s.
    ContactFree(f64),
    /// A verified contact.
    Impact(Arrival),
    /// Unknown: the plain solver has to search.
    Search,
}

/// The state just before a contact.
pub(crate) struct Arrival {
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
    phasor: (f64, f64),
}

/// Predictions, and what they are made from.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FastPath {
    pub enabled: bool,
    /// No contact for this time from now on, s.
    contact_free: f64,
    /// `e^{i phase}` of the base: cosine and sine.
    phasor: (f64, f64),
    /// Rotations since it was computed from the phase.
    rotations: u32,
    coefficients: Coefficients,
    cache: Cache,
    evaluations: u64,
}

impl Default for FastPath {
    fn default() -> Self {
        Self {
            enabled: true,
            contact_free: 0.0,
            phasor: (1.0, 0.0),
            rotations: 0,
            coefficients: Coefficients::default(),
            cache: Cache::default(),
            evaluations: 0,
        }
    }
}

impl FastPath {
    /// `e^{i phase}` of the base: cosine and sine.
    #[inline(always)]
    pub fn phasor(&self) -> (f64, f64) {
        self.phasor
    }

    /// Evaluations of the motion since the last call.
    pub fn evaluations(&mut self) -> u64 {
        core::mem::take(&mut self.evaluations)
    }

    /// The state was changed from outside.
    pub fn state_changed(&mut self, base: &BaseMotion) {
        self.contact_free = 0.0;
        self.resynchronise(base.phase);
    }

    /// The parameters were changed.
    pub fn parameters_changed(&mut self, base: &BaseMotion) {
        *self = Self {
            enabled: self.enabled,
            ..Self::default()
        };
        self.state_changed(base);
    }

    /// The drive was changed.
    #[inline(always)]
    pub fn drive_changed(&mut self) {
        self.contact_free = 0.0;
    }

    /// The plant has moved on to this contact.
    #[inline(always)]
    pub fn arrived(&mut self, arrival: &Arrival) {
        self.contact_free = 0.0;
        self.phasor = arrival.phasor;
        self.rotated(arrival.phase);
    }

    #[inline(always)]
    fn rotated(&mut self, phase: Phase) {
        self.rotations += 1;
        if self.rotations >= ROTATIONS {
            self.resynchronise(phase);
        }
    }

    #[inline(never)]
    fn resynchronise(&mut self, phase: Phase) {
        let (sin, cos) = libm::sincos(phase.radians());
        self.phasor = (cos, sin);
        self.rotations = 0;
    }

    /// Where the motion stands, relative to the line that follows the base signal.
    #[inline(always)]
    fn point(&self, masses: &Masses, base: &BaseMotion) -> Point {
        let [offset, slope, ..] = base.drive.signal;
        Point {
            y: masses.x.value() - offset,
            dy: masses.v.value() - slope,
            phasor: self.phasor,
        }
    }

    /// Takes a step whose propagator is cached, if it meets no contact. Returns whether it was taken.
    #[inline]
    pub fn step(
        &mut self,
        rig: &Rig,
        masses: &mut Masses,
        base: &mut BaseMotion,
        duration: f64,
    ) -> bool {
        if duration != self.cache.step.t || !self.enabled {
            return false;
        }
        let start = self.point(masses, base);
        if duration >= self.contact_free && !self.is_contact_free(rig, masses, base, &start, duration) {
            return false;
        }
        self.take_step(rig, masses, base, &start);
        true
    }

    #[inline(always)]
    fn take_step(&mut self, rig: &Rig, masses: &mut Masses, base: &mut BaseMotion, start: &Point) {
        let step = &mut self.cache.step;
        let increment = step.increment(&rig.alone, &base.drive, start);
        self.contact_free -= step.t;
        let (t, angle) = (step.t, step.angle);
        self.apply(masses, base, rig.parameters.half_width, &increment, t);
        base.phase = base.phase.rotated(angle, 0.0);
        self.rotated(base.phase);
    }

    /// Adds an increment to displacements, velocities and signal.
    #[inline(always)]
    fn apply(
        &mut self,
        masses: &mut Masses,
        base: &mut BaseMotion,
        half_width: f64,
        increment: &Increment,
        t: f64,
    ) {
        let signal = &mut base.drive.signal;
        let dx = increment.y + signal[1] * t;
        if signal[1] != 0.0 || signal[2] != 0.0 || signal[3] != 0.0 {
            *signal = crate::base_motion::shift(*signal, t);
        }
        masses.x = masses.x.plus(dx);
        masses.v = masses.v.plus(increment.dy);
        masses.dw += increment.dy;
        masses.w = masses.w.plus(dx - masses.particle * t);
        let w = masses.w.value();
        if w.abs() > half_width {
            masses.w = Sum::from(half_width.copysign(w));
        }
        self.phasor = increment.phasor;
    }

    /// Whether a bound from the start alone shows that no wall is met within `t`; looks further ahead where that is as cheap.
    #[inline(always)]
    fn is_contact_free(
        &mut self,
        rig: &Rig,
        masses: &Masses,
        base: &BaseMotion,
        start: &Point,
        t: f64,
    ) -> bool {
        let envelope = Envelope::new(&rig.alone, &base.drive, start, AHEAD * t);
        let (w, dw, b) = (masses.w.value(), masses.dw, rig.parameters.half_width);
        if envelope.open_from(b, w, dw, AHEAD * t) {
            self.contact_free = AHEAD * t;
            return true;
        }
        let envelope = Envelope::new(&rig.alone, &base.drive, start, t);
        let open = envelope.open_from(b, w, dw, t);
        if open {
            self.contact_free = t;
        }
        open
    }

    /// Moves on by `t` seconds, in which no wall is met; `duration` is the length of the whole step.
    pub fn coast(
        &mut self,
        rig: &Rig,
        masses: &mut Masses,
        base: &mut BaseMotion,
        t: f64,
        duration: f64,
    ) {
        self.evaluations += 1;
        let start = self.point(masses, base);
        if t == duration && self.cache.repeats(&rig.alone, &base.drive, duration) {
            self.take_step(rig, masses, base, &start);
            return;
        }
        let free_after = self.contact_free - t;
        let [_, _, u2, u3] = base.drive.signal;
        let fastest = rig.alone.fastest.max(base.drive.omega.abs());
        let half_width = rig.parameters.half_width;
        if t * fastest <= short_step::LONGEST || u2 != 0.0 || u3 != 0.0 || base.drive.omega < 0.0 {
            let origin = (masses.x.value(), masses.v.value());
            let segment = Segment::new(&rig.alone, *base, origin);
            let (departure, v) = segment.departure(t);
            let [_, u1, ..] = base.drive.signal;
            let increment = Increment {
                y: departure + (origin.1 - u1) * t,
                dy: v,
                phasor: self.phasor,
            };
            let phase = base.phase.advanced(base.drive.omega, t);
            self.apply(masses, base, half_width, &increment, t);
            base.phase = phase;
            self.state_changed(base);
        } else {
            self.coefficients.prepare(&rig.alone, base.drive.omega);
            let coefficients = &self.coefficients;
            let propagator = self.cache.near(&rig.alone, coefficients, t);
            let h = t - propagator.t;
            let increment = propagator.shortly(coefficients, base.drive.amplitude, &start, h);
            let phase = base.phase.rotated(propagator.angle, coefficients.omega * h);
            self.apply(masses, base, half_width, &increment, t);
            base.phase = phase;
            self.rotated(phase);
        }
        self.contact_free = free_after.max(0.0);
    }

    /// The keys from which everything cached can be computed again.
    #[cfg(feature = "serde")]
    pub fn keys(&self) -> Keys {
        Keys::of(self)
    }

    /// As it was when its keys were taken.
    #[cfg(feature = "serde")]
    pub fn restored(keys: &Keys, rig: &Rig) -> Self {
        keys.restore(&rig.alone)
    }
}
