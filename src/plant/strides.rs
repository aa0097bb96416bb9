//! Steps of equal length that meet nothing: worked out once, then taken one after the other.
//!
//! Only what a step cannot do without is moved on: the free motion, and `e^{i phase}`. Displacements, the phase and the time
//! since the origin follow from these when somebody asks for them, or when the run of strides is over.

use crate::base_motion::{Phase, product};
use crate::crossing::{Anchor, Origin, Wave, times};
use crate::oscillator::Oscillator;
use crate::span::Span;
use serde::{Deserialize, Serialize};

/// So many strides before `e^{i phase}` is worked out anew.
const MOST: u32 = 32;

/// A free motion that has died out so far, m and m/s, is none.
const NOTHING: f64 = 1e-280;

/// A stride, and how far a run of them has come.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Strides {
    /// One of them.
    #[serde(with = "super::course::by_time")]
    one: Anchor<f64>,
    /// Whether it has been worked out for the present drive.
    ready: bool,
    /// How many have been taken since the origin.
    taken: u32,
    /// How many may be taken.
    most: u32,
    /// The free motion now: displacement, m, and velocity, m/s.
    free: (f64, f64),
    /// `e^{i phase}` now.
    turn: (f64, f64),
}

impl Strides {
    /// One of them, to be worked out again.
    pub fn one(&mut self) -> &mut Anchor<f64> {
        &mut self.one
    }

    /// The drive is another one: the stride is no longer ready.
    pub fn forget(&mut self) {
        self.ready = false;
    }

    /// Gets strides of this length ready.
    pub fn prepare(&mut self, wave: &Wave<f64>, oscillator: &Oscillator, duration: f64) {
        if self.one.t != duration {
            self.one = wave.anchor(oscillator, duration);
        } else if !self.ready {
            // A drive that changes at every step, as a controller's does, leaves the free motion's part as it is.
            self.one = wave.turned(&self.one);
        }
        self.ready = true;
    }

    /// Begins a run at `here`, from which no wall is met for `clear` seconds. Whether any stride may be taken.
    pub fn begin(
        &mut self,
        wave: &Wave<f64>,
        here: &Origin<f64>,
        clear: f64,
        duration: f64,
    ) -> bool {
        if !self.ready || self.one.t != duration {
            return false;
        }
        self.most = self.fitting(clear);
        let free = wave.free_motion(here);
        // Where numbers end, each operation takes a hundred times as long.
        let gone = free.y.abs() < NOTHING && free.dy.abs() < NOTHING;
        self.free = if gone { (0.0, 0.0) } else { (free.y, free.dy) };
        self.turn = here.turn;
        self.most > 0
    }

    /// How many strides end before `clear` seconds are over.
    fn fitting(&self, clear: f64) -> u32 {
        let fit = clear / self.one.t * (1.0 - 1e-9);
        if fit >= f64::from(MOST) {
            MOST
        } else {
            fit as u32
        }
    }

    /// Takes one more of this length, if that is all there is to do.
    #[inline(always)]
    pub fn stride(&mut self, duration: f64) -> bool {
        if self.taken >= self.most || duration != self.one.t {
            return false;
        }
        self.taken += 1;
        self.free = self.one.moved(self.free);
        self.turn = times(self.turn, self.one.turned);
        true
    }

    /// Whether any has been taken since the origin.
    #[inline]
    pub fn under_way(&self) -> bool {
        self.taken > 0
    }

    /// How many have been taken since the origin.
    pub fn taken(&self) -> u32 {
        self.taken
    }

    /// The phase of the base after a single one.
    pub fn after_one(&self, phase: Phase) -> Phase {
        phase.turned(self.one.angle, 0.0)
    }

    /// Time since the origin.
    pub fn span(&self) -> Span {
        Span::of_parts(product(self.one.t, f64::from(self.taken)))
    }

    /// The state now; `here` is the origin.
    #[inline(always)]
    pub fn now(&self, wave: &Wave<f64>, here: &Origin<f64>) -> Origin<f64> {
        wave.state(
            here,
            self.free,
            self.turn,
            self.one.t * f64::from(self.taken),
        )
    }

    /// Works `e^{i phase}` out anew.
    pub fn face(&mut self, phase: Phase) {
        let (sin, cos) = libm::sincos(phase.radians());
        self.turn = (cos, sin);
    }

    /// The run is over; the origin is where it has come to.
    pub fn end(&mut self) {
        self.taken = 0;
        self.most = 0;
    }
}
