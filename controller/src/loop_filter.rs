//! The loop filter: computes the frequency from the phase error.

use crate::config::Config;
use crate::gains::Gains;
use crate::real::{Real, Sum, limited};

/// A PI filter with limits, a limited rate of change, and conditional anti-windup.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct LoopFilter {
    pub gains: Gains,
    /// rad/s
    pub omega_min: Real,
    /// rad/s
    pub omega_max: Real,
    /// Largest change per sample, rad/s; infinite without a limit.
    pub max_change: Real,
    /// s
    pub sample_time: Real,
}

/// State of the loop filter.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Frequency {
    /// Centre frequency and integral part, rad/s.
    pub integral: Sum,
    /// Output frequency, rad/s.
    pub omega: Real,
}

impl Frequency {
    /// The state at a constant frequency, rad/s.
    pub fn at(omega: Real) -> Self {
        Self { integral: Sum::new(omega), omega }
    }
}

impl LoopFilter {
    /// The filter of a configuration.
    pub fn new(config: &Config) -> Self {
        Self {
            gains: config.gains(),
            omega_min: config.omega_min,
            omega_max: config.omega_max,
            max_change: config.change(config.omega_rate),
            sample_time: config.sample_time,
        }
    }

    /// One sample with the loop closed; `error` in rad.
    pub fn follow(&self, frequency: &mut Frequency, error: Real) {
        let unlimited = frequency.integral.get() + self.gains.proportional * error;
        frequency.omega = self.limit(frequency.omega, unlimited);
        // Anti-windup: no integration in the direction in which the output is already limited.
        let excess = unlimited - frequency.omega;
        if excess * error <= 0.0 {
            self.shift(frequency, self.gains.integral * self.sample_time * error);
        }
    }

    /// Shifts the centre frequency by `shift`, rad/s.
    pub fn shift(&self, frequency: &mut Frequency, shift: Real) {
        frequency.integral.add(shift);
        let (now, limits) = (frequency.integral.get(), self.omega_min..=self.omega_max);
        if !limits.contains(&now) {
            frequency.integral = Sum::new(limited(now, self.omega_min, self.omega_max));
        }
    }

    /// One sample with the loop open; the frequency moves towards `omega`, rad/s.
    pub fn go_to(&self, frequency: &mut Frequency, omega: Real) {
        *frequency = Frequency::at(self.limit(frequency.omega, omega));
    }

    /// One sample with the loop open; the integral part does not change.
    pub fn hold(&self, frequency: &mut Frequency) {
        frequency.omega = self.limit(frequency.omega, frequency.integral.get());
    }

    fn limit(&self, before: Real, unlimited: Real) -> Real {
        let reachable = limited(unlimited, before - self.max_change, before + self.max_change);
        limited(reachable, self.omega_min, self.omega_max)
    }
}

#[cfg(test)]
#[cfg(not(feature = "f32"))]
mod tests {
    use super::*;

    const FILTER: LoopFilter = LoopFilter {
        gains: Gains { proportional: 1.0, integral: 5.0 },
        omega_min: 9.0,
        omega_max: 11.0,
        max_change: f64::INFINITY,
        sample_time: 0.01,
    };

    #[test]
    fn a_saturated_loop_recovers_within_one_sample() {
        let mut frequency = Frequency::at(10.0);
        for _ in 0..100_000 {
            FILTER.follow(&mut frequency, 2.0);
            assert!(frequency.omega <= 11.0 && frequency.integral.get() <= 11.0);
        }
        assert_eq!(frequency.omega, 11.0);
        FILTER.follow(&mut frequency, -0.5);
        assert!(
            frequency.omega < 11.0 - 0.4 && frequency.integral.get() < 11.0,
            "{frequency:?}"
        );
    }

    #[test]
    fn a_limited_rate_causes_no_windup() {
        let filter = LoopFilter { max_change: 1e-3, ..FILTER };
        let mut frequency = Frequency::at(10.0);
        for _ in 0..100 {
            let before = frequency.omega;
            filter.follow(&mut frequency, 0.8);
            assert!((frequency.omega - before).abs() <= 1e-3 + 1e-15);
        }
        assert_eq!(frequency.integral.get(), 10.0);
    }
}
