//! Stationarity of phase, frequency and amplitude.

use crate::config::LockCriterion;

/// Number of blocks of a dwell.
const BLOCKS: usize = 4;

/// Deviation, in standard deviations of the noise, that counts as noise.
const NOISE: f64 = 4.0;
/// Weight of a new period in the running mean square of the noise.
const FOLLOW: f64 = 0.125;

/// The criterion. Impacts cause ripple within a period, so it compares means over whole periods only.
///
/// Noise widens all limits: without that, a noisy sensor would never allow a lock. Its size is taken from second differences of the
/// phase error from period to period, to which smooth changes contribute little. The detector gives amplitude and phase
/// the same relative noise.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Stationarity {
    /// rad
    pub phase_tolerance: f64,
    /// rad
    pub unlock_tolerance: f64,
    /// Relative, per period.
    pub frequency_drift: f64,
    /// Relative, per period.
    pub amplitude_drift: f64,
    /// Periods in a block.
    pub block: u32,
}

/// Values of a sample that the criterion uses.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Reading {
    /// Phase error, rad.
    pub error: f64,
    /// Integral part of the frequency, rad/s. It is smoother than the frequency, and equal to it at zero phase error.
    pub integral: f64,
    /// Frequency, rad/s.
    pub omega: f64,
    /// Response amplitude, m.
    pub amplitude: f64,
    /// Whether these values are valid.
    pub valid: bool,
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Sums {
    error: f64,
    integral: f64,
    omega: f64,
    amplitude: f64,
    samples: u64,
    invalid: u64,
}

impl Sums {
    fn add(&mut self, other: &Sums) {
        self.error += other.error;
        self.integral += other.integral;
        self.omega += other.omega;
        self.amplitude += other.amplitude;
        self.samples += other.samples;
        self.invalid += other.invalid;
    }
}

/// Means over a block.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Block {
    integral: f64,
    omega: f64,
    amplitude: f64,
}

/// White noise of a quantity from period to period.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Noise {
    before: [f64; 2],
    periods: u32,
    mean_square: f64,
}

impl Noise {
    fn take(&mut self, value: f64) {
        if self.periods >= 2 {
            // White noise of variance 1 gives second differences the variance 1 + 4 + 1.
            let difference = value - 2.0 * self.before[0] + self.before[1];
            let weight = FOLLOW.max(1.0 / f64::from(self.periods - 1));
            self.mean_square += weight * (difference * difference / 6.0 - self.mean_square);
        }
        self.before = [value, self.before[0]];
        self.periods = self.periods.saturating_add(1);
    }

    /// The largest deviation of a mean over some periods that counts as noise.
    fn limit(&self, periods: u32) -> f64 {
        NOISE * libm::sqrt(self.mean_square / f64::from(periods))
    }
}

/// The running dwell: the last complete blocks, and the present one.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Dwell {
    blocks: [Block; BLOCKS],
    complete: usize,
    period: Sums,
    block: Sums,
    periods: u32,
    settled: bool,
    /// Of the phase error, rad, and of the proportional part of the frequency, relative.
    noise: [Noise; 2],
}

impl Dwell {
    /// Whether the criterion is met.
    pub fn settled(&self) -> bool {
        self.settled
    }

    /// Means over the complete blocks: frequency, rad/s, and response amplitude, m.
    pub fn means(&self) -> Option<(f64, f64)> {
        let complete = &self.blocks[BLOCKS - self.complete..];
        let mean = |value: fn(&Block) -> f64| complete.iter().map(value).sum::<f64>() / self.complete as f64;
        (self.complete > 0).then(|| (mean(|block| block.omega), mean(|block| block.amplitude)))
    }
}

impl Stationarity {
    /// The criterion of a configuration.
    pub fn new(lock: &LockCriterion) -> Self {
        Self {
            phase_tolerance: lock.phase_tolerance,
            unlock_tolerance: lock.unlock_tolerance,
            frequency_drift: lock.frequency_drift,
            amplitude_drift: lock.amplitude_drift,
            block: lock.dwell.div_ceil(BLOCKS as u32),
        }
    }

    /// Takes a sample; `period_ends` marks the last one of a period. Returns whether the lock is lost.
    pub fn update(&self, dwell: &mut Dwell, reading: &Reading, period_ends: bool) -> bool {
        dwell.period.add(&Sums {
            error: reading.error,
            integral: reading.integral,
            omega: reading.omega,
            amplitude: reading.amplitude,
            samples: 1,
            invalid: u64::from(!reading.valid),
        });
        if !period_ends {
            return false;
        }
        let period = core::mem::take(&mut dwell.period);
        let error = (period.error / period.samples as f64).abs();
        let valid = period.invalid == 0;
        dwell.noise[0].take(period.error / period.samples as f64);
        dwell.noise[1].take((period.omega - period.integral) / period.integral);
        if valid && error <= self.phase_tolerance + dwell.noise[0].limit(1) {
            self.end_period(dwell, &period);
        } else {
            *dwell = Dwell { noise: dwell.noise, ..Dwell::default() };
        }
        !valid || error > self.unlock_tolerance
    }

