//! The fast path: predict with whatever is cheap, then verify with a bound.
//!
//! The next contact is *predicted* from cached propagators: the flight time that followed the last one, or a march over the
//! flight in equal stretches. It is *verified* with a bound ([`verify`]): the particle drifts towards one wall all the time, or
//! Taylor bounds from both ends of a stretch keep the gaps to both walls open. What cannot be verified is left to the plain
//! solver's search. Results therefore never depend on a guess, only the cost does.
//!
//! Everything kept between steps lives in [`Cache`], and each entry carries its key: the time it belongs to and
//! the frequency of the base. An entry whose key differs is not used; nothing else invalidates it.

mod arrival;
mod cache;
mod coefficients;
mod flight;
mod free_increment;
mod grid;
mod hop;
mod horizon;
mod march;
mod propagator;
mod short_step;
mod verify;

use crate::arithmetic::Sum;
use crate::base_motion::{BaseMotion, Drive, Phase, shift};
use crate::contact::Wall;
use crate::moving::Moving;
use crate::oscillator::Oscillator;
use crate::segment::Segment;
use cache::{Cache, Keys};
use coefficients::Coefficients;
use horizon::Horizon;
use propagator::{Increment, Point};
use verify::Start;

/// How often a phasor is rotated before it is computed from the phase again.
const ROTATIONS: u32 = 16;
/// Longest time for which the motion is followed from point to point of the grid, in units of the fastest rate's time: for
/// a longer one the closed form is as cheap.
const LONGEST_COAST: f64 = 8.0;

/// What comes next.
pub(crate) enum Next {
    /// No contact for this time, s: the plant has moved on by it.
    ContactFree(f64),
    /// A verified contact after this time, s, with this wall: the plant has moved on to it.
    Contact(Sum, Wall),
    /// Unknown: the plain solver has to search, for so long at most, s.
    Search(f64),
}

/// Predictions, and what they are made from.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct FastPath {
    pub disabled: bool,
    /// How long there is no contact from now on.
    pub contact_free: Horizon,
    /// `e^{i phase}` of the base: cosine and sine.
    pub phasor: (f64, f64),
    /// Rotations since it was computed from the phase.
    rotations: u32,
    coefficients: Coefficients,
    cache: Cache,
    /// What comes next could not be verified: the plain solver is to search for so long, s.
    to_search: f64,
    /// Evaluations of the motion in the present step, by the plain solver too.
    pub evaluations: u64,
}

/// What is saved of the fast path: all that results depend on.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct SavedPath {
    disabled: bool,
    contact_free: Horizon,
    phasor: (f64, f64),
    rotations: u32,
    to_search: f64,
    keys: Keys,
}

impl FastPath {
    /// What is saved of it.
    pub fn save(&self) -> SavedPath {
        let Self {
            disabled,
            contact_free,
            phasor,
            rotations,
            coefficients: _,
            cache,
            to_search,
            evaluations: _,
        } = *self;
        SavedPath {
            disabled,
            contact_free,
            phasor,
            rotations,
            to_search,
            keys: cache.keys(),
        }
    }

    /// Restores what was saved. What is cached for the same oscillator and keys stays: it has the same bits as if it were computed again.
    pub fn restore(&mut self, saved: &SavedPath) {
        let SavedPath { disabled, contact_free, phasor, rotations, to_search, keys } = *saved;
        (self.disabled, self.contact_free, self.phasor) = (disabled, contact_free, phasor);
        (self.rotations, self.to_search) = (rotations, to_search);
        self.cache.restore(&keys);
    }

    /// The state was changed from outside.
    pub fn state_changed(&mut self, base: &BaseMotion) {
        self.contact_free = Horizon::default();
        self.resynchronise(base.phase);
    }

    /// The parameters were changed.
    pub fn parameters_changed(&mut self, base: &BaseMotion) {
        *self = Self { disabled: self.disabled, ..Self::default() };
        self.state_changed(base);
    }

    /// The drive changes.
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    pub fn drive_changed(&mut self, oscillator: &Oscillator, drive: &Drive) {
        self.contact_free.drive_changed(oscillator, drive);
        self.cache.step.drive_changed(drive);
    }

    #[inline(never)]
    fn resynchronise(&mut self, phase: Phase) {
        let (sin, cos) = libm::sincos(phase.radians());
        self.phasor = (cos, sin);
        self.rotations = 0;
    }

    /// Where the motion stands, relative to the line that follows the base signal.
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    fn point(&self, moving: &Moving) -> Point {
        let [offset, slope, ..] = moving.base.drive.signal;
        let [x, v] = moving.masses.primary.values;
        Point { y: x - offset, dy: v - slope, phasor: self.phasor }
    }

