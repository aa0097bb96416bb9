//! Stationarity of phase, frequency and amplitude.
//!
//! A motion is stationary if the means over a quarter of the dwell differ by no more than the drift tolerances. Where noise hides so
//! small a drift, the differences of means over half a dwell are compared with the scatter of the periods within the blocks instead:
//! a drift makes the range of four consecutive means ten times as large as the scatter, noise about twice.
//!
//! The detector's residual, the difference between readings and their prediction by the odd harmonics, tells noise from motion: noise has
//! no correlation with itself a few samples before. What is correlated is no noise.

use crate::config::LockCriterion;
use crate::real::{self, Real, Sum};

/// Number of blocks of a dwell.
const DWELL: usize = 4;
/// Number of blocks that the criterion for noise needs: two dwells.
const BLOCKS: usize = 2 * DWELL;
/// Largest range of four means over two blocks that counts as noise, in units of the scatter.
const NOISE_RANGE: Real = 5.0;
/// Smallest sum of the squared differences from period to period over that of the squared deviations from the mean that counts as
/// noise. A drift over five periods has 0.4, noise about 1.
const RANDOM: Real = 0.5;
/// Largest correlation of the residual with itself a few samples before that counts as noise.
const CORRELATED: Real = 0.5;
/// Largest scatter of the periods, relative, that counts as noise.
const NOISE_MAX: Real = 0.03;

/// The criterion. Impacts cause ripple within a period, so it compares means over whole periods only.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Stationarity {
    /// rad
    pub phase_tolerance: Real,
    /// rad
    pub unlock_tolerance: Real,
    /// Relative, per period.
    pub frequency_drift: Real,
    /// Relative, per period.
    pub amplitude_drift: Real,
    /// Periods in a block.
    pub block: u32,
}

/// Values of a sample that the criterion uses.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Reading {
    /// Phase error, rad.
    pub error: Real,
    /// Integral part of the frequency, rad/s. It is smoother than the frequency, and equal to it at zero phase error.
    pub integral: Real,
    /// Frequency, rad/s.
    pub omega: Real,
    /// Response amplitude, m.
    pub amplitude: Real,
    /// Differences of two readings, a few samples apart, from their predictions, m.
    pub residuals: [Real; 2],
    /// Whether these values are valid.
    pub valid: bool,
}

/// Sums over the samples of a period.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Sums {
    error: Sum,
    integral: Sum,
    omega: Sum,
    amplitude: Sum,
    power: Real,
    common: Real,
    samples: u64,
    invalid: u64,
}

/// Mean of a quantity over the periods of a block, the sum of the squared deviations from it, and that of the squared differences
/// from period to period.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Scatter {
    mean: Real,
    squares: Real,
    differences: Real,
    last: Real,
}

impl Scatter {
    /// Welford's update with the `n`-th value.
    fn add(&mut self, value: Real, n: Real) {
        let before = value - self.mean;
        self.mean += before / n;
        self.squares += before * (value - self.mean);
        if n > 1.0 {
            self.differences += (value - self.last) * (value - self.last);
        }
        self.last = value;
    }
}

/// Means over the periods of a block.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Block {
    periods: u32,
    error: Real,
    omega: Real,
    /// Sums over the residual: of its squares, and of the products of samples a few apart, m².
    power: Real,
    common: Real,
    integral: Scatter,
    amplitude: Scatter,
}

impl Block {
    fn add(&mut self, period: &Sums) {
        self.periods += 1;
        let (n, samples) = (self.periods as Real, period.samples as Real);
        self.error += (period.error.get() / samples - self.error) / n;
        self.omega += (period.omega.get() / samples - self.omega) / n;
        self.power += period.power;
        self.common += period.common;
        self.integral.add(period.integral.get() / samples, n);
        self.amplitude.add(period.amplitude.get() / samples, n);
    }
}

/// The running dwell: the last complete blocks, and the present one.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Dwell {
    blocks: [Block; BLOCKS],
    complete: usize,
    period: Sums,
    block: Block,
    means: Option<(Real, Real)>,
    settled: bool,
}

impl Dwell {
    /// Forgets all blocks. (A call: its code is long.)
    #[inline(never)]
    pub fn restart(&mut self) {
        *self = Self::default();
    }

    /// Whether the criterion is met.
    pub fn settled(&self) -> bool {
        self.settled
    }

    /// Means over the complete blocks of the last dwell: frequency, rad/s, and response amplitude, m.
    pub fn means(&self) -> Option<(Real, Real)> {
        self.means
    }