    fn end_period(&self, dwell: &mut Dwell, period: &Sums) {
        dwell.block.add(period);
        dwell.periods += 1;
        if dwell.periods < self.block {
            return;
        }
        let sums = core::mem::take(&mut dwell.block);
        let samples = sums.samples as f64;
        dwell.periods = 0;
        dwell.blocks.rotate_left(1);
        dwell.blocks[BLOCKS - 1] = Block {
            integral: sums.integral / samples,
            omega: sums.omega / samples,
            amplitude: sums.amplitude / samples,
        };
        dwell.complete = (dwell.complete + 1).min(BLOCKS);
        // Periods between the centres of the first and the last block. A slope would miss the crest of a slow
        // modulation; the range does not.
        let distance = f64::from(self.block) * (BLOCKS - 1) as f64;
        let by_noise = dwell.noise.map(|noise| noise.limit(self.block));
        dwell.settled = dwell.complete == BLOCKS
            && range(&dwell.blocks, |block| block.integral) <= self.frequency_drift * distance + by_noise[1]
            && range(&dwell.blocks, |block| block.amplitude) <= self.amplitude_drift * distance + by_noise[0];
    }
}

/// Difference of the largest and the smallest value, relative to the last one.
fn range(blocks: &[Block; BLOCKS], value: impl Fn(&Block) -> f64) -> f64 {
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    for block in blocks {
        low = low.min(value(block));
        high = high.max(value(block));
    }
    (high - low) / value(&blocks[BLOCKS - 1])
}

#[cfg(test)]
mod tests {
    use super::*;

    const CRITERION: Stationarity = Stationarity {
        phase_tolerance: 0.01,
        unlock_tolerance: 0.1,
        frequency_drift: 1e-6,
        amplitude_drift: 1e-4,
        block: 5,
    };
    const CONSTANT: Reading = Reading {
        error: 0.0,
        integral: 1.0,
        omega: 1.0,
        amplitude: 1.0,
        valid: true,
    };

    /// Number of periods of ten samples until settled; None after 200.
    fn periods_to_settle(reading: impl Fn(f64) -> Reading) -> Option<u32> {
        let mut dwell = Dwell::default();
        (1..=200).find(|period| {
            for sample in 0..10 {
                let periods = f64::from(*period) + f64::from(sample) / 10.0;
                CRITERION.update(&mut dwell, &reading(periods), sample == 9);
            }
            dwell.settled()
        })
    }

    #[test]
    fn a_constant_signal_settles_after_the_dwell() {
        assert_eq!(periods_to_settle(|_| CONSTANT), Some(20));
    }

    #[test]
    fn ripple_within_the_period_does_not_matter() {
        let reading = |t: f64| Reading {
            error: 0.05 * libm::sin(core::f64::consts::TAU * t),
            ..CONSTANT
        };
        assert_eq!(periods_to_settle(reading), Some(20));
    }

    #[test]
    fn a_signal_that_drifts_too_fast_does_not_settle() {
        let amplitude = |rate: f64| move |t: f64| Reading { amplitude: 1.0 + rate * t, ..CONSTANT };
        assert_eq!(periods_to_settle(amplitude(1.1e-4)), None);
        assert_eq!(periods_to_settle(amplitude(0.9e-4)), Some(20));
        let frequency = |t: f64| Reading { integral: 1.0 + 1.1e-6 * t, ..CONSTANT };
        assert_eq!(periods_to_settle(frequency), None);
    }

    #[test]
    fn a_slow_modulation_is_not_stationary_at_its_crest() {
        let reading = |t: f64| Reading { amplitude: 1.0 + 0.1 * libm::sin(0.06 * t), ..CONSTANT };
        assert_eq!(periods_to_settle(reading), None);
    }

    #[test]
    fn one_invalid_sample_restarts_the_dwell() {
        let reading = |t: f64| Reading { valid: t != 10.5, ..CONSTANT };
        assert_eq!(periods_to_settle(reading), Some(30));
    }

    #[test]
    fn the_lock_is_lost_only_beyond_the_wider_tolerance() {
        let mut dwell = Dwell::default();
        let mut is_lost = |error| CRITERION.update(&mut dwell, &Reading { error, ..CONSTANT }, true);
        assert!(!is_lost(0.05) && !is_lost(-0.09));
        assert!(is_lost(0.11));
    }
}
