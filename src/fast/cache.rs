//! What is kept between steps. Each entry is used only if its key matches.

use super::coefficients::Coefficients;
use super::grid::Grid;
use super::propagator::Propagator;
use super::short_step::{SAME, ShortStep};
use crate::base_motion::Drive;
use crate::oscillator::Oscillator;

/// Flights kept: a motion of so many different flights per period, or flights and parts of them, is predicted.
const FLIGHTS: usize = 8;

/// Propagators. What is saved of one is its key.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Cache {
    /// Of a step that repeats.
    pub step: ShortStep,
    /// Of flights, and of what is left of a step after one. Until it is needed a propagator has only its key.
    flights: [Propagator; FLIGHTS],
    sequence: Sequence,
    /// Of points of a march.
    pub grid: Grid,
    /// Length of the last whole step without contact, s.
    last_duration: f64,
}

/// Which flight follows which.
#[derive(Clone, Copy, Debug, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Sequence {
    /// Which followed which when they were last used.
    followers: [u8; FLIGHTS],
    last: u8,
    /// Whether the last one was the follower of the one before.
    regular: bool,
    /// The one to be replaced next.
    oldest: u8,
}

/// What is saved of the propagators: the times they belong to, s. All else is computed again when it is needed.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Keys {
    step: f64,
    flights: [f64; FLIGHTS],
    sequence: Sequence,
    last_duration: f64,
}

impl Cache {
    pub fn keys(&self) -> Keys {
        let Self { step, flights, sequence, grid: _, last_duration } = self;
        Keys {
            step: step.t,
            flights: flights.map(|flight| flight.t),
            sequence: *sequence,
            last_duration: *last_duration,
        }
    }

    /// Makes these the keys. Propagators that have theirs already stay.
    pub fn restore(&mut self, keys: &Keys) {
        if self.step.t.to_bits() != keys.step.to_bits() {
            self.step = ShortStep::from(keys.step);
        }
        for (flight, t) in self.flights.iter_mut().zip(keys.flights) {
            if flight.t != t {
                flight.reset(t);
            }
        }
        (self.sequence, self.last_duration) = (keys.sequence, keys.last_duration);
    }

    /// Whether a whole step without contact can be taken with [`Self::step`]: it is short, and has been taken before.
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    pub fn repeats(&mut self, oscillator: &Oscillator, drive: &Drive, duration: f64) -> bool {
        if self.step.serves(drive, duration - self.step.t) {
            return true;
        }
        let again = (duration - self.last_duration).abs() <= SAME * duration;
        self.last_duration = duration;
        if again && ShortStep::is_short(oscillator, drive.omega, duration) {
            self.step = ShortStep::from(duration);
        }
        duration == self.step.t
    }

    /// The propagator that followed the last one before, if flights have been regular.
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    pub fn expected(&mut self, oscillator: &Oscillator, coefficients: &Coefficients) -> Option<&Propagator> {
        let Sequence { followers, last, regular, .. } = self.sequence;
        if !regular {
            return None;
        }
        let propagator = &mut self.flights[usize::from(followers[usize::from(last)]) % FLIGHTS];
        if propagator.omega != coefficients.omega {
            if propagator.free_t != propagator.t {
                let increment = self.grid.increment(oscillator, coefficients.spacing, propagator.t);
                propagator.set(propagator.t, oscillator.split(&increment));
            }
            propagator.respond(oscillator, coefficients);
        }
        Some(propagator)
    }

    /// A flight to a contact, or what was left of a step, took `t` seconds.
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    pub fn learn(&mut self, coefficients: &Coefficients, t: f64) {
        // Nearer than an unused propagator, which has a time of 0.
        let is_near = |n: u8| (self.flights[usize::from(n) % FLIGHTS].t - t).abs() < coefficients.near.min(t);
        let sequence = &mut self.sequence;
        let expected = sequence.followers[usize::from(sequence.last)];
        sequence.regular = is_near(expected);
        let n = if sequence.regular {
            expected
        } else {
            (0..FLIGHTS as u8).find(|&n| is_near(n)).unwrap_or_else(|| {
                sequence.oldest = (sequence.oldest + 1) % FLIGHTS as u8;
                self.flights[usize::from(sequence.oldest)].reset(t);
                sequence.oldest
            })
        };
        sequence.followers[usize::from(sequence.last)] = n;
        sequence.last = n;
    }
}
