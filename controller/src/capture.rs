//! Capture of a motion with impacts, from rest.
//!
//! A particle that lies still is hit only if the response reaches the walls. The amplitude loop therefore raises the response of the
//! linear mode to an amplitude at which impacts certainly occur. Then the [approach](crate::approach) brings the drive down to its
//! setpoint, and on this way the impacts synchronise.
//!
//! Several motions may belong to the same drive: above `captured_max` an asymmetric or irregular one, below it one or two symmetric
//! ones. A [descent](crate::descent) leads the motion below `captured_max`. A response that rises above it later, or whose impacts end,
//! is captured again, and the repeated descent goes on until the drive that holds the response is its setpoint. Each of
//! the repetitions is slower.
//!
//! A motion of another kind may also have a response below `captured_max`: mostly a subharmonic of order three. It ends at a drive that is
//! a few percent lower. Where the residual of the detector shows it, the descent begins at once, and the drive returns to its
//! setpoint from below.

use crate::real::consts::TAU;

use crate::amplitude_loop::{AmplitudeState, Move};
use crate::config::Config;
use crate::descent::{Descending, Descent, DescentState, Progress};
use crate::real::Real;

/// Phase error, rad, up to which the loop is near phase resonance.
const NEAR: Real = 0.35;
/// Periods near phase resonance before the response is raised, and above the level before the capture is complete: the particle
/// needs a few impacts to join the motion.
const PERIODS: Real = 5.0;
/// Share of the level at which it counts as reached: the impacts make the response fluctuate.
const REACHED: Real = 0.97;
/// Duration of the rise, periods; a limited drive extends it.
const RISE: Real = 20.0;

/// Response above which the motion is another one, as a share of the largest wanted one.
const ABOVE: Real = 1.0005;
/// Share of the response of another periodic motion from which that of a descent begins to be handed over, before `LOWER`.
const CLEAR: Real = 0.9;
/// Response below which a motion that has left the wanted one is handed over again, as a share of that at which it was before.
const LOWER: Real = 0.95;
/// Largest number of repetitions. The last one accepts any motion.
const REPETITIONS: u32 = 5;

/// Coefficients of the capture.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Capture {
    /// Response amplitude at which impacts occur, m; `None` without a capture.
    level: Option<Real>,
    /// Largest response amplitude of the wanted motion, m.
    largest: Option<Real>,
    descent: Descent,
    /// s
    sample_time: Real,
}

/// Progress of the capture.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct CaptureState {
    /// Periods for which the present condition has held.
    periods: Real,
    descent: Option<DescentState>,
    /// Response amplitude at which a repeated descent ended, m.
    arrived: Option<Real>,
    /// Number of repetitions.
    repetitions: u32,
}

impl CaptureState {
    /// Starts again. From the response `periodic`, m, of another periodic motion, it descends at once.
    pub fn repeat(&mut self, periodic: Option<Real>) {
        let below = |response: Real| self.arrived.unwrap_or(Real::INFINITY).min(CLEAR * response);
        *self = Self {
            repetitions: self.repetitions + 1,
            arrived: periodic.map_or(self.arrived, |response| Some(below(response))),
            descent: periodic.map(DescentState::below_setpoint),
            ..Self::default()
        };
    }

    /// Whether nothing has been repeated.
    pub fn is_first(&self) -> bool {
        self.repetitions == 0
    }
}

/// Measurements that the capture uses.
#[derive(Clone, Copy, Debug)]
pub struct Observation {
    /// Frequency, rad/s.
    pub omega: Real,
    /// Drive amplitude, m.
    pub drive: Real,
    /// Response amplitude, m.
    pub response: Real,
    /// Its mean over the lag of the observer, m.
    pub mean: Real,
    /// Drive that would hold the response, m.
    pub holding: Real,
    /// Phase error, rad, if it is valid.
    pub error: Option<Real>,
}

