//! The lock criterion: the motion is steady if no period of the dwell differs from another.
//!
//! Means over whole periods are compared, because impacts cause ripple within a period. Frequency and amplitude are steady if the difference
//! between the largest and the smallest mean is at most what the allowed drift explains, and that between the means of the quarters as well. A
//! range, unlike a slope, does not miss the crest of a slow modulation. Where that fails, twice the dwell is judged, and the noise of the
//! sensor may explain a part: the longer the quarters, the less of a drift it hides.
//!
//! The detector's residual shows the noise: a filter of bandwidth `wLP` passes the share `wLP sample_time` of the power of white noise to
//! its estimate. The estimate of a modulated motion changes by far more than this share of its residual, so that a modulation is no noise.

use crate::config::Config;
use crate::real::{self, Real, Sum, larger, smaller};

/// Blocks of the dwell, which moves on by one of them.
const DWELL: usize = 4;
/// Range of noise, in standard deviations: ten independent normal values exceed it with a probability of 5 % (studentised range).
const NOISE_RANGE: Real = 4.5;
/// Periods that the detector correlates, about: the inverse of the initial bandwidth, a tenth of the frequency, is 1.6 periods.
const CORRELATED: Real = 2.0;

/// Coefficients of the criterion.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Stationarity {
    /// rad
    phase_tolerance: Real,
    /// rad
    unlock_tolerance: Real,
    /// Largest drifts of frequency and amplitude, relative, per period.
    drifts: [Real; 2],
    /// Standard deviation of the response amplitude per that of white noise of a sample.
    passed: Real,
    /// Standard deviation of the frequency's integral part per that of the phase, 1/s.
    integral_gain: Real,
    /// Periods in a block.
    block: u32,
}

/// Values of a sample that the criterion uses.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LockSample {
    /// Phase error, rad.
    pub error: Real,
    /// Integral part of the frequency, rad/s. It is smoother than the frequency, and equal to it at zero phase error.
    pub integral: Real,
    /// Frequency, rad/s.
    pub omega: Real,
    /// Response amplitude, m.
    pub amplitude: Real,
    /// Mean square of the response's residual, m².
    pub residual_power: Real,
    /// Whether these values are valid.
    pub valid: bool,
}

/// Sums over the samples of a period.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Period {
    error: Sum,
    integral: Sum,
    omega: Sum,
    amplitude: Sum,
    samples: u64,
    invalid: bool,
}

/// Sums over the periods of a block, and the smallest and the largest frequency (integral part) and amplitude.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Block {
    periods: u32,
    error: Real,
    omega: Real,
    residual_power: Real,
    /// Frequency (integral part) and amplitude.
    compared: [Real; 2],
    low: [Real; 2],
    high: [Real; 2],
}

impl Block {
    /// Both blocks as one.
    fn joined(self, other: Self) -> Self {
        if self.periods == 0 {
            return other;
        }
        Self {
            periods: self.periods + other.periods,
            error: self.error + other.error,
            omega: self.omega + other.omega,
            residual_power: self.residual_power + other.residual_power,
            compared: [0, 1].map(|n| self.compared[n] + other.compared[n]),
            low: [0, 1].map(|n| smaller(self.low[n], other.low[n])),
            high: [0, 1].map(|n| larger(self.high[n], other.high[n])),
        }
    }
}

/// The running dwell: the last complete blocks, and the present one.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Dwell {
    period: Period,
    block: Block,
    complete: [Block; 2 * DWELL],
    /// Means over the complete blocks of the last dwell: frequency, rad/s, and response amplitude, m.
    pub means: Option<(Real, Real)>,
    /// Whether the criterion is met.
    pub settled: bool,
}

impl Dwell {
    /// Forgets all blocks. (A call: its code is long.)
    #[inline(never)]
    pub fn restart(&mut self) {
        *self = Self::default();
    }
}

impl Stationarity {
    /// The criterion of a configuration.
    pub fn new(config: &Config) -> Self {
        let lock = &config.lock;
        let block = lock.dwell.div_ceil(DWELL as u32);
        Self {
            phase_tolerance: lock.phase_tolerance,
            unlock_tolerance: lock.unlock_tolerance,
            drifts: [lock.frequency_drift, lock.amplitude_drift],
            passed: real::sqrt(config.bandwidth * config.sample_time),
            // With three poles at bandwidth/3 it is bandwidth/14.7 for white noise of one channel, and bandwidth/10.4 for that of both.
            integral_gain: config.bandwidth / 9.0,
            block,
        }
    }

