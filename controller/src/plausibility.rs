//! Plausibility of readings: one that differs from the detector's prediction by far more than those of the last periods shows that a
//! sensor, the drive or the clock has failed, often within a few samples.

use crate::real::consts::TAU;

use crate::balance::{Balance, BalanceState, Powers};
use crate::config::Config;
use crate::detector::Estimate;
use crate::real::{Real, larger, smaller};

/// Time in the closed loop before the check begins, in time constants of the detector, and in turns.
const WARM_UP: [Real; 2] = [6.0, 10.0];
/// Phase, rad, after which a reading that does not change at all needs a smaller difference: this share of the limit. Shorter pauses are
/// those of a connection that loses a few samples. An implausible reading that no other follows within this phase is a glitch.
const PAUSE: Real = TAU / 12.0;
const PAUSE_SHARE: Real = 0.15;
/// Differences that count as normal, in units of the largest one of a period.
const NORMAL: Real = 2.0;

/// Sum of the amplitudes of all harmonics above the fundamental, as a share of the limit, above which a sensor saturates, and turns for
/// which it must last: a change of the drive disturbs the harmonics for one or two.
const DISTORTION: Real = 0.5;
const LASTS: Real = 5.0;

/// Number of the channel of the base.
const BASE: usize = 1;

/// Coefficients of the check.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Plausibility {
    /// Largest difference beyond the normal one, as a share of the amplitude.
    limit: Option<Real>,
    /// s
    warm_up: Real,
    /// Harmonics that the detectors use.
    harmonics: usize,
    balance: Balance,
}

/// Largest differences in this period and in the two before it, m, for each channel.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Differences {
    largest: [[Real; 3]; 2],
    /// Phase since the start of the period, rad.
    phase: Real,
    /// Phase for which each channel has been distorted, rad.
    distorted: [Real; 2],
    /// What the last readings of the channels were.
    found: [Found; 2],
    /// Phase since the last implausible reading of each channel, rad.
    since: [Real; 2],
    balance: BalanceState,
}

/// What a reading is.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
enum Found {
    #[default]
    Plausible,
    /// An implausible reading alone.
    Glitch,
    /// One of several.
    Fault,
}

impl Plausibility {
    /// The check of a configuration.
    pub fn new(config: &Config) -> Self {
        Self {
            limit: config.residual_max,
            warm_up: (WARM_UP[0] / config.bandwidth).max(WARM_UP[1] * TAU / config.omega_start),
            harmonics: config.harmonics.into(),
            balance: Balance::new(config),
        }
    }

    /// Takes differences between readings and their predictions, m, the estimates, the factors by which the amplitude has
    /// changed since, and the times for which the readings have not changed, s. `omega` in rad/s; `closed`: time in the closed loop, s.
    pub fn take(
        &self,
        state: &mut Differences,
        differences: [(Real, &Estimate, Real); 2],
        unchanged: [Real; 2],
        omega: Real,
        sample_time: Real,
        closed: Real,
    ) {
        let turn = omega * sample_time;
        state.phase += turn;
        if state.phase >= TAU {
            state.phase = 0.0;
            for [now, last, before] in &mut state.largest {
                (*before, *last, *now) = (*last, *now, 0.0);
            }
        }
        state.found = [Found::Plausible; 2];
        for (n, [now, last, before]) in state.largest.iter_mut().enumerate() {
            let (difference, estimate, change) = differences[n];
            let amplitude = estimate.amplitude();
            let share = if unchanged[n] * omega > PAUSE { PAUSE_SHARE } else { 1.0 };
            let difference = difference.abs();
            // A fault may have begun at the end of the last period.
            let normal = NORMAL * smaller(*last, *before);
            if let Some(limit) = self.limit {
                // What the drive has changed and the detector has still to learn.
                let lag = (change - 1.0).abs();
                let distorted = &mut state.distorted[n];
                let clear = estimate.harmonics_within((DISTORTION * limit + lag) * amplitude, self.harmonics);
                *distorted = if clear { 0.0 } else { *distorted + turn };
                let expected = (share * limit * change + lag) * amplitude + normal;
                // The base follows the drive at once; the response grows, and its detector lags.
                let is_known = n == BASE || closed > self.warm_up;
                state.since[n] += turn;
                if is_known && (difference > expected || state.distorted[n] > LASTS * TAU) {
                    state.found[n] = if state.since[n] > PAUSE {
                        Found::Glitch
                    } else {
                        Found::Fault
                    };
                    state.since[n] = 0.0;
                }
            }
            if state.found[n] != Found::Glitch {
                *now = larger(*now, difference);
            }
        }
    }

    /// Whether the amplitudes contradict the balance of power between drive and response.
    pub fn contradicts(&self, state: &mut Differences, seen: &Powers) -> bool {
        self.balance.contradicts(&mut state.balance, seen) && self.limit.is_some()
    }

    /// Whether the last readings show a fault.
    pub fn refuses(&self, state: &Differences) -> bool {
        state.found.contains(&Found::Fault)
    }

    /// Whether the last reading of each channel is a glitch.
    pub fn glitches(&self, state: &Differences) -> [bool; 2] {
        state.found.map(|found| found == Found::Glitch)
    }
}
