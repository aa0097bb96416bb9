//! A sampling grid within communication steps of any length.

use core::ops::Range;

/// An instant counts as a grid point if it is closer than this slack, in samples.
const SLACK: f64 = 1e-6;
/// Growth of the slack per sample: the rounding errors of the caller's steps accumulate.
const SLACK_PER_SAMPLE: f64 = 2e-9;
/// Largest slack, in samples.
const SLACK_MAX: f64 = 0.25;

/// Determines which of the samples at `0, sample_time, 2 sample_time, …` lie in successive steps `[t, t + h)`.
///
/// The clock counts samples, so none is lost or taken twice. Steps that are nominally a multiple of the sample time but
/// deviate from it by up to 1e-9, relative, contain the same number of samples every time.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct SampleClock {
    sample_time: f64,
    taken: u64,
}

impl SampleClock {
    /// A clock at time 0 with no sample taken; `sample_time` in s, above 0.
    #[must_use]
    pub const fn new(sample_time: f64) -> Self {
        Self { sample_time, taken: 0 }
    }

    /// Takes the samples before `until` (s since the start) and returns their numbers.
    ///
    /// A long step contains several samples, a short one perhaps none. The range is empty if `until` decreases or is NaN.
    pub fn take(&mut self, until: f64) -> Range<u64> {
        let end = until / self.sample_time;
        let slack = (SLACK + SLACK_PER_SAMPLE * end).min(SLACK_MAX);
        // The conversion saturates: NaN and negative numbers give 0.
        let end = (end - slack).ceil() as u64;
        let first = self.taken;
        self.taken = first.max(end);
        first..self.taken
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn counts(sample_time: f64, step: f64, steps: u32) -> impl Iterator<Item = usize> {
        let mut clock = SampleClock::new(sample_time);
        let mut t = 0.0;
        (0..steps).map(move |_| {
            t += step;
            clock.take(t).count()
        })
    }

    #[test]
    fn steps_of_one_sample_hold_one_long_ones_several_and_short_ones_one_now_and_then() {
        for deviation in [0.0, 1e-9, -1e-9, 1e-12, -1e-12] {
            assert!(counts(0.1, 0.1 * (1.0 + deviation), 1_000_000).all(|n| n == 1));
        }
        assert!(counts(0.1, 0.7, 1000).all(|n| n == 7));
        assert!(counts(0.1, 0.025, 12).eq([1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0]));
    }

    #[test]
    fn uneven_steps_lose_no_sample() {
        let mut clock = SampleClock::new(0.1);
        let mut count = 0;
        for until in [0.05, 0.35, 0.35, 0.2, f64::NAN, 0.4, 1.01] {
            for n in clock.take(until) {
                assert_eq!(n, count);
                count += 1;
            }
        }
        assert_eq!((count, clock.taken), (11, 11));
    }
}
