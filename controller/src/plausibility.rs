//! Plausibility of readings: one that differs from the detector's prediction by far more than those of the last periods shows that a
//! sensor, the drive or the clock has failed, often within a few samples.

use crate::real::consts::TAU;

use crate::balance::{Balance, BalanceState, GROWING, Powers};
use crate::config::Config;
use crate::detector::Estimate;
use crate::drive::PresentDrive;
use crate::real::{Real, larger, smaller};

/// Phase, rad, after which a reading that has not changed is no gap of a connection, and within which a second implausible reading is no glitch.
pub const PAUSE: Real = TAU / 12.0;
/// Differences that count as normal, in units of the largest one of a period: noise of twice the size is too rare.
const NORMAL: Real = 2.0;
/// Sum of the amplitudes of all harmonics above the fundamental, as a share of the limit, above which a sensor saturates: clipping at half of
/// the amplitude makes 0.27 of the fundamental.
const DISTORTION: Real = 0.5;

/// Number of the channel of the base.
const BASE: usize = 1;

/// Coefficients of the check.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Plausibility {
    /// Largest difference beyond the normal one, as a share of the amplitude.
    limit: Option<Real>,
    /// Time in the closed loop before the response is known, s.
    warm_up: Real,
    /// Time constant of the detector, s.
    detector: Real,
    balance: Balance,
}

/// Largest differences in this period and in the two before it, m, for each channel.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Differences {
    largest: [[Real; 3]; 2],
    /// Phase since the start of the period, rad.
    phase: Real,
    /// Time for which each channel has been distorted, s.
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
            // A transient of the detector has decayed to exp(-2 pi), 0.2 %.
            warm_up: larger(TAU / config.bandwidth, GROWING * TAU / config.omega_start),
            detector: 1.0 / config.bandwidth,
            balance: Balance::new(config),
        }
    }

    /// Takes differences between readings and their predictions, m, the estimates, the factors by which the amplitude has
    /// changed since, and the times for which the readings have not changed, s. `closed`: time in the closed loop, s.
    pub fn take(
        &self,
        state: &mut Differences,
        differences: [(Real, &Estimate, Real); 2],
        unchanged: [Real; 2],
        drive: PresentDrive,
        sample_time: Real,
        closed: Real,
    ) {
        let turn = drive.omega * sample_time;
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
            let amplitude = estimate.amplitude;
            let share = if unchanged[n] * drive.omega > PAUSE { 0.0 } else { 1.0 };
            let difference = difference.abs();
            // A fault may have begun at the end of the last period.
            let normal = NORMAL * smaller(*last, *before);
            if let Some(limit) = self.limit {
                // What the drive has changed and the detector has still to learn.
                let lag = (change - 1.0).abs();
                let clear = estimate.harmonics_within((DISTORTION * limit + lag) * amplitude);
                state.distorted[n] = if clear { 0.0 } else { state.distorted[n] + sample_time };
                let expected = (share * limit * change + lag) * amplitude + normal;
                // The base follows the drive at once; the response grows, and its detector lags.
                let is_known = n == BASE || closed > self.warm_up;
                state.since[n] += turn;
                if is_known && (difference > expected || state.distorted[n] > self.detector) {
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
