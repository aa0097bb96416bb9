//! The fast path: predict with whatever is cheap, then verify with a bound.
//!
//! The next contact is *predicted* from cached propagators: the flight time that followed the last one, or a march over the
//! flight in equal stretches. It is *verified* with a bound ([`verify`]): the particle drifts towards one wall all the time, or
//! Taylor bounds from both ends of a stretch keep the gaps to both walls open. What cannot be verified is left to the plain
//! solver's search. Results therefore never depend on a guess, only the cost does.
//!
//! [`Predictions`] are state: results depend on them in their last digits, so that they are saved and restored. All else in [`FastPath`]
//! is the workspace, which may be dropped at any time without changing a bit. One rule makes its entries invalid: an entry is used only
//! if its keys (a time, a frequency of the base) are the ones asked for; it is computed anew otherwise.

mod flight;
mod propagator;
mod verify;

/// Whether a mechanism of the fast path is left out, to measure what it saves: `LOVINES_WITHOUT=hop cargo bench -p vines-benchmarks --bench savings -- scenes`.
/// In any other build this is false at compile time.
#[inline(always)]
fn without(mechanism: &str) -> bool {
    option_env!("LOVINES_WITHOUT").is_some_and(|left_out| left_out == mechanism)
}

use crate::arithmetic::Sum;
use crate::base_motion::{BaseMotion, Drive, Phase, shift};
use crate::contact::Wall;
use crate::oscillator::Oscillator;
use crate::segment::{Motion, Segment};
use crate::system::{Moving, System};
use propagator::{Coefficients, Grid, Increment, PhasePoint, Propagator, SAME_STEP, ShortStep};
use verify::{Horizon, Start};

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

/// What is predicted of the motion, and from what.
#[derive(Clone, Copy, Debug, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Predictions {
    pub disabled: bool,
    /// How long there is no contact from now on.
    pub contact_free: Horizon,
    /// `e^{i phase}` of the base: cosine and sine.
    pub phasor: (f64, f64),
    /// Rotations since it was computed from the phase.
    rotations: u32,
    /// What comes next could not be verified: the plain solver is to search for so long, s.
    to_search: f64,
    /// Length of the step that repeats, s; up to date in a saved state.
    step: f64,
    /// Length of the last whole step without contact, s.
    last_duration: f64,
    sequence: Sequence,
}

/// The fast path: its state and its workspace.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct FastPath {
    pub state: Predictions,
    /// Whether it serves: it is not disabled, and the particle flies straight.
    serves: bool,
    coefficients: Coefficients,
    cache: Cache,
    /// Evaluations of the motion in the present step, by the plain solver too.
    pub evaluations: u64,
}

impl FastPath {
    /// Empty, for a system.
    pub fn new(system: &System) -> Self {
        let mut path = Self::default();
        path.choose(system);
        path
    }

    /// Decides whether it serves.
    pub fn choose(&mut self, system: &System) {
        self.serves = !self.state.disabled && !system.forces.act();
    }

    /// Its state.
    pub fn save(&self) -> Predictions {
        Predictions { step: self.cache.step.t, ..self.state }
    }

    /// Takes over a state of the same oscillator. The workspace stays.
    pub fn restore(&mut self, state: &Predictions, system: &System) {
        self.state = *state;
        if self.cache.step.t.to_bits() != state.step.to_bits() {
            self.cache.step = ShortStep::from(state.step);
        }
        self.choose(system);
    }

    /// The state was changed from outside.
    pub fn state_changed(&mut self, base: &BaseMotion) {
        self.state.contact_free = Horizon::default();
        self.resynchronise(base.phase);
    }

    /// The parameters were changed.
    pub fn parameters_changed(&mut self, base: &BaseMotion) {
        let state = Predictions { disabled: self.state.disabled, ..Predictions::default() };
        *self = Self { state, ..Self::default() };
        self.state_changed(base);
    }

