//! Descent of a captured motion along the backbone.
//!
//! The drive stays a little below the one that would hold the response, so that the motion follows the backbone whatever its stability
//! under a constant drive. Its first purpose is a response below the largest one of the wanted motion. A repeated descent goes on to an
//! orbit of the requested drive that is stable under this drive: where the drive that holds the response falls with the response,
//! through the setpoint. It may have to rise first, towards lower responses, because an orbit just above the fold and a large motion
//! can belong to the same drive. There the drive is handed over without a jump: response, frequency and particle are those of the orbit.

use crate::real::consts::TAU;

use crate::config::Config;
use crate::real::{self, Real};

/// Response at which the first descent ends, as a share of the largest wanted one.
const BELOW: Real = 0.97;
/// Periods for which it must have been that small.
const PERIODS: Real = 5.0;
/// Response, as a share of the largest wanted one, at which it ends with a larger holding drive than the setpoint: an asymmetric motion
/// that coexists with the wanted one has mostly ended there.
const LOW: Real = 0.85;
/// Largest holding drive at its end, as a multiple of the setpoint: the frequency could not follow a larger step.
const EXCESS: Real = 1.25;
/// Periods in which the response falls by a factor of e on the first descents, if the frequency follows; each repetition is slower.
const DESCENT: Real = 60.0;
/// Largest share of the holding drive that may be missing.
const MISSING: Real = 0.6;
/// Smallest drive, as a share of the holding drive of the last period: without a drive the phase is undefined.
const LEAST: Real = 0.3;
/// Phase error, rad, at which the descent waits for the frequency: near the fold the resonance frequency changes fast.
const FOLLOWED: Real = 0.1;
/// Relative distance of the holding drive from the setpoint from which on a repeated descent becomes slower, down to the share
/// `SLOWEST` of its rate: the particle follows late, and the stable orbits above the fold span a few percent of the response.
/// `SLOWEST` is also the smallest rate of the observer, in bandwidths of the detector.
const SLOWER: Real = 0.3;
const SLOWEST: Real = 0.05;
/// Rate of the observer, in units of the rate at which the setpoint of the drive changes the response. It must be fast compared with
/// the instability under a constant drive, and no faster, because it amplifies noise.
const OBSERVER_RATE: Real = 20.0;
/// Largest correction of its lag, as a share of the holding drive.
const CORRECTION: Real = 0.2;
/// Response from which on the holding drive is observed, as a multiple of the largest wanted one.
const OBSERVED: Real = 1.3;
/// By how much the holding drive must have risen and fallen, relative, to have had a maximum; and how near to the setpoint that is.
const RISEN: Real = 0.01;
const FALLEN: Real = 0.003;
const NEAR: Real = 0.97;
/// Difference of the holding drive that noise does not explain, in units of the scatter of its changes from period to period; and the
/// periods over which that is averaged.
const NOISE: Real = 4.0;
const SCATTER_PERIODS: Real = 20.0;
/// Growth of the response by which the motion is lost.
const LOST: Real = 1.15;
/// Smallest power that the impacts take, as a share of the largest before, of a motion that is not lost: at the lower end of the
/// symmetric motion it is a third.
const KEPT: Real = 0.2;
/// Uncertainty of that power, as a share of the one that the drive supplies.
const DOUBTFUL: Real = 0.03;

/// Coefficients of the descent.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Descent {
    /// Largest response amplitude of the wanted motion, m.
    largest: Real,
    /// Setpoint of the drive, m.
    amplitude: Real,
    /// Largest drive, m.
    amplitude_max: Real,
    /// Drive, m, that the damping of the structure needs for a response of 1 m.
    damping: Real,
    /// Growth rate of the response per drive, 1/s.
    gain: Real,
    /// Bandwidth of the detector, rad/s.
    bandwidth: Real,
}

/// Progress of a descent.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct DescentState {
    /// Smallest response amplitude, m.
    lowest: Real,
    /// Part of the present period, and the integral of the holding drive over it, m.
    part: Real,
    sum: Real,
    /// Mean holding drive of the last period, m; 0 before.
    holding: Real,
    /// Its change in that period, m, and the scatter of the changes.
    change: Real,
    scatter: Real,
    /// Drive, m, that is missing to hold the response.
    missing: Real,
    /// Largest product of the response and the drive that the impacts need, m².
    taken: Real,
    /// Periods below the response at which the first descent ends.
    below: Real,
    /// Smallest holding drive, m, and the largest since.
    extremes: Option<[Real; 2]>,
}

impl DescentState {
    /// The start of a descent from this response amplitude, m.
    pub fn from(response: Real) -> Self {
        Self {
            lowest: response,
            part: 0.0,
            sum: 0.0,
            holding: 0.0,
            change: 0.0,
            scatter: 0.0,
            missing: 0.0,
            taken: 0.0,
            below: 0.0,
            extremes: None,
        }
    }

    /// The start of a descent from this response amplitude, m, of a motion that the setpoint of the drive holds: the drive that holds the
    /// response is to be smaller at its end.
    pub fn below_setpoint(response: Real) -> Self {
        Self { extremes: Some([0.0, Real::MAX]), ..Self::from(response) }
    }
}

