//! What is known of the flight under way: how long the walls are out of reach, where it will arrive, and a step that was
//! worked out before. All of it only saves work.

use crate::base_motion::{BaseMotion, Phase};
use crate::crossing::{Anchor, Arrival, Origin, Wave};
use crate::oscillator::Oscillator;
use crate::span::Span;
use crate::wall::Wall;
use serde::{Deserialize, Serialize};

/// So many turns by a rounded `e^{i angle}` before it is worked out anew from the phase.
pub(super) const TURNS_KEPT: u32 = 16;
/// An arrival, and when it is.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Landing {
    /// Since the origin.
    pub at: Span,
    /// State just before the impact.
    pub arrival: Arrival<f64>,
    /// Phase of the base then.
    pub phase: Phase,
    /// The wall ahead.
    pub wall: Wall,
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
    pub turns: u32,
    /// Near the last arrival.
    pub anchor: Anchor<f64>,
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

    /// How long the walls are certainly out of reach of `start`, which has no lag and does not cross; 0 if that is not
    /// known.
    pub fn look_out(&mut self, start: &Origin<f64>) {
        if let Some(wave) = &self.wave {
            self.clear = wave.clear(start, &wave.free_motion(start));
        }
    }
}