    /// The drive changes.
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    pub fn drive_changed(&mut self, oscillator: &Oscillator, drive: &Drive) {
        self.state.contact_free.drive_changed(oscillator, drive);
        self.cache.step.drive_changed(drive);
    }

    #[inline(never)]
    fn resynchronise(&mut self, phase: Phase) {
        let (sin, cos) = libm::sincos(phase.radians());
        self.state.phasor = (cos, sin);
        self.state.rotations = 0;
    }

    /// Where the motion stands, relative to the line that follows the base signal.
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    fn point(&self, moving: &Moving) -> PhasePoint {
        let [offset, slope, ..] = moving.base.drive.signal;
        let [x, v] = moving.masses.primary.values;
        PhasePoint { y: x - offset, dy: v - slope, phasor: self.state.phasor }
    }

    /// Takes a step whose propagator is cached, if it meets no contact. Returns whether it was taken.
    #[inline]
    pub fn step(&mut self, moving: &mut Moving, duration: f64) -> bool {
        if !self.serves {
            return false;
        }
        if duration != self.cache.step.t {
            let late = duration - self.cache.step.t;
            return self.cache.step.serves(&moving.base.drive, late) && self.late_step(moving, duration, late);
        }
        let free = duration < self.state.contact_free.t || self.is_contact_free(moving, duration);
        if free {
            self.take_step(moving, 0.0);
        }
        free
    }

    /// The same for a step that is a little longer or shorter than the cached one.
    #[inline(never)]
    fn late_step(&mut self, moving: &mut Moving, duration: f64, late: f64) -> bool {
        let free = duration < self.state.contact_free.t || self.is_contact_free(moving, duration);
        if free {
            self.take_step(moving, late);
        }
        free
    }