impl Capture {
    /// The capture of a configuration.
    pub fn new(config: &Config) -> Self {
        Self {
            level: config.capture_response,
            largest: config.captured_max,
            descent: Descent::new(config),
            sample_time: config.sample_time,
        }
    }

    /// Whether a motion is to be captured before the drive goes to its setpoint.
    pub fn is_on(&self) -> bool {
        self.level.is_some()
    }

    /// Whether the motion of this mean response amplitude, m, is another one, which calls for a repetition: it is too large, or
    /// `other_motion` says so.
    pub fn has_escaped(&self, state: &CaptureState, mean: Real, other_motion: bool) -> bool {
        let is_other = |largest: Real| other_motion || mean > ABOVE * largest;
        self.is_on() && self.largest.is_some_and(is_other) && state.repetitions < REPETITIONS
    }

    /// The drive, m, of a descent; `None` before. `holding`, m, would hold the response at the phase error, rad.
    pub fn drive(&self, state: &CaptureState, holding: Real, error: Real) -> Option<Real> {
        Some(self.descent.drive(&state.descent?, holding, error))
    }

    /// Rate of the observer, rad/s, at the response amplitude, m, if a descent needs another one than `rate`.
    pub fn observer_rate(&self, state: &CaptureState, response: Real, rate: Real) -> Real {
        match state.descent {
            Some(_) => self.descent.observer_rate(response).max(rate),
            None => rate,
        }
    }

    /// One sample: starts the amplitude loop near phase resonance, then the descent. Returns whether the capture is complete.
    pub fn advance(
        &self,
        state: &mut CaptureState,
        amplitude_loop: &mut Option<AmplitudeState>,
        seen: &Observation,
    ) -> bool {
        match (self.level, state.descent) {
            (None, _) => true,
            (Some(_), Some(descent)) => self.descend(state, descent, seen),
            (Some(level), None) => self.rise(state, amplitude_loop, level, seen),
        }
    }

    fn rise(
        &self,
        state: &mut CaptureState,
        amplitude_loop: &mut Option<AmplitudeState>,
        level: Real,
        seen: &Observation,
    ) -> bool {
        let is_rising = amplitude_loop.is_some();
        let is_near = seen.error.is_some_and(|error| error.abs() < NEAR);
        if is_near && (!is_rising || seen.response >= REACHED * level) {
            state.periods += self.periods(seen);
        } else if !is_rising {
            state.periods = 0.0;
        }
        if state.periods < PERIODS {
            return false;
        }
        state.periods = 0.0;
        if is_rising {
            *amplitude_loop = None;
            state.descent = self.largest.map(|_| DescentState::from(seen.response));
            return self.largest.is_none();
        }
        let rise = Move {
            response: level,
            duration: RISE * TAU / seen.omega,
            ..Move::default()
        };
        let mut started = AmplitudeState::constant(seen.response, seen.drive);
        started.start(rise, self.sample_time);
        *amplitude_loop = Some(started);
        false
    }

    fn descend(&self, state: &mut CaptureState, mut descent: DescentState, seen: &Observation) -> bool {
        let descending = Descending {
            omega: seen.omega,
            part: self.periods(seen),
            response: seen.mean,
            holding: seen.holding,
            error: seen.error,
            repetitions: state.repetitions,
            highest: state.arrived.map_or(Real::INFINITY, |arrived| LOWER * arrived),
        };
        let progress = self.descent.advance(&mut descent, &descending);
        state.descent = Some(descent).filter(|_| progress == Progress::Descends);
        match progress {
            Progress::Descends => false,
            Progress::Arrived => {
                state.arrived = Some(seen.mean).filter(|_| state.repetitions > 0);
                true
            }
            Progress::Lost => {
                state.arrived = None;
                state.repeat(None);
                state.repetitions > REPETITIONS
            }
        }
    }

    /// Periods per sample.
    fn periods(&self, seen: &Observation) -> Real {
        seen.omega * self.sample_time / TAU
    }
}
