//! What carries the cavity: its state, and how it moves between events.

use crate::arithmetic::Sums;
use crate::flight::{FlightEnd, Sticking};
use crate::oscillator::Oscillator;
use crate::segment::{Motion, Segment};
use crate::system::{Masses, Moving};

/// The primary structure: one oscillator ([`Single`]), or a sum of sections ([`crate::Structure`]).
///
/// `Masses::primary` holds the displacement and the velocity at the cavity; a structure has a state beside it.
pub trait Primary: Clone {
    /// Its motion between events.
    type Motion: Motion;
    /// Its state beside `Masses::primary`.
    type State: Clone;
    /// Whether the fast path knows its motion. Otherwise the plain solver finds every contact.
    const HAS_FAST_PATH: bool;

    /// Its motion while the particle is free, under a constant force: the one that gives the particle `acceleration`, m/s².
    fn alone(&self, moving: &Moving, acceleration: f64) -> Self::Motion;

    /// Its motion with the particle at rest on it, on which gravity acts.
    fn with_particle(&self, moving: &Moving) -> Self::Motion;

    /// Moves on to the end of a flight or of a stretch of sliding.
    fn fly(&mut self, moving: &mut Moving, motion: &Self::Motion, end: &FlightEnd);

    /// Moves on to the end of a stretch of sticking or resting.
    fn stay(&mut self, moving: &mut Moving, motion: &Self::Motion, stay: &Sticking);

    /// An impulse at the cavity, which changes the velocity there by `kick`, m/s.
    fn kick(&mut self, masses: &mut Masses, kick: f64);

    /// Velocity at the cavity per jump of the drive while the particle is free.
    fn velocity_per_jump(&self, moving: &Moving) -> f64;

    /// A jump of the drive moves the particle, which is at rest on it, along; the structure alone would gain the velocity `kick`, m/s.
    fn carry(&mut self, moving: &mut Moving, jump: f64, kick: f64);

    /// Acceleration at the cavity, m/s², if an impulse there has just made the velocity `velocity` (m/s): while it moves alone, without friction.
    fn acceleration(&self, moving: &Moving, velocity: f64) -> f64;

    /// An upper bound of the magnitude of this acceleration, m/s²: the sum of its terms.
    fn acceleration_bound(&self, moving: &Moving, velocity: f64) -> f64;

    /// The drive takes another value at the start: displacements and velocities stay.
    fn begin(&mut self, jump: f64);

    /// Its state, to be saved.
    fn state(&self) -> Self::State;

    /// Takes over a state that was saved.
    fn restore(&mut self, state: &Self::State);
}

/// One oscillator: all of its state is in `Masses::primary`.
#[derive(Clone, Copy, Debug, Default)]
pub struct Single;

impl Primary for Single {
    type Motion = Segment;
    type State = ();
    const HAS_FAST_PATH: bool = true;

    #[inline]
    fn alone(&self, moving: &Moving, acceleration: f64) -> Segment {
        let Moving { system, masses, base } = moving;
        let base = if acceleration == 0.0 {
            *base
        } else {
            system.pushed(*base, acceleration)
        };
        Segment::new(&system.free, base, masses.primary.values.into())
    }

    #[inline]
    fn with_particle(&self, moving: &Moving) -> Segment {
        let Moving { system, masses, base } = moving;
        let base = system.pushed(*base, system.forces.gravity);
        Segment::new(&system.stuck, base, masses.primary.values.into())
    }

    #[inline]
    fn fly(&mut self, moving: &mut Moving, _motion: &Segment, end: &FlightEnd) {
        moving.masses.primary = moving.masses.primary.plus([end.moved, end.gained]);
    }

    #[inline]
    fn stay(&mut self, moving: &mut Moving, _motion: &Segment, stay: &Sticking) {
        moving.masses.primary = Sums { values: stay.state, errors: [0.0; 2] };
    }

    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    fn kick(&mut self, masses: &mut Masses, kick: f64) {
        masses.primary = masses.primary.plus([0.0, kick]);
    }

    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    fn velocity_per_jump(&self, moving: &Moving) -> f64 {
        2.0 * moving.system.free.delta
    }

    #[inline]
    fn carry(&mut self, moving: &mut Moving, jump: f64, _kick: f64) {
        let both = 2.0 * moving.system.stuck.delta * jump;
        moving.masses.primary = moving.masses.primary.plus([0.0, both]);
    }

    fn acceleration(&self, moving: &Moving, velocity: f64) -> f64 {
        let start = (moving.masses.primary.values[0], velocity);
        Segment::new(&moving.system.free, moving.base, start).derivatives_at_start()[2]
    }

    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    fn acceleration_bound(&self, moving: &Moving, velocity: f64) -> f64 {
        let Oscillator { delta, omega0_squared, .. } = moving.system.free;
        let drive = &moving.base.drive;
        let position = moving.masses.primary.values[0].abs() + drive.signal[0].abs() + drive.amplitude.abs();
        let velocity = velocity.abs() + drive.signal[1].abs() + (drive.amplitude * drive.omega).abs();
        (omega0_squared * position + 2.0 * delta * velocity) * (1.0 + 1e-9)
    }

    fn begin(&mut self, _jump: f64) {}

    fn state(&self) {}

    fn restore(&mut self, _state: &()) {}
}
