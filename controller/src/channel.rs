//! A channel: its detector, and whether its readings are plausible. A reading that differs from the detector's prediction by far more than the
//! readings of the last periods shows that a sensor, the drive or the clock has failed, often within a few samples.

use crate::config::Config;
use crate::detector::{Estimate, PhaseDetector, Rotors};
use crate::oscillator::Complex;
use crate::real::consts::TAU;
use crate::real::{Real, larger, smaller};

/// Phase, rad, after which a reading that has not changed is no gap of a connection, and within which a second implausible reading is no glitch.
/// In twice this phase, a signal of more than eight steps of its converter changes.
const PAUSE: Real = TAU / 12.0;
/// Differences that count as normal, in units of the largest one of a period: noise of twice the size is too rare.
const NORMAL: Real = 2.0;
/// Sum of the amplitudes of all harmonics above the fundamental, as a share of the limit, above which a sensor saturates: clipping at half of
/// the amplitude makes 0.27 of the fundamental.
const DISTORTION: Real = 0.5;

/// Phase, rad, for which that must last: the first impacts and a change of the drive disturb the harmonics for two or three periods.
const LASTS: Real = 5.0 * TAU;

/// Coefficients of a channel.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Channel {
    detector: PhaseDetector,
    /// Largest difference beyond the normal one, as a share of the amplitude.
    limit: Option<Real>,
}

/// State of a channel.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ChannelState {
    /// Estimate of its signal.
    pub estimate: Estimate,
    /// Whether the last reading is one of several implausible ones.
    pub is_implausible: bool,
    /// The last reading, m, and the phase for which it has not changed, rad.
    last: Real,
    unchanged: Real,
    /// Largest differences between readings and predictions in this period and in the two before it, m.
    largest: [Real; 3],
    /// Phase since the start of the period, since the last implausible reading, and for which the signal has been distorted, rad.
    phase: Real,
    since: Real,
    distorted: Real,
}

impl ChannelState {
    /// Whether the sensor has stopped.
    pub fn has_stopped(&self) -> bool {
        self.unchanged > 2.0 * PAUSE
    }
}

impl Channel {
    /// The channel of a configuration.
    pub fn new(config: &Config) -> Self {
        Self {
            detector: PhaseDetector::new(config),
            limit: config.residual_max,
        }
    }

    /// The rotors of a sample, for all channels; `rotor` is `exp(i phase)` of the oscillator.
    pub fn rotors(&self, rotor: Complex) -> Rotors {
        self.detector.rotors(rotor)
    }

    /// Takes a reading, m, after a turn of the oscillator, rad. `change`: factor by which the drive has changed and the detector has still to
    /// learn; `None`: the signal is not known yet.
    pub fn take(&self, state: &mut ChannelState, reading: Real, rotors: &Rotors, turn: Real, change: Option<Real>) {
        let before = state.estimate;
        let residual = self.detector.update(&mut state.estimate, reading, rotors);
        let factor = change.unwrap_or(1.0);
        let difference = (reading - factor * (reading - residual)).abs();
        state.unchanged = longer(state.unchanged, turn, reading == state.last);
        state.last = reading;
        state.phase += turn;
        if state.phase >= TAU {
            state.phase = 0.0;
            state.largest.rotate_right(1);
            state.largest[0] = 0.0;
        }
        state.since += turn;
        state.is_implausible = false;
        let [now, last, earlier] = state.largest;
        if let Some(limit) = self.limit {
            let (amplitude, lag) = (state.estimate.amplitude, (factor - 1.0).abs());
            let share = if state.unchanged > PAUSE { 0.0 } else { limit * factor };
            // A fault may have begun at the end of the last period.
            let expected = (share + lag) * amplitude + NORMAL * smaller(last, earlier);
            let is_clear = self
                .detector
                .harmonics_within(&state.estimate, (DISTORTION * limit + lag) * amplitude);
            state.distorted = longer(state.distorted, turn, !is_clear);
            if change.is_some() && (difference > expected || state.distorted > LASTS) {
                state.is_implausible = state.since <= PAUSE;
                state.since = 0.0;
                if !state.is_implausible {
                    // The detector ignores a glitch.
                    state.estimate = before;
                    return;
                }
            }
        }
        state.largest[0] = larger(now, difference);
    }
}

/// A time or phase after one more step of a condition.
pub fn longer(before: Real, step: Real, condition: bool) -> Real {
    if condition { before + step } else { 0.0 }
}
