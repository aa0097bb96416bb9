//! Approach to the steady state: shapes the drive until the lock criterion is met.
//!
//! Under a constant drive the response amplitude approaches its steady state with the damping rate of the structure, which takes
//! dozens of periods. At phase resonance it obeys `A' = g (E cos(error) - E_R)`, where `g` is `response_gain` and `E_R`, the drive
//! that would hold the present amplitude, follows the amplitude. An observer with the low pass `F` of rate `w` estimates it
//! without a derivative:
//!
//! ```text
//! E_R = F(E cos(error)) - (w/g) (A - F(A))
//! ```
//!
//! The drive is `E = E_0 + gain (E_0 - E_R)` with the setpoint `E_0`. In the steady state `E = E_R = E_0`. Around it,
//! `A' = g (1 + gain) (E_0 - E_R)`: the same steady states as under a constant drive, with the same stability, approached
//! `1 + gain` times as fast.

use crate::config::Config;
use crate::real::{self, Real};

/// Rate of the observer, relative to the rate of the approach in the linear regime.
const OBSERVER_RATE: Real = 4.0;
/// Range of the shaped drive, relative to its setpoint: wide enough to move the response, narrow enough to stay in the regime.
const DRIVE_RANGE: [Real; 2] = [0.25, 3.0];

/// A difference between setpoint and holding drive, relative to the setpoint, that changes its sign is a swing if it exceeds this.
const LARGE_SWING: Real = 0.1;
/// Fall of the logarithm of the gain for each swing, to 70 %. Swings that persist mean that the response changes faster than the
/// observer follows.
const SWING: Real = 0.357;

/// Growth of the response from its smallest value that means that the motion was lost.
const LOST: Real = 2.0;

/// An approach that takes this long swings, in time constants of the structure; from then on the gain falls.
const LATE: Real = 20.0;
/// Time constant with which it falls, in those of the structure.
const PATIENCE: Real = 8.0;

/// Coefficients of the approach.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Approach {
    gain: Real,
    /// rad/s
    damping_rate: Real,
    /// Rate of the observer, rad/s.
    pub rate: Real,
    /// Share of its error that the detector corrects per sample.
    detector_step: Real,
    /// Growth rate of the response per drive, 1/s.
    response_gain: Real,
    /// s
    sample_time: Real,
}

/// State of the observer.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ApproachState {
    /// The drive in phase with the response's velocity, m, with the lag of the detector, and with that of the observer.
    detected: Real,
    drive: Real,
    /// Present rate of the observer, rad/s, and the share of its error that it corrects per sample.
    rate: Real,
    step: Real,
    /// Response amplitude with the lag of the observer, m.
    pub response: Real,
    /// Its smallest value on the way to the setpoint of the drive, m; 0 without a capture.
    pub lowest: Real,
    /// The drive that would hold the response, m.
    pub holding: Real,
    /// Largest relative difference between the setpoint and the holding drive since it last changed its sign.
    swing: Real,
    /// Number of large swings.
    swings: i32,
}

impl ApproachState {
    /// Whether the response has risen so far above its smallest value that the motion must have been lost and found again.
    pub fn has_lost_motion(&self) -> bool {
        self.response > LOST * self.lowest
    }
}

impl Approach {
    /// The approach of a configuration.
    pub fn new(config: &Config) -> Self {
        let damping_rate = config.damping_rate.unwrap_or(0.0);
        let rate = (OBSERVER_RATE * (1.0 + config.approach_gain) * damping_rate).min(config.bandwidth);
        let rate = if rate > 0.0 { rate } else { config.bandwidth };
        Self {
            gain: config.approach_gain,
            damping_rate,
            rate,
            detector_step: -real::expm1(-config.bandwidth * config.sample_time),
            response_gain: config.response_gain,
            sample_time: config.sample_time,
        }
    }

    /// Updates the observer of this rate, rad/s, with the drive amplitude and the response amplitude, m, and the cosine of the phase
    /// error. Returns the drive that would hold the response, m.
    pub fn observe(&self, state: &mut ApproachState, drive: Real, response: Real, cosine: Real, rate: Real) -> Real {
        if rate != state.rate {
            // The estimated growth of the response does not change.
            state.response = response - (response - state.response) * state.rate / rate;
            state.rate = rate;
            state.step = -real::expm1(-rate * self.sample_time);
        }
        state.detected += self.detector_step * (drive * cosine - state.detected);
        state.drive += state.step * (state.detected - state.drive);
        state.response += state.step * (response - state.response);
        state.holding = state.drive - rate / self.response_gain * (response - state.response);
        state.holding
    }

    /// The drive, m, on the way to `setpoint`, m, where `holding`, m, would hold the response.
    pub fn shape(&self, state: &mut ApproachState, setpoint: Real, holding: Real, elapsed: Real) -> Real {
        let [low, high] = DRIVE_RANGE.map(|share| share * setpoint);
        state.lowest = state.lowest.min(state.response);
        let missing = setpoint - holding;
        let late = (self.damping_rate * elapsed - LATE).max(0.0);
        let patience = real::exp(-late / PATIENCE - SWING * state.swings as Real);
        let gain = patience * self.gain;
        if missing * state.swing < 0.0 {
            state.swings += i32::from(state.swing.abs() > LARGE_SWING * setpoint);
            state.swing = 0.0;
        }
        if missing.abs() > state.swing.abs() {
            state.swing = missing;
        }
        real::limited(setpoint + gain * missing, low, high)
    }
}
