//! What is known of the flight under way: how long the walls are out of reach, where it will arrive, and a step that was
//! worked out before. All of it only saves work.

use crate::base_motion::{BaseMotion, Phase};
use crate::crossing::{Anchor, Arrival, Origin, Wave};
use crate::oscillator::Oscillator;
use crate::span::Span;
use serde::{Deserialize, Serialize};

/// So many turns by a rounded `e^{i angle}` before it is worked out anew from the phase.
const TURNS_KEPT: u32 = 16;
/// So many guesses at an arrival before the general search is asked.
const MOST_GUESSES: usize = 8;

/// An arrival, and when it is.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Landing {
    /// Since the origin.
    pub at: Span,
    /// State just before the impact.
    pub arrival: Arrival<f64>,
    /// Phase of the base then.
    pub phase: Phase,
    /// The wall, +1 or -1.
    pub wall: f64,
}

/// The flight under way, seen from its *origin*: the state that the plant holds.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub(super) struct Course {
    /// Coefficients, where rig and drive allow the quick way.
    pub wave: Option<Wave<f64>>,
    /// How far the plant has come since the origin.
    pub lag: Span,
    /// No wall is met until this time since the origin, s.
    pub clear: f64,
    pub landing: Option<Landing>,
    /// `e^{i phase}` at the origin.
    pub turn: (f64, f64),
    turns: u32,
    /// Near the last arrival.
    anchor: Anchor<f64>,
    /// The step that was repeated last.
    stride: Anchor<f64>,
    last_duration: f64,
}

impl Course {
    /// Forgets what depends on the drive, and begins anew under the one of `base`.
    pub fn renew(&mut self, oscillator: &Oscillator, half_width: f64, base: &BaseMotion) {
        let had_turn = self.wave.is_some();
        self.wave = Wave::new(oscillator, half_width, &base.drive);
        self.anchor.t = 0.0;
        self.stride.t = 0.0;
        self.leave();
        if self.wave.is_some() && !had_turn {
            self.face(base.phase);
        }
    }

    /// Forgets what depends on the state.
    pub fn leave(&mut self) {
        self.lag = Span::default();
        self.clear = 0.0;
        self.landing = None;
    }

    /// Works `e^{i phase}` out anew.
    pub fn face(&mut self, phase: Phase) {
        let (sin, cos) = libm::sincos(phase.radians());
        self.turn = (cos, sin);
        self.turns = 0;
    }

    /// Whether `turn` is that of now.
    pub fn turn_is_known(&self) -> bool {
        self.wave.is_some() && self.lag == Span::default()
    }

    /// Takes over a turned `e^{i phase}`, and works it out anew from time to time.
    pub fn turn_to(&mut self, turn: (f64, f64), phase: Phase) {
        self.turn = turn;
        self.turns += 1;
        if self.turns >= TURNS_KEPT {
            self.face(phase);
        }
    }

    /// Whether a step of this length has come twice in a row, so that it pays to work it out once.
    pub fn repeats(&mut self, duration: f64) -> bool {
        let again = self.wave.is_some() && duration == self.last_duration && duration > 0.0;
        self.last_duration = duration;
        again
    }

    /// One repeated step with no event: moves `start` and `base` on.
    pub fn stride(
        &mut self,
        start: &Origin<f64>,
        base: &mut BaseMotion,
        duration: f64,
    ) -> Origin<f64> {
        let wave = self.wave.as_ref().expect("a stride is of the quick way");
        if self.stride.t != duration {
            self.stride = wave.anchor(duration);
        }
        let end = wave.stride(start, &self.stride);
        base.phase = base.phase.turned(self.stride.angle, 0.0);
        self.turn_to(end.turn, base.phase);
        self.clear -= duration;
        if let Some(landing) = &mut self.landing {
            landing.at = landing.at.plus(-duration);
        }
        end
    }

    /// Looks ahead from `start`, which has no lag: finds the landing, or how long there is certainly none. Neither, if
    /// the quick way cannot tell; `left` is the time of interest, s.
    pub fn look_ahead(&mut self, start: &Origin<f64>, phase: Phase, left: f64) {
        let Some(wave) = &self.wave else {
            return;
        };
        let free = wave.free_motion(start);
        if !wave.certainly_crosses(start, &free) {
            self.clear = wave.clear(start, &free);
            return;
        }
        let wall = Wave::ahead(start);
        let speed = start.particle.abs();
        let distance = wave.half_width - wall * start.w;
        // The primary mass is slower than the particle, so that they close in at less than twice its speed.
        let soonest = 0.5 * distance / speed;
        if left < soonest {
            self.clear = soonest;
            return;
        }
        if self.anchor.t <= 0.0 {
            self.anchor = wave.anchor(distance / speed);
        }
        for _ in 0..MOST_GUESSES {
            let (arrival, near) = wave.arrival(start, &free, &self.anchor);
            if near {
                let at = Span::of(self.anchor.t).plus(arrival.beyond);
                self.clear = at.seconds();
                self.landing = Some(Landing {
                    at,
                    phase: phase.turned(self.anchor.angle, wave.omega * arrival.beyond),
                    arrival,
                    wall,
                });
                return;
            }
            let guess = self.anchor.t + arrival.beyond;
            // An arrival far from the anchor is a rough guess; a bad one is brought back to what is possible.
            let slowest = speed - wave.speed - libm::sqrt(free.speed_squared);
            let latest = distance / slowest;
            let guess = if guess >= soonest && guess <= latest {
                guess
            } else {
                distance / speed
            };
            self.anchor = wave.anchor(guess);
        }
    }
}
