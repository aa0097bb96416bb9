//! What is known of the flight under way: how long the walls are out of reach, where it will arrive, and a step that was
//! worked out before. All of it only saves work.

use crate::base_motion::{BaseMotion, Drive, Phase};
use crate::crossing::{Anchor, Arrival, Origin, Wave};
use crate::oscillator::Oscillator;
use crate::span::Span;
use crate::wall::Wall;
use serde::{Deserialize, Serialize};

/// So many turns by a rounded `e^{i angle}` before it is worked out anew from the phase.
pub(super) const TURNS_KEPT: u32 = 16;
/// Shortest step that the state is moved on by, in units of `1/omega0`, squared.
const SHORTEST_STRIDE: f64 = 1e-6;

/// An arrival, and when it is.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Landing {
    /// Since the origin.
    pub at: Span,
    /// Whether the origin is still the state that it was found from.
    pub fresh: bool,
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
    /// Coefficients, where the rig allows the quick way.
    pub rig: Option<Wave<f64>>,
    /// Whether the drive allows it, too.
    pub quick: bool,
    /// How far the plant has come since the origin.
    pub lag: Span,
    /// No wall is met until this time since the origin, s.
    pub clear: f64,
    pub landing: Option<Landing>,
    /// How often `e^{i phase}` has been turned since it was worked out.
    pub turns: u32,
    /// Near the last arrival.
    pub anchor: Anchor<f64>,
    /// The step that was repeated last.
    stride: Anchor<f64>,
    /// Whether it has been worked out for the present drive.
    worked_out: bool,
    last_duration: f64,
}

impl Course {
    /// The course of a rig.
    pub fn new(oscillator: &Oscillator, half_width: f64) -> Self {
        Self {
            rig: Wave::new(oscillator, half_width),
            ..Self::default()
        }
    }

    /// The coefficients, where rig and drive allow the quick way.
    #[inline]
    pub fn wave(&self) -> Option<&Wave<f64>> {
        if self.quick { self.rig.as_ref() } else { None }
    }

    /// Forgets what depends on the drive, and begins anew under another one.
    pub fn renew(&mut self, drive: &Drive) {
        self.quick = self.rig.as_mut().is_some_and(|wave| wave.take(drive));
        self.anchor = Anchor::default();
        self.worked_out = false;
        self.leave();
    }

    /// Forgets what depends on the state.
    pub fn leave(&mut self) {
        self.lag = Span::default();
        self.clear = 0.0;
        self.landing = None;
    }

    /// The state has come to where the plant stands.
    pub fn catch_up(&mut self) {
        let lag = core::mem::take(&mut self.lag);
        self.clear = (self.clear - lag.seconds()).max(0.0);
        if let Some(landing) = &mut self.landing {
            landing.at = landing.at.less(lag);
            landing.fresh = false;
        }
    }

    /// Works `e^{i phase}` out anew, where it is of use.
    pub fn face(&mut self, here: &mut Origin<f64>, phase: Phase) {
        if self.quick {
            let (sin, cos) = libm::sincos(phase.radians());
            here.turn = (cos, sin);
            self.turns = 0;
        }
    }

    /// Notes the length of a step that meets nothing. Whether it came before, so that it pays to work it out for good.
    pub fn repeats(&mut self, duration: f64) -> bool {
        // Tiny steps would add up their roundings: the state is left where it is, and worked out from there when asked for.
        let worth_it = (self.rig.as_ref())
            .is_some_and(|wave| duration * duration * wave.omega0_squared > SHORTEST_STRIDE);
        let again = duration == self.last_duration && worth_it && self.quick;
        self.last_duration = duration;
        if let (true, Some(wave)) = (again, &self.rig) {
            self.stride = if self.stride.t == duration {
                wave.turned(&self.stride)
            } else {
                wave.anchor(duration)
            };
            self.worked_out = true;
        }
        again
    }

    /// Whether a step of this length has been worked out and meets nothing.
    #[inline]
    pub fn strides(&self, duration: f64) -> bool {
        self.worked_out
            && duration == self.stride.t
            && duration < self.clear
            && self.lag == Span::default()
    }

    /// What time does to the state while it lags behind: worked out before, or now.
    pub fn gone(&self, wave: &Wave<f64>) -> Anchor<f64> {
        let lag = self.lag.seconds();
        if self.worked_out && self.stride.t == lag {
            self.stride
        } else {
            wave.anchor(lag)
        }
    }

    /// Such a step.
    #[inline]
    pub fn stride(&mut self, here: &Origin<f64>, base: &mut BaseMotion) -> Origin<f64> {
        let Some(wave) = self.wave() else {
            unreachable!("a stride is worked out from a wave");
        };
        let mut end = wave.stride(here, &self.stride);
        base.phase = base.phase.turned(self.stride.angle, 0.0);
        self.turns += 1;
        self.clear -= self.stride.t;
        if let Some(landing) = &mut self.landing {
            landing.at = landing.at.plus(-self.stride.t);
            landing.fresh = false;
        }
        if self.turns >= TURNS_KEPT {
            self.face(&mut end, base.phase);
        }
        end
    }

    /// How long the walls are certainly out of reach of `start`, which has no lag and does not cross; 0 if that is not
    /// known.
    pub fn look_out(&mut self, start: &Origin<f64>) {
        self.clear = self
            .wave()
            .map_or(0.0, |wave| wave.clear(start, &wave.free_motion(start)));
    }
}