/// Measurements that a descent uses.
#[derive(Clone, Copy, Debug)]
pub struct Descending {
    /// Frequency, rad/s.
    pub omega: Real,
    /// Part of a period in this sample.
    pub part: Real,
    /// Mean response amplitude over the lag of the observer, m.
    pub response: Real,
    /// Drive that would hold the response, m.
    pub holding: Real,
    /// Phase error, rad, if it is valid.
    pub error: Option<Real>,
    /// Number of descents before.
    pub repetitions: u32,
    /// Response, m, above which the drive is not handed over.
    pub highest: Real,
}

/// What a sample of a descent leads to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Progress {
    /// The descent goes on.
    Descends,
    /// The motion is below the largest wanted response, or at an orbit of the requested drive.
    Arrived,
    /// The impacts have ended, or the response has grown.
    Lost,
}

impl Descent {
    /// The descent of a configuration.
    pub fn new(config: &Config) -> Self {
        Self {
            largest: config.captured_max.unwrap_or(Real::INFINITY),
            amplitude: config.amplitude,
            amplitude_max: config.amplitude_limit(),
            damping: config.damping_rate.unwrap_or(0.0) / config.response_gain,
            gain: config.response_gain,
            bandwidth: config.bandwidth,
        }
    }

    /// The drive, m, where `holding`, m, would hold the response at the phase error, rad.
    pub fn drive(&self, state: &DescentState, holding: Real, error: Real) -> Real {
        let least = LEAST * state.holding.max(LEAST * self.amplitude);
        ((holding - state.missing).max(least) / real::cos(error)).min(self.amplitude_max)
    }

    /// Rate of the observer, rad/s, at a response amplitude, m.
    pub fn observer_rate(&self, response: Real) -> Real {
        let rate = OBSERVER_RATE * self.gain * self.amplitude / response;
        rate.max(SLOWEST * self.bandwidth).min(self.bandwidth)
    }

    /// One sample. At the end of a period, decides how the descent goes on.
    pub fn advance(&self, state: &mut DescentState, seen: &Descending) -> Progress {
        state.lowest = state.lowest.min(seen.response);
        state.part += seen.part;
        state.sum += seen.part * seen.holding;
        if state.part < 1.0 {
            return Progress::Descends;
        }
        let holding = state.sum / state.part;
        (state.part, state.sum) = (0.0, 0.0);
        let is_below = seen.response < BELOW * self.largest;
        let taken = (holding - self.damping * seen.response) * seen.response;
        if is_below {
            state.taken = state.taken.max(taken);
        }
        state.below = if is_below { state.below + 1.0 } else { 0.0 };
        if seen.response > LOST * state.lowest
            || is_below && taken < KEPT * state.taken - DOUBTFUL * holding * seen.response
        {
            return Progress::Lost;
        }
        state.missing = self.missing(state, holding, seen);
        let change = holding - state.holding;
        state.scatter += ((change - state.change).abs() - state.scatter) / SCATTER_PERIODS;
        (state.holding, state.change) = (holding, change);
        let has_arrived = if seen.repetitions == 0 {
            let is_low = seen.response < LOW * self.largest && holding < EXCESS * self.amplitude;
            state.below >= PERIODS && (is_low || holding < self.amplitude)
        } else {
            self.is_at_orbit(state, holding, seen)
        };
        if has_arrived {
            Progress::Arrived
        } else {
            Progress::Descends
        }
    }

    /// The drive, m, that is to be missing.
    fn missing(&self, state: &DescentState, holding: Real, seen: &Descending) -> Real {
        let rate = 1.0 / (TAU / seen.omega * DESCENT * self.gain);
        let most = (MISSING * holding.max(0.0)).min(rate * seen.response);
        let (distance, slower) = ((holding - self.amplitude).abs(), SLOWER * self.amplitude);
        let near = if seen.repetitions > 0 && seen.response < BELOW * self.largest && distance < slower {
            (distance / slower).max(SLOWEST)
        } else {
            1.0
        };
        let follows = (1.0 - seen.error.unwrap_or(FOLLOWED).abs() / FOLLOWED).max(0.0);
        let missing = follows * near * most / seen.repetitions.max(1) as Real;
        if state.holding <= 0.0 {
            return missing;
        }
        // The observer lags. Where the holding drive rises on the descent, this would accelerate it.
        let lag = 1.0 / self.bandwidth + 1.0 / self.observer_rate(seen.response);
        let change = lag * seen.omega / TAU * (holding - state.holding);
        let largest = CORRECTION * holding.abs();
        missing - change.clamp(-largest, largest)
    }

    /// Whether the holding drive falls through the setpoint, or from a maximum near it, at a response of the wanted motion.
    fn is_at_orbit(&self, state: &mut DescentState, holding: Real, seen: &Descending) -> bool {
        if seen.response >= seen.highest.min(OBSERVED * self.largest) {
            return false;
        }
        let is_wanted = seen.response < self.largest;
        let [smallest, mut largest] = state.extremes.unwrap_or([holding; 2]);
        largest = largest.max(holding);
        if holding < smallest && (!is_wanted || largest < self.amplitude) {
            largest = holding;
        }
        let smallest = smallest.min(holding);
        state.extremes = Some([smallest, largest]);
        let noise = NOISE * state.scatter;
        let maximum = largest > (NEAR * self.amplitude).max((1.0 + RISEN) * smallest + noise);
        let fallen = (1.0 - FALLEN) * largest - noise;
        is_wanted && (maximum || largest > self.amplitude) && holding <= self.amplitude.min(fallen)
    }
}

#[cfg(all(test, not(feature = "f32")))]
mod tests;
