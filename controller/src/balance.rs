//! Balance of power between drive and response: a response that grows or falls as no structure can shows that a sensor or the drive has
//! failed, from the first periods of the drive on.
//!
//! Near resonance the amplitude of the response obeys `A' = g (E cos phi - E_R(A))` (`g`: `response_gain`, `phi`: phase error, `E_R`: the
//! drive that would hold the amplitude). Damping alone takes `delta A/g`, so that `E_R` is not below it; impacts take more, but at most
//! about as much as the largest drive has given. Three sums of what contradicts this, which start at 0 with the drive, are compared with
//! what the exchange between a loose particle and the structure, noise, and an inexact `g` explain:
//!
//! - growth that the drive has not given. A reversed sensor grows against the work of the drive, a response without a drive grows
//!   without any work, and one whose factor is three times too large by three times the work.
//! - loss beyond damping and impacts: a sensor whose factor falls.
//! - in the first periods, while the impacts cannot have taken half of the work: what the response is below that of the linear
//!   structure. A dead sensor, a shaker that is off, or a factor that is three times too small.

use crate::config::Config;
use crate::real::consts::{PI, TAU};
use crate::real::{Real, larger};

/// Largest growth without work: multiples of the largest drive and of the response. 1.6 times the largest of 2400 random rigs, half of
/// which started with a particle that moves.
const GROWTH: [Real; 2] = [3.0, 0.5];
/// Largest loss beyond damping and impacts: multiples of the largest drive and of the response before the loss. Four times the largest of 1200
/// random rigs that started at rest; one of 1200 with a particle that moves exceeds it.
const LOSS: [Real; 2] = [0.4, 0.12];
/// Largest distance below the linear response in the first periods: multiples of the largest drive and of the linear response. Four and
/// 1.4 times the largest of 2400 random rigs.
const FIRST: [Real; 2] = [1.0, 0.5];
/// Largest distance below the linear response if the damping is not known: a fifth is left after eight periods with a damping ratio of 0.1.
const FIRST_UNKNOWN: [Real; 2] = [1.0, 0.8];
/// Length of the first periods: turns, and time constants of the detector, whose lag they include.
const FIRST_TIMES: [Real; 2] = [3.0, 3.0];

/// Coefficients of the balance.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Balance {
    /// Growth of the response per drive and sample.
    gain: Real,
    /// Share of the response that damping takes per sample.
    damping: Real,
    /// What impacts take at most, per largest drive and sample; with the damping if it is not known: in the steady linear motion it takes
    /// what the drive gives.
    taken: Real,
    /// `FIRST`, or `FIRST_UNKNOWN`.
    below: [Real; 2],
    /// Whether the base follows the drive with a known gain.
    is_known: bool,
    /// s
    sample_time: Real,
    /// Length of the first periods, s.
    first: Real,
}

/// The sums since the drive began.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct BalanceState {
    /// Response amplitude at the last sample, m.
    response: Real,
    /// Largest drive, m.
    drive: Real,
    /// Growth without work, m, above its lowest value.
    growth: Real,
    /// Loss beyond damping and impacts, m, above its lowest value.
    loss: Real,
    /// Amplitude of the linear structure under the same drive, m.
    linear: Real,
    /// Time since the drive began, s.
    driven: Real,
    /// Phase since the first reading, rad, up to half a period, and the largest reading until then, m: a motion that the detectors have
    /// still to see.
    begun: Real,
    initial: Real,
}

/// What a sample shows.
#[derive(Clone, Copy, Debug)]
pub struct Powers {
    /// Reading of the response, m.
    pub reading: Real,
    /// Phase of a sample, rad.
    pub turn: Real,
    /// Drive, m.
    pub drive: Real,
    /// The drive with the lag of the detectors, m.
    pub lagging: Real,
    /// Measured amplitude of the base, m.
    pub base: Real,
    /// Measured amplitude of the response, m.
    pub response: Real,
    /// Cosine of the phase error; 1 if it is not known.
    pub cosine: Real,
}

