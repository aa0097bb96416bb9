//! Capture of a motion with impacts, from rest.
//!
//! A particle that lies still is hit only if the response reaches the walls. The amplitude loop therefore raises the response of the
//! linear mode to an amplitude at which impacts certainly occur. Then the [approach](crate::approach) brings the drive down to its
//! setpoint, and on this way the impacts synchronise.
//!
//! Several motions may belong to the same drive: above `captured_max` an asymmetric or irregular one, below it one or two symmetric
//! ones. A response that rises above `captured_max`, or whose impacts end, is captured again. A *descent* then leads it down slowly:
//! the drive stays below the one that would hold the response, so that the motion follows the backbone whatever its stability under
//! a constant drive. The first repetition ends the descent below `captured_max`; the others go on until the response needs more
//! than the setpoint of the drive: from there, the setpoint leads it down to the orbit above the fold.

use crate::real::consts::TAU;

use crate::amplitude_loop::{AmplitudeState, Move};
use crate::config::Config;
use crate::real::{self, Real};

/// Phase error, rad, up to which the loop is near phase resonance.
const NEAR: Real = 0.35;
/// Periods near phase resonance before the response is raised, and above the level before the capture is complete: the particle
/// needs a few impacts to join the motion.
const PERIODS: Real = 5.0;
/// Share of the level at which it counts as reached: the impacts make the response fluctuate.
const REACHED: Real = 0.97;
/// Duration of the rise, periods; a limited drive extends it.
const RISE: Real = 20.0;

/// Response at which the first descents end, as a share of the largest wanted one.
const BELOW: Real = 0.97;
/// Response above which the motion is another one, as a share of the largest wanted one.
const ABOVE: Real = 1.0005;
/// Periods in which the response falls by a factor of e on the descent, if the frequency follows.
const DESCENT: Real = 60.0;
/// Phase error, rad, at which the descent waits for the frequency: near the fold the resonance frequency changes fast.
const FOLLOWED: Real = 0.1;
/// Smallest drive of the descent, as a share of that which holds the response: without a drive the phase is undefined.
const LEAST: Real = 0.4;
/// Growth of the response on the descent by which the motion is lost.
const LOST: Real = 1.15;
/// Smallest power that the impacts take, as a share of the largest before, of a motion that is not lost: at the lower end of the
/// symmetric motion it is a third.
const KEPT: Real = 0.2;
/// Largest number of repetitions. The last one accepts any motion.
const REPETITIONS: u32 = 5;

/// Coefficients of the capture.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Capture {
    /// Response amplitude at which impacts occur, m; `None` without a capture.
    level: Option<Real>,
    /// Largest response amplitude of the wanted motion, m.
    largest: Real,
    /// Setpoint of the drive, m.
    amplitude: Real,
    /// Largest drive, m.
    amplitude_max: Real,
    /// Drive, m, that the damping of the structure needs for a response of 1 m.
    damping: Real,
    /// Drive, m, that is missing for a response of 1 m to fall at the rate of the descent.
    fall: Real,
    /// s
    sample_time: Real,
}

/// Progress of the capture.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct CaptureState {
    /// Periods for which the present condition has held.
    periods: Real,
    /// Smallest response amplitude on the descent, m.
    lowest: Option<Real>,
    /// Largest product of the response and the drive that the impacts need, m².
    taken: Real,
    /// Number of repetitions.
    repetitions: u32,
}

impl CaptureState {
    /// Starts again.
    pub fn repeat(&mut self) {
        *self = Self { repetitions: self.repetitions + 1, ..Self::default() };
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
        let largest = config.captured_max.unwrap_or(Real::INFINITY);
        Self {
            level: config.capture_response,
            largest,
            amplitude: config.amplitude,
            amplitude_max: config.amplitude_limit(),
            damping: config.damping_rate.unwrap_or(0.0) / config.response_gain,
            fall: config.omega_start / (TAU * DESCENT * config.response_gain),
            sample_time: config.sample_time,
        }
    }

    /// Whether a motion is to be captured before the drive goes to its setpoint.
    pub fn is_on(&self) -> bool {
        self.level.is_some()
    }

    /// Whether the motion of this mean response amplitude, m, is another one, which calls for a repetition.
    pub fn has_escaped(&self, state: &CaptureState, mean: Real) -> bool {
        self.is_on() && mean > ABOVE * self.largest && state.repetitions < REPETITIONS
    }

    /// The drive, m, of a descent and of the approach after a repetition; `None` before. `holding`, m, would hold the response, m,
    /// at the phase error, rad.
    pub fn drive(&self, state: &CaptureState, holding: Real, response: Real, error: Real) -> Option<Real> {
        let follows = (1.0 - error.abs() / FOLLOWED).max(0.0);
        let fall = follows * self.fall * response / (state.repetitions.max(2) - 1) as Real;
        let least = (holding - fall).max(LEAST * holding);
        let in_phase = match state.lowest {
            Some(_) => least,
            None if state.repetitions > 0 => least.max(self.amplitude),
            None => return None,
        };
        Some((in_phase / real::cos(error)).min(self.amplitude_max))
    }

    /// One sample: starts the amplitude loop near phase resonance, then the descent. Returns whether the capture is complete.
    pub fn advance(
        &self,
        state: &mut CaptureState,
        amplitude_loop: &mut Option<AmplitudeState>,
        seen: &Observation,
    ) -> bool {
        match (self.level, state.lowest) {
            (None, _) => true,
            (Some(_), Some(lowest)) => self.descend(state, lowest.min(seen.mean), seen),
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
            let any_motion = self.largest.is_infinite();
            state.lowest = Some(seen.mean).filter(|_| !any_motion);
            return any_motion;
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

    fn descend(&self, state: &mut CaptureState, lowest: Real, seen: &Observation) -> bool {
        state.lowest = Some(lowest);
        let is_below = seen.mean < BELOW * self.largest;
        let taken = (seen.holding - self.damping * seen.mean) * seen.mean;
        if is_below {
            state.taken = state.taken.max(taken);
        }
        if seen.mean > LOST * lowest || taken < KEPT * state.taken {
            state.repeat();
            return state.repetitions > REPETITIONS;
        }
        let has_passed = state.repetitions < 2 || seen.holding > self.amplitude;
        state.periods = if is_below && has_passed {
            state.periods + self.periods(seen)
        } else {
            0.0
        };
        let complete = state.periods >= PERIODS;
        if complete {
            *state = CaptureState { repetitions: state.repetitions, ..CaptureState::default() };
        }
        complete
    }

    /// Periods per sample.
    fn periods(&self, seen: &Observation) -> Real {
        seen.omega * self.sample_time / TAU
    }
}