    /// Takes a step that is longer than the cached one by `late` seconds.
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    fn take_step(&mut self, moving: &mut Moving, late: f64) {
        let drive = &moving.base.drive;
        let response = self.cache.step.response(&moving.system.free, drive.omega);
        let (start, step) = (self.point(moving), &self.cache.step);
        let mut increment = step.increment(&response, drive.amplitude, &start);
        let (mut angle, mut t) = (response.angle, step.t);
        if late != 0.0 {
            increment = increment.later(&moving.system.free, drive, (start.y, start.dy), late);
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
        self.state.phasor = increment.phasor;
        self.state.rotations += 1;
        if self.state.rotations >= ROTATIONS {
            self.resynchronise(base.phase);
        }
        dx
    }

    /// Adds `dx` to the relative displacement, and what the particle flies in `t` seconds: no wall is met.
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    fn drift(&mut self, moving: &mut Moving, dx: f64, t: f64) {
        let Moving { system, masses, .. } = moving;
        masses.drift(dx - masses.particle * t, system.half_width);
        self.state.contact_free.t -= t;
    }

    /// Whether a bound from the start alone shows that no wall is met within `t`; it may reach further.
    #[inline(never)]
    fn is_contact_free(&mut self, moving: &Moving, t: f64) -> bool {
        let ahead = Horizon::ahead(moving, &self.point(moving), t);
        self.state.contact_free = if without("horizon") { Horizon::default() } else { ahead };
        ahead.t >= t
    }

    /// Moves on by `t` seconds, in which no wall is met; `duration` is the length of the whole step.
    fn coast(&mut self, moving: &mut Moving, start: &PhasePoint, t: f64, duration: f64) -> Next {
        let (oscillator, drive) = (&moving.system.free, moving.base.drive);
        let fastest = oscillator.fastest.max(drive.omega.abs());
        self.evaluations += 1;
        if t == duration && self.repeats(oscillator, &drive, duration) {
            self.take_step(moving, duration - self.cache.step.t);
            return Next::ContactFree(t);
        }
        let increment = if !drive.is_straight() || drive.omega < 0.0 || t * fastest > LONGEST_COAST {
            self.state.rotations = ROTATIONS;
            let motion = Segment::new(oscillator, moving.base, moving.masses.primary.values.into());
            let there = motion.at(&motion.series(), t);
            Increment {
                y: there.moved - drive.signal[1] * t,
                dy: there.departure.1,
                phasor: self.state.phasor,
            }
        } else {
            self.coefficients.prepare(oscillator, drive.omega);
            if t * fastest > propagator::LONGEST_SERIES {
                self.state.sequence.learn(&self.coefficients, t);
            }
            self.after(&Start::new(moving, *start), t)
        };
        let dx = self.apply(moving, &increment, propagator::angle(drive.omega, t), t);
        self.drift(moving, dx, t);
        Next::ContactFree(t)
    }

    /// Whether a whole step without contact can be taken with the cached one: it is short, and has been taken before.
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    fn repeats(&mut self, oscillator: &Oscillator, drive: &Drive, duration: f64) -> bool {
        if self.cache.step.serves(drive, duration - self.cache.step.t) {
            return true;
        }
        let again = (duration - self.state.last_duration).abs() <= SAME_STEP * duration;
        self.state.last_duration = duration;
        if again && !without("short step") && ShortStep::is_short(oscillator, drive.omega, duration) {
            self.cache.step = ShortStep::from(duration);
        }
        duration == self.cache.step.t
    }
}

// Workspace: propagators, which are computed again where they are missing.

/// Number of flights in the cache. A motion with at most this many distinct flights per period is predicted.
const FLIGHTS: usize = 8;

/// The propagators.
#[derive(Clone, Copy, Debug, Default)]
struct Cache {
    /// Of a step that repeats.
    step: ShortStep,
    /// Of flights, and of what is left of a step after one.
    flights: [Propagator; FLIGHTS],
    /// Of points of a march.
    grid: Grid,
}

/// Which flight follows which.
#[derive(Clone, Copy, Debug, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Sequence {
    /// How long they last, s; 0 for none.
    times: [f64; FLIGHTS],
    /// Which followed which when they were last used.
    followers: [u8; FLIGHTS],
    last: u8,
    /// The follower of the last one, and its time, s.
    next: u8,
    next_time: f64,
    /// Whether the last one was the follower of the one before.
    regular: bool,
    /// The one to be replaced next.
    oldest: u8,
}

impl Sequence {
    /// A flight to a contact, or what was left of a step, took `t` seconds.
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    fn learn(&mut self, coefficients: &Coefficients, t: f64) {
        // Nearer than an unused time, which is 0.
        let near = coefficients.near.min(t);
        self.regular = (self.next_time - t).abs() < near;
        if !self.regular {
            self.next = (self.times.iter().position(|time| (time - t).abs() < near)).map_or_else(
                || {
                    self.oldest = (self.oldest + 1) % FLIGHTS as u8;
                    self.times[usize::from(self.oldest)] = t;
                    self.oldest
                },
                |n| n as u8,
            );
            self.followers[usize::from(self.last) % FLIGHTS] = self.next;
        }
        self.last = self.next;
        self.next = self.followers[usize::from(self.last) % FLIGHTS];
        self.next_time = self.times[usize::from(self.next) % FLIGHTS];
    }
}

impl Cache {
    /// The propagator of the flight that followed the last one before, if flights have been regular.
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    fn expected(
        &mut self,
        sequence: &Sequence,
        oscillator: &Oscillator,
        coefficients: &Coefficients,
    ) -> Option<&Propagator> {
        if !sequence.regular || without("sequence") {
            return None;
        }
        let (propagator, t) = (
            &mut self.flights[usize::from(sequence.next) % FLIGHTS],
            sequence.next_time,
        );
        if propagator.omega != coefficients.omega || propagator.t != t {
            if propagator.t != t {
                let increment = self.grid.increment(oscillator, coefficients.spacing, t);
                propagator.set(t, oscillator.split(&increment));
            }
            propagator.respond(oscillator, coefficients);
        }
        Some(propagator)
    }
}