    /// Takes a sample; `period_ends` marks the last one of a period. Returns whether the lock is lost.
    pub fn update(&self, dwell: &mut Dwell, sample: &LockSample, period_ends: bool) -> bool {
        let period = &mut dwell.period;
        period.error.add(sample.error);
        period.integral.add(sample.integral);
        period.omega.add(sample.omega);
        period.amplitude.add(sample.amplitude);
        period.samples += 1;
        period.invalid |= !sample.valid;
        if !period_ends {
            return false;
        }
        let period = core::mem::take(&mut dwell.period);
        let lost = period.invalid || period.error.get().abs() > self.unlock_tolerance * period.samples as Real;
        if lost {
            dwell.restart();
        } else {
            self.end_period(dwell, &period, sample.residual_power);
        }
        lost
    }

    /// (A call: its code is long, and few samples end a period.)
    #[inline(never)]
    fn end_period(&self, dwell: &mut Dwell, period: &Period, residual_power: Real) {
        let mean = |sum: Sum| sum.get() / period.samples as Real;
        let compared = [period.integral, period.amplitude].map(mean);
        dwell.block = dwell.block.joined(Block {
            periods: 1,
            error: mean(period.error),
            omega: mean(period.omega),
            residual_power,
            compared,
            low: compared,
            high: compared,
        });
        if dwell.block.periods == self.block {
            dwell.complete.rotate_left(1);
            dwell.complete[2 * DWELL - 1] = core::mem::take(&mut dwell.block);
            let (before, last) = dwell.complete.split_at(DWELL);
            let all = joined(last);
            let periods = all.periods as Real;
            dwell.means = Some((all.omega / periods, all.compared[1] / periods));
            dwell.settled = last[0].periods > 0 && self.is_steady(last, 0.0)
                || before[0].periods > 0 && self.is_steady(&dwell.complete, NOISE_RANGE);
        }
    }

    /// Whether frequency and amplitude are constant but for the allowed drift and noise within this range, in standard deviations.
    fn is_steady(&self, blocks: &[Block], range: Real) -> bool {
        let all = joined(blocks);
        let periods = all.periods as Real;
        // m; relative to the amplitude this is the noise of the phase.
        let noise = range * self.passed * real::sqrt(all.residual_power / periods);
        let noises = [self.integral_gain * noise * periods / all.compared[1], noise];
        let quarter = blocks.len() / DWELL;
        let share = real::sqrt(CORRELATED * DWELL as Real / periods);
        let is_constant = |n: usize| {
            let means = blocks.chunks(quarter).map(|quarter| {
                let quarter = joined(quarter);
                quarter.compared[n] / quarter.periods as Real
            });
            let (low, high) = means.fold((Real::INFINITY, 0.0), |(low, high), mean| {
                (smaller(low, mean), larger(high, mean))
            });
            let drift = self.drifts[n] * (periods - 1.0) * all.high[n];
            all.high[n] - all.low[n] <= drift + noises[n] && high - low <= drift + share * noises[n]
        };
        all.error.abs() <= self.phase_tolerance * periods && is_constant(0) && is_constant(1)
    }
}

/// All blocks as one.
fn joined(blocks: &[Block]) -> Block {
    blocks.iter().copied().fold(Block::default(), Block::joined)
}

#[cfg(test)]
#[cfg(not(feature = "f32"))]
mod tests {
    use super::*;

    /// A detector of a tenth of the frequency, with a hundred samples per period.
    const CRITERION: Stationarity = Stationarity {
        phase_tolerance: 0.01,
        unlock_tolerance: 0.1,
        drifts: [1e-6, 1e-4],
        passed: 0.08,
        integral_gain: 0.1,
        block: 5,
    };
    const CONSTANT: LockSample = LockSample {
        error: 0.0,
        integral: 1.0,
        omega: 1.0,
        amplitude: 1.0,
        residual_power: 0.0,
        valid: true,
    };