    fn last(&self, count: usize) -> &[Block] {
        &self.blocks[BLOCKS - count..]
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
            block: lock.dwell.div_ceil(DWELL as u32),
        }
    }

    /// Takes a sample; `period_ends` marks the last one of a period. Returns whether the lock is lost.
    pub fn update(&self, dwell: &mut Dwell, reading: &Reading, period_ends: bool) -> bool {
        let period = &mut dwell.period;
        period.error.add(reading.error);
        period.integral.add(reading.integral);
        period.omega.add(reading.omega);
        period.amplitude.add(reading.amplitude);
        let [now, before] = reading.residuals;
        period.power += now * now;
        period.common += now * before;
        period.samples += 1;
        period.invalid += u64::from(!reading.valid);
        if !period_ends {
            return false;
        }
        let period = core::mem::take(&mut dwell.period);
        let error = (period.error.get() / period.samples as Real).abs();
        let lost = period.invalid > 0 || error > self.unlock_tolerance;
        if lost {
            dwell.restart();
        } else {
            self.end_period(dwell, &period);
        }
        lost
    }

    /// (A call: its code is long, and few samples end a period.)
    #[inline(never)]
    fn end_period(&self, dwell: &mut Dwell, period: &Sums) {
        dwell.block.add(period);
        if dwell.block.periods < self.block {
            return;
        }
        dwell.blocks.rotate_left(1);
        dwell.blocks[BLOCKS - 1] = core::mem::take(&mut dwell.block);
        dwell.complete = (dwell.complete + 1).min(BLOCKS);
        let last = dwell.last(dwell.complete.min(DWELL));
        let omega = mean(last, |block| block.omega);
        dwell.means = Some((omega, mean(last, |block| block.amplitude.mean)));
        let is_smooth = dwell.complete >= DWELL && self.is_smooth(dwell.last(DWELL));
        let is_noise = dwell.complete == BLOCKS && self.is_noise(&dwell.blocks);
        let [power, common] = residual(dwell.last(DWELL));
        let is_random = common <= CORRELATED * power;
        dwell.settled = is_smooth || is_noise && is_random;
    }

    fn is_smooth(&self, blocks: &[Block]) -> bool {
        // Periods between the centres of the first and the last block. A slope would miss the crest of a slow modulation; the
        // range does not.
        let distance = self.block as Real * (DWELL - 1) as Real;
        blocks.iter().all(|block| block.error.abs() <= self.phase_tolerance)
            && range(blocks, 1, |block| block.integral.mean) <= self.frequency_drift * distance
            && range(blocks, 1, |block| block.amplitude.mean) <= self.amplitude_drift * distance
    }

    fn is_noise(&self, blocks: &[Block; BLOCKS]) -> bool {
        let distance = (2 * self.block) as Real * (DWELL - 1) as Real;
        let is_constant = |value: fn(&Block) -> Scatter, drift: Real| {
            let squares = mean(blocks, |block| value(block).squares);
            let scatter = real::sqrt(squares / self.block as Real) / value(&blocks[BLOCKS - 1]).mean;
            let largest = (NOISE_RANGE * scatter).max(drift * distance);
            let differences = mean(blocks, |block| value(block).differences);
            let random =
                differences >= RANDOM * squares || range(blocks, 2, |block| value(block).mean) <= drift * distance;
            random && scatter <= NOISE_MAX && range(blocks, 2, |block| value(block).mean) <= largest
        };
        mean(blocks, |block| block.error).abs() <= self.phase_tolerance
            && is_constant(|block| block.integral, self.frequency_drift)
            && is_constant(|block| block.amplitude, self.amplitude_drift)
    }
}

/// Sums over the residual: of its squares, and of the products.
fn residual(blocks: &[Block]) -> [Real; 2] {
    blocks.iter().fold([0.0; 2], |[power, common], block| {
        [power + block.power, common + block.common]
    })
}

fn mean(blocks: &[Block], value: impl Fn(&Block) -> Real) -> Real {
    blocks.iter().map(value).sum::<Real>() / blocks.len() as Real
}

/// Difference of the largest and the smallest mean over `group` blocks, relative to the last one.
fn range(blocks: &[Block], group: usize, value: impl Fn(&Block) -> Real) -> Real {
    let (mut low, mut high, mut last) = (Real::INFINITY, Real::NEG_INFINITY, 0.0);
    for group in blocks.chunks(group) {
        last = mean(group, &value);
        low = low.min(last);
        high = high.max(last);
    }
    (high - low) / last
}

#[cfg(all(test, not(feature = "f32")))]
mod tests;