    /// Takes a step whose propagator is cached, if it meets no contact. Returns whether it was taken.
    #[inline]
    pub fn step(&mut self, moving: &mut Moving, duration: f64) -> bool {
        if self.disabled {
            return false;
        }
        if duration != self.cache.step.t {
            let late = duration - self.cache.step.t;
            return self.cache.step.serves(&moving.base.drive, late) && self.late_step(moving, duration, late);
        }
        let free = duration < self.contact_free.t || self.is_contact_free(moving, duration);
        if free {
            self.take_step(moving, 0.0);
        }
        free
    }

    /// The same for a step that is a little longer or shorter than the cached one.
    #[inline(never)]
    fn late_step(&mut self, moving: &mut Moving, duration: f64, late: f64) -> bool {
        let free = duration < self.contact_free.t || self.is_contact_free(moving, duration);
        if free {
            self.take_step(moving, late);
        }
        free
    }

    /// Takes a step that is longer than the cached one by `late` seconds.
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    fn take_step(&mut self, moving: &mut Moving, late: f64) {
        let drive = &moving.base.drive;
        let response = self.cache.step.response(&moving.rig.free, drive.omega);
        let (start, step) = (self.point(moving), &self.cache.step);
        let mut increment = step.increment(&response, drive.amplitude, &start);
        let (mut angle, mut t) = (response.angle, step.t);
        if late != 0.0 {
            increment = increment.later(&moving.rig.free, drive, (start.y, start.dy), late);
            angle = angle.plus(drive.omega * late);
            t += late;
        }
        if !drive.is_held() {
            increment.bend(drive.signal, step);
        }
        let dx = self.apply(moving, &increment, angle, t);
        self.drift(moving, dx, t);
    }

    /// Adds an increment to velocities, base and displacement of the primary mass; returns what is added to that.
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    fn apply(&mut self, moving: &mut Moving, increment: &Increment, angle: Sum, t: f64) -> f64 {
        let Moving { masses, base, .. } = moving;
        let mut dx = increment.y;
        if !base.drive.is_held() {
            dx += base.drive.signal[1] * t;
            base.drive.signal = shift(base.drive.signal, t);
        }
        masses.primary = masses.primary.plus([dx, increment.dy]);
        masses.dw += increment.dy;
        base.phase = base.phase.rotated(angle);
        self.phasor = increment.phasor;
        self.rotations += 1;
        if self.rotations >= ROTATIONS {
            self.resynchronise(base.phase);
        }
        dx
    }

    /// Adds `dx` to the relative displacement, and what the particle flies in `t` seconds: no wall is met.
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    fn drift(&mut self, moving: &mut Moving, dx: f64, t: f64) {
        let Moving { rig, masses, .. } = moving;
        masses.drift(dx - masses.particle * t, rig.parameters.half_width);
        self.contact_free.t -= t;
    }

    /// Whether a bound from the start alone shows that no wall is met within `t`; it may reach further.
    #[inline(never)]
    fn is_contact_free(&mut self, moving: &Moving, t: f64) -> bool {
        self.contact_free = Horizon::ahead(moving, &self.point(moving), t);
        self.contact_free.t >= t
    }

    /// Moves on by `t` seconds, in which no wall is met; `duration` is the length of the whole step.
    fn coast(&mut self, moving: &mut Moving, start: &Point, t: f64, duration: f64) -> Next {
        let (oscillator, drive) = (&moving.rig.free, moving.base.drive);
        let fastest = oscillator.fastest.max(drive.omega.abs());
        self.evaluations += 1;
        if t == duration && self.cache.repeats(oscillator, &drive, duration) {
            self.take_step(moving, duration - self.cache.step.t);
            return Next::ContactFree(t);
        }
        let increment = if !drive.is_straight() || drive.omega < 0.0 || t * fastest > LONGEST_COAST {
            self.rotations = ROTATIONS;
            let motion = Segment::new(oscillator, moving.base, moving.masses.primary.values.into());
            let there = motion.at(&motion.series(), t);
            Increment {
                y: there.moved - drive.signal[1] * t,
                dy: there.departure.1,
                phasor: self.phasor,
            }
        } else {
            self.coefficients.prepare(oscillator, drive.omega);
            if t * fastest > short_step::LONGEST {
                self.cache.learn(&self.coefficients, t);
            }
            self.after(&Start::new(moving, *start), t)
        };
        let dx = self.apply(moving, &increment, propagator::angle(drive.omega, t), t);
        self.drift(moving, dx, t);
        Next::ContactFree(t)
    }
}
