//! Capture of a motion with impacts, from rest.
//!
//! A particle that lies still is hit only if the response reaches the walls. The amplitude loop therefore raises the response of the
//! linear mode to an amplitude at which impacts certainly occur. Then the [approach](crate::approach) brings the drive down to its
//! setpoint, and on this way the impacts synchronise.

use core::f64::consts::TAU;

use crate::amplitude_loop::{AmplitudeState, Move};
use crate::config::Config;

/// Phase error, rad, up to which the loop is near phase resonance.
const NEAR: f64 = 0.35;
/// Periods near phase resonance before the response is raised, and above the level before the capture is complete: the particle
/// needs a few impacts to join the motion.
const PERIODS: f64 = 5.0;
/// Share of the level at which it counts as reached: the impacts make the response fluctuate.
const REACHED: f64 = 0.97;
/// Duration of the rise, periods; a limited drive extends it.
const RISE: f64 = 20.0;

/// Coefficients of the capture.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Capture {
    /// Response amplitude at which impacts occur, m; `None` without a capture.
    level: Option<f64>,
    /// s
    sample_time: f64,
}

/// Progress of the capture: periods for which the present condition has held.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct CaptureState {
    periods: f64,
}

/// Measurements that the capture uses.
#[derive(Clone, Copy, Debug)]
pub struct Observation {
    /// Frequency, rad/s.
    pub omega: f64,
    /// Drive amplitude, m.
    pub drive: f64,
    /// Response amplitude, m.
    pub response: f64,
    /// Phase error, rad, if it is valid.
    pub error: Option<f64>,
}

impl Capture {
    /// The capture of a configuration.
    pub fn new(config: &Config) -> Self {
        Self {
            level: config.capture_response,
            sample_time: config.sample_time,
        }
    }

    /// Whether a motion is to be captured before the drive goes to its setpoint.
    pub fn is_on(&self) -> bool {
        self.level.is_some()
    }

    /// One sample: starts the amplitude loop near phase resonance. Returns whether the capture is complete.
    pub fn advance(
        &self,
        state: &mut CaptureState,
        amplitude_loop: &mut Option<AmplitudeState>,
        seen: &Observation,
    ) -> bool {
        let Some(level) = self.level else {
            return true;
        };
        let is_rising = amplitude_loop.is_some();
        let is_near = seen.error.is_some_and(|error| error.abs() < NEAR);
        if is_near && (!is_rising || seen.response >= REACHED * level) {
            state.periods += seen.omega * self.sample_time / TAU;
        } else if !is_rising {
            state.periods = 0.0;
        }
        if state.periods < PERIODS {
            return false;
        }
        state.periods = 0.0;
        if !is_rising {
            let rise = Move {
                response: level,
                duration: RISE * TAU / seen.omega,
                ..Move::default()
            };
            let mut started = AmplitudeState::constant(seen.response, seen.drive);
            started.start(rise, self.sample_time);
            *amplitude_loop = Some(started);
        }
        is_rising
    }
}
