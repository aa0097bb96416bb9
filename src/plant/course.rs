//! What is known of the flight under way: how long the walls are out of reach, where it will arrive, and how far the plant
//! has come since. All of it only saves work.

use super::strides::Strides;
use crate::base_motion::{Drive, Phase};
use crate::crossing::{Anchor, Arrival, Origin, Wave};
use crate::oscillator::Oscillator;
use crate::span::Span;
use crate::wall::Wall;
use serde::{Deserialize, Serialize};

/// So many turns by a rounded `e^{i angle}` before it is worked out anew from the phase.
pub(super) const TURNS_KEPT: u32 = 16;
/// Shortest step that the state is moved on by, in units of `1/omega0`, squared.
const SHORTEST_STRIDE: f64 = 1e-6;

/// Anchors are written out as their time: the rest follows from it.
pub(super) mod by_time {
    use crate::crossing::Anchor;
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    pub fn serialize<S: Serializer>(anchor: &Anchor<f64>, s: S) -> Result<S::Ok, S::Error> {
        anchor.t.serialize(s)
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(d: D) -> Result<Anchor<f64>, D::Error> {
        Ok(Anchor {
            t: f64::deserialize(d)?,
            ..Anchor::default()
        })
    }
}

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
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(super) struct Course {
    /// Coefficients of rig and drive.
    #[serde(skip)]
    pub rig: Wave<f64>,
    /// Whether they allow the quick way.
    pub quick: bool,
    /// How far the plant has come since the origin, but for the strides.
    lag: Span,
    /// No wall is met until this time since the origin, s.
    pub clear: f64,
    pub landing: Option<Landing>,
    /// How often `e^{i phase}` has been turned since it was worked out.
    pub turns: u32,
    /// Near the last arrival.
    #[serde(with = "by_time")]
    pub anchor: Anchor<f64>,
    /// Whether the drive has changed since that was worked out.
    pub stale: bool,
    /// Whether the drive has changed with this very step, as it does at every step of a controller's.
    pub restless_drive: bool,
    /// Near the last lag, where it was the same as the one before.
    #[serde(with = "by_time")]
    stop: Anchor<f64>,
    pub strides: Strides,
    last_duration: f64,
    last_lag: f64,
}

impl Course {
    /// The course of a rig.
    pub fn new(oscillator: &Oscillator, half_width: f64) -> Self {
        Self {
            rig: Wave::new(oscillator, half_width),
            quick: false,
            lag: Span::default(),
            clear: 0.0,
            landing: None,
            turns: 0,
            anchor: Anchor::default(),
            stale: false,
            restless_drive: false,
            stop: Anchor::default(),
            strides: Strides::default(),
            last_duration: 0.0,
            last_lag: 0.0,
        }
    }

    /// Works out again what is not written out.
    pub fn work_out_again(&mut self, oscillator: &Oscillator, half_width: f64, drive: &Drive) {
        self.rig = Wave::new(oscillator, half_width);
        if self.quick {
            self.rig.take(drive);
        }
        for anchor in [&mut self.anchor, &mut self.stop, self.strides.one()] {
            if anchor.t != 0.0 {
                *anchor = self.rig.anchor(oscillator, anchor.t);
            }
        }
    }

    /// As it comes back from being written out.
    #[cfg(test)]
    pub fn bare(self) -> Self {
        let only_time = |anchor: Anchor<f64>| Anchor {
            t: anchor.t,
            ..Anchor::default()
        };
        let mut bare = Self {
            rig: Wave::default(),
            anchor: only_time(self.anchor),
            stop: only_time(self.stop),
            ..self
        };
        *bare.strides.one() = only_time(*bare.strides.one());
        bare
    }

    /// The coefficients, where rig and drive allow the quick way.
    #[inline]
    pub fn wave(&self) -> Option<&Wave<f64>> {
        if self.quick { Some(&self.rig) } else { None }
    }

    /// Forgets what depends on the drive, and begins anew under another one.
    pub fn renew(&mut self, drive: &Drive) {
        self.quick = self.rig.take(drive);
        self.stale = true;
        self.restless_drive = true;
        self.stop.t = f64::NAN;
        self.strides.forget();
        self.leave();
    }

    /// Makes the anchor one of the present drive: of the free motion it knows all it needs.
    #[cfg(feature = "batch")]
    #[cold]
    pub fn freshen(&mut self) {
        self.anchor = self.rig.turned(&self.anchor);
        self.stale = false;
    }

