//! Plausibility of readings: one that differs from the detector's prediction by far more than those of the last periods shows that a
//! sensor, the drive or the clock has failed, often within a few samples.

use core::f64::consts::TAU;

use crate::config::Config;

/// Time in the closed loop before the check begins, in time constants of the detector.
const WARM_UP: f64 = 6.0;
/// Phase, rad, after which a reading that does not change at all needs a smaller difference: this share of the limit. Shorter pauses are
/// those of a connection that loses a few samples.
const PAUSE: f64 = TAU / 12.0;
const PAUSE_SHARE: f64 = 0.15;
/// Differences that count as normal, in units of the largest one of the last two periods.
const NORMAL: f64 = 2.0;

/// Coefficients of the check.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Plausibility {
    /// Largest difference beyond the normal one, as a share of the amplitude.
    limit: Option<f64>,
    /// s
    warm_up: f64,
}

/// Largest differences in this period and in the two before it, m, for each channel.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Differences {
    largest: [[f64; 3]; 2],
    /// Phase since the start of the period, rad.
    phase: f64,
    /// Whether the last readings were plausible.
    implausible: bool,
}

impl Plausibility {
    /// The check of a configuration.
    pub fn new(config: &Config) -> Self {
        Self {
            limit: config.residual_max,
            warm_up: WARM_UP / config.bandwidth,
        }
    }

    /// Takes differences between readings and their predictions, m, in signals of those amplitudes, m, whose readings have not changed
    /// for those times, s. `omega` in rad/s.
    pub fn take(
        &self,
        state: &mut Differences,
        differences: [(f64, f64); 2],
        unchanged: [f64; 2],
        omega: f64,
        sample_time: f64,
    ) {
        state.phase += omega * sample_time;
        if state.phase >= TAU {
            state.phase = 0.0;
            for [now, last, before] in &mut state.largest {
                (*before, *last, *now) = (*last, *now, 0.0);
            }
        }
        state.implausible = false;
        for (n, [now, last, before]) in state.largest.iter_mut().enumerate() {
            let (difference, amplitude) = differences[n];
            let share = if unchanged[n] * omega > PAUSE { PAUSE_SHARE } else { 1.0 };
            let difference = difference.abs();
            let normal = NORMAL * last.max(*before);
            state.implausible |= self
                .limit
                .is_some_and(|limit| difference > share * limit * amplitude + normal);
            *now = now.max(difference);
        }
    }

    /// Whether the last readings show a fault, `closed` seconds after the loop was closed.
    pub fn refuses(&self, state: &Differences, closed: f64) -> bool {
        state.implausible && closed > self.warm_up
    }
}
