//! What a plant tells: state, events, totals.

use crate::contact::{Touch, Wall};

/// Positions (m) and velocities (m/s) of both masses.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct State {
    /// Displacement of the primary mass.
    pub q1: f64,
    /// Velocity of the primary mass.
    pub dq1: f64,
    /// Displacement of the particle.
    pub q2: f64,
    /// Velocity of the particle.
    pub dq2: f64,
}

/// An event of a step; times are in seconds since the step began.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Event {
    /// The particle hit a wall.
    Impact {
        /// When, s.
        t: f64,
        /// Which wall.
        wall: Wall,
        /// Relative velocity `w'` just before, m/s.
        velocity: f64,
    },
    /// The particle came to rest on a wall.
    Stuck {
        /// When, s.
        t: f64,
        /// Which wall.
        wall: Wall,
    },
    /// The wall ceased to push and released the particle.
    Released {
        /// When, s.
        t: f64,
        /// Which wall.
        wall: Wall,
    },
}

/// The events of a step, counted, and how far the step came.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Outcome {
    /// Impacts followed one by one.
    pub impacts: u64,
    /// How often the particle came to rest on a wall.
    pub stuck: u64,
    /// How often a wall released it.
    pub released: u64,
    /// Time by which the plant advanced, s: less than the step where it was cut short.
    pub elapsed: f64,
    /// Whether the step ended early, at the largest number of impacts, releases or evaluations.
    pub cut_short: bool,
    /// Evaluations of the motion (closed form, propagator or series).
    pub evaluations: u64,
}

/// Totals since the start.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Totals {
    /// Impacts followed one by one. A chatter is followed until its hops can no longer be resolved.
    pub impacts: u64,
    /// Time of the last impact, s; 0 before the first.
    pub impact_time: f64,
    /// Relative velocity `w'` just before the last impact, m/s; 0 before the first.
    pub impact_velocity: f64,
    /// Energy dissipated by impacts, J.
    pub dissipated: f64,
}

impl Totals {
    /// Counts an impact, if `touch` is one, and what it dissipated.
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    pub fn add(&mut self, touch: &Touch, time: f64) {
        if let Some(velocity) = touch.impact {
            self.impacts += 1;
            self.impact_time = time;
            self.impact_velocity = velocity;
        }
        self.dissipated += touch.dissipated;
    }
}