impl Balance {
    /// The balance of a configuration.
    pub fn new(config: &Config) -> Self {
        let [turns, lags] = FIRST_TIMES;
        let gain = config.response_gain * config.sample_time;
        let (taken, below) = match config.damping_rate {
            Some(_) => (gain, FIRST),
            None => (2.0 * gain, FIRST_UNKNOWN),
        };
        Self {
            gain,
            taken,
            below,
            damping: config.damping_rate.unwrap_or(0.0) * config.sample_time,
            is_known: config.base_bandwidth.is_none(),
            sample_time: config.sample_time,
            first: turns * TAU / config.omega_start + lags / config.bandwidth,
        }
    }

    /// Takes a sample. Returns whether it contradicts the balance.
    pub fn contradicts(&self, state: &mut BalanceState, seen: &Powers) -> bool {
        if state.begun < PI {
            state.begun += seen.turn;
            state.initial = larger(state.initial, seen.reading.abs());
        }
        if seen.drive == 0.0 {
            let BalanceState { begun, initial, .. } = *state;
            *state = BalanceState {
                response: seen.response,
                begun,
                initial,
                ..BalanceState::default()
            };
            return false;
        }
        state.drive = larger(state.drive, seen.drive);
        state.driven += self.sample_time;
        let (response, drive) = (seen.response, state.drive);
        let rise = response - state.response;
        state.response = response;
        let work = self.gain * seen.base * seen.cosine;
        let given = self.gain * if self.is_known { seen.lagging } else { seen.base } * seen.cosine;
        state.growth = larger(state.growth + rise - work, 0.0);
        state.loss = larger(
            state.loss + work - rise - self.damping * response - self.taken * drive,
            0.0,
        );
        state.linear += given - self.damping * state.linear;
        let exceeds = |sum: Real, [of_drive, of_response]: [Real; 2], response: Real| {
            sum > of_drive * drive + of_response * response
        };
        exceeds(state.growth - state.initial, GROWTH, response)
            || exceeds(state.loss, LOSS, response + state.loss)
            || state.driven < self.first && exceeds(state.linear - response, self.below, state.linear)
    }
}

#[cfg(all(test, not(feature = "f32")))]
mod tests {
    use super::*;

    const SAMPLE_TIME: Real = 1e-3;
    const BALANCE: Balance = Balance {
        gain: 0.03,
        damping: 3e-4,
        taken: 0.03,
        below: FIRST,
        is_known: true,
        sample_time: SAMPLE_TIME,
        first: 1.0,
    };

    /// Samples until a response that grows by `factor` times the work of a drive of 1 contradicts the balance, within ten periods.
    fn samples(factor: Real, base: Real, cosine: Real) -> Option<usize> {
        let (mut state, mut response) = (BalanceState::default(), 0.0);
        (0..1000).position(|_| {
            response += BALANCE.gain * factor - BALANCE.damping * response;
            let seen = Powers {
                reading: 0.0,
                turn: 0.01 * TAU,
                drive: 1.0,
                lagging: 1.0,
                base,
                response,
                cosine,
            };
            BALANCE.contradicts(&mut state, &seen)
        })
    }

    #[test]
    fn a_linear_response_and_one_with_impacts_agree() {
        assert_eq!(samples(1.0, 1.0, 1.0), None);
        assert_eq!(samples(0.7, 1.0, 1.0), None);
        assert_eq!(samples(1.3, 1.0, 1.0), None);
    }

    #[test]
    fn a_reversed_a_dead_and_an_exchanged_sensor_contradict_within_two_periods() {
        assert!(samples(1.0, 1.0, -1.0).is_some_and(|n| n < 100));
        assert!(samples(0.0, 1.0, 1.0).is_some_and(|n| n < 100));
        assert!(samples(1.0, 0.0, 1.0).is_some_and(|n| n < 250));
    }

    #[test]
    fn a_factor_of_three_or_of_a_third_contradicts_in_the_first_periods() {
        assert!(samples(3.0, 1.0, 1.0).is_some_and(|n| n < 800));
        assert!(samples(0.3, 1.0, 1.0).is_some_and(|n| n < 300));
    }
}