    /// Number of periods of ten samples until settled; None after 200.
    fn periods_to_settle(reading: impl Fn(f64) -> LockSample) -> Option<u32> {
        let mut dwell = Dwell::default();
        (1..=200).find(|period| {
            for sample in 0..10 {
                let periods = f64::from(*period) + f64::from(sample) / 10.0;
                CRITERION.update(&mut dwell, &reading(periods), sample == 9);
            }
            dwell.settled
        })
    }

    /// A reproducible number between -1 and 1.
    fn noise(n: f64) -> f64 {
        let x = libm::sin(n * 12.9898) * 43_758.547;
        2.0 * (x - libm::floor(x)) - 1.0
    }

    /// An amplitude with a drift per period and noise of `scatter` in its means, and readings with noise of the power that leads to it.
    fn noisy(drift: f64, scatter: f64) -> impl Fn(f64) -> LockSample {
        move |t| LockSample {
            amplitude: 1.0 + drift * t + scatter * 3_f64.sqrt() * noise(libm::floor(t - 0.05)),
            residual_power: (scatter / CRITERION.passed) * (scatter / CRITERION.passed),
            ..CONSTANT
        }
    }

    #[test]
    fn a_signal_settles_after_the_dwell_unless_it_drifts_or_is_modulated_and_after_two_where_noise_hides_the_tolerances()
     {
        use core::f64::consts::TAU;
        let amplitude = |amplitude: f64| LockSample { amplitude, ..CONSTANT };
        let sine = |period: f64, t: f64| libm::sin(TAU * t / period);
        let settles = |reading: &dyn Fn(f64) -> LockSample, expected: Option<u32>, what: &str| {
            assert_eq!(periods_to_settle(reading), expected, "{what}");
        };
        settles(&|_| CONSTANT, Some(20), "constant");
        settles(
            &|t| LockSample { error: 0.05 * sine(1.0, t), ..CONSTANT },
            Some(20),
            "ripple within the period",
        );
        settles(&|t| amplitude(1.0 + 0.9e-4 * t), Some(20), "slow drift");
        settles(&|t| amplitude(1.0 + 1.1e-4 * t), None, "drift of the amplitude");
        settles(
            &|t| LockSample { integral: 1.0 + 1.1e-6 * t, ..CONSTANT },
            None,
            "drift of the frequency",
        );
        settles(
            &|t| amplitude(1.0 + 0.1 * libm::sin(0.06 * t)),
            None,
            "crest of a slow modulation",
        );
        settles(
            &|t| LockSample { valid: t != 10.5, ..CONSTANT },
            Some(30),
            "one invalid sample",
        );
        settles(&noisy(0.0, 0.01), Some(40), "noise");
        settles(
            &|t| LockSample { residual_power: 0.0, ..noisy(0.0, 0.01)(t) },
            None,
            "scatter without noise of the readings",
        );
        settles(&noisy(1.5e-3, 0.01), None, "drift that exceeds the noise");
        settles(&noisy(5e-3, 0.01), None, "drift that exceeds the noise by far");
        // A range of 0.04, where noise alone may have 0.045; means of quarters differ by 0.025 or more, by noise at most by 0.02.
        let modulated = |t: f64| LockSample { amplitude: 1.0 + 0.02 * sine(40.0, t), ..noisy(0.0, 0.01)(t) };
        settles(&modulated, None, "modulation within the noise of the readings");
        for period in [4.0, 10.0, 30.0, 60.0] {
            let rate = TAU / period;
            let residual = rate / libm::hypot(rate, 0.1 * TAU);
            let estimate = libm::sqrt(1.0 - residual * residual);
            let reading = |t: f64| LockSample {
                amplitude: 1.0 + 0.02 * estimate * sine(period, t),
                residual_power: 0.5 * (0.02 * residual) * (0.02 * residual),
                ..CONSTANT
            };
            settles(&reading, None, "a modulation is no noise although it has a residual");
        }
    }

    #[test]
    fn the_lock_is_lost_only_beyond_the_wider_tolerance() {
        let mut dwell = Dwell::default();
        let mut is_lost = |error| CRITERION.update(&mut dwell, &LockSample { error, ..CONSTANT }, true);
        assert!(!is_lost(0.05) && !is_lost(-0.09));
        assert!(is_lost(0.11));
    }
}