    /// Forgets what depends on the state.
    pub fn leave(&mut self) {
        self.lag = Span::default();
        self.strides.end();
        self.clear = 0.0;
        self.landing = None;
    }

    /// How far the plant has come since the origin.
    #[inline]
    pub fn lag(&self) -> Span {
        if self.strides.under_way() {
            self.strides.span()
        } else {
            self.lag
        }
    }

    /// Whether it has come any way since.
    #[inline]
    pub fn lags(&self) -> bool {
        self.strides.under_way() || self.lag != Span::default()
    }

    /// The plant has come so far since the origin, and nothing was met.
    pub fn wait(&mut self, oscillator: &Oscillator, until: Span) {
        let lag = until.seconds();
        // A steady motion stops at the same point of its flight again and again.
        let again = self.rig.are_near(lag, self.last_lag);
        if again && self.quick && !self.rig.are_near(lag, self.stop.t) {
            self.stop = self.rig.anchor(oscillator, lag);
        }
        self.last_lag = lag;
        self.lag = until;
    }

    /// The state now, seen from the origin, which was `here`.
    #[inline(always)]
    pub fn now(&self, oscillator: &Oscillator, here: &Origin<f64>) -> Origin<f64> {
        let mut now = if self.strides.under_way() {
            self.strides.now(&self.rig, here)
        } else if self.lag == Span::default() {
            return *here;
        } else {
            self.worked_out(oscillator, here)
        };
        let b = self.rig.half_width;
        // Branches that are never taken cost less than a minimum and a maximum.
        if now.w > b {
            now.w = b;
        } else if now.w < -b {
            now.w = -b;
        }
        now
    }

    /// The state after the lag. Not inlined: whoever takes strides never comes here.
    #[inline(never)]
    fn worked_out(&self, oscillator: &Oscillator, here: &Origin<f64>) -> Origin<f64> {
        let lag = self.lag.seconds();
        if self.rig.are_near(lag, self.stop.t) {
            self.rig.shortly(here, &self.stop, lag)
        } else {
            self.rig.after(oscillator, here, lag)
        }
    }

    /// The phase of the base now, which was `phase` at the origin.
    pub fn phase(&self, phase: Phase) -> Phase {
        if self.strides.taken() == 1 {
            return self.strides.after_one(phase);
        }
        let (whole, missed) = self.lag().parts();
        if whole == 0.0 {
            return phase;
        }
        let omega = self.rig.omega;
        (phase.advanced(omega, whole)).turned((0.0, 0.0), omega * missed)
    }

    /// The state has come to where the plant stands.
    pub fn catch_up(&mut self, oscillator: &Oscillator, here: &mut Origin<f64>, phase: &mut Phase) {
        let lag = self.lag();
        *phase = self.phase(*phase);
        if self.strides.under_way() {
            self.turns += self.strides.taken();
            if self.turns >= TURNS_KEPT {
                // Before the state is seen by it: what turning has cost stays behind.
                self.strides.face(*phase);
                self.turns = 0;
            }
            *here = self.now(oscillator, here);
        } else {
            *here = self.now(oscillator, here);
            self.face(here, *phase);
        }
        self.strides.end();
        self.lag = Span::default();
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
    pub fn repeats(&mut self, oscillator: &Oscillator, duration: f64) -> bool {
        // Tiny steps would add up their roundings: the state is left where it is, and worked out from there when asked for.
        let worth_it = duration * duration * self.rig.omega0_squared > SHORTEST_STRIDE;
        let again = duration == self.last_duration && worth_it && self.quick;
        self.last_duration = duration;
        if again {
            self.strides.prepare(&self.rig, oscillator, duration);
        }
        again
    }

    /// How long the walls are certainly out of reach of `start`, which has no lag and does not cross; 0 if that is not
    /// known. Where there will be another drive after the `left` seconds of this step, only whether they are for so long.
    pub fn look_out(&mut self, start: &Origin<f64>, left: f64) {
        self.clear = self.wave().map_or(0.0, |wave| {
            let free = wave.free_motion(start);
            if self.restless_drive && wave.is_clear(start, &free, 2.0 * left) {
                2.0 * left
            } else {
                wave.clear(start, &free)
            }
        });
    }
}
