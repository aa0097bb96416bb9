//! The loop filter: from a phase error to a frequency.

use crate::gains::Gains;

/// A PI filter with bounds, a limited rate of change, and conditional anti-windup.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct LoopFilter {
    pub gains: Gains,
    /// rad/s
    pub omega_min: f64,
    /// rad/s
    pub omega_max: f64,
    /// Largest change in one sample, rad/s; infinite where there is no limit.
    pub max_change: f64,
    /// s
    pub sample_time: f64,
}

/// State of the loop filter.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Frequency {
    /// Centre frequency and integral part, rad/s.
    pub integral: f64,
    /// Frequency put out, rad/s.
    pub omega: f64,
}

impl Frequency {
    pub fn at(omega: f64) -> Self {
        Self {
            integral: omega,
            omega,
        }
    }
}

impl LoopFilter {
    /// Closes the loop for one sample on `error`, rad.
    pub fn follow(&self, frequency: &mut Frequency, error: f64) {
        let wanted = frequency.integral + self.gains.proportional * error;
        let granted = self.limit(frequency.omega, wanted);
        frequency.omega = granted;
        // The integral moves unless a limit already withholds what it would ask more of.
        let withheld = wanted - granted;
        if withheld * error <= 0.0 {
            let integral = frequency.integral + self.gains.integral * self.sample_time * error;
            frequency.integral = integral.clamp(self.omega_min, self.omega_max);
        }
    }

    /// Shifts the frequency by `shift`, rad/s, with the loop as it is.
    pub fn shift(&self, frequency: &mut Frequency, shift: f64) {
        let integral = frequency.integral + shift;
        frequency.integral = integral.clamp(self.omega_min, self.omega_max);
    }

    /// Opens the loop for one sample and moves towards `omega`, rad/s.
    pub fn go_to(&self, frequency: &mut Frequency, omega: f64) {
        *frequency = Frequency::at(self.limit(frequency.omega, omega));
    }

    /// Opens the loop for one sample; the integral part stays.
    pub fn hold(&self, frequency: &mut Frequency) {
        frequency.omega = self.limit(frequency.omega, frequency.integral);
    }

    fn limit(&self, before: f64, wanted: f64) -> f64 {
        wanted
            .clamp(before - self.max_change, before + self.max_change)
            .clamp(self.omega_min, self.omega_max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FILTER: LoopFilter = LoopFilter {
        gains: Gains {
            proportional: 1.0,
            integral: 5.0,
        },
        omega_min: 9.0,
        omega_max: 11.0,
        max_change: f64::INFINITY,
        sample_time: 0.01,
    };

    #[test]
    fn a_saturated_loop_recovers_at_once() {
        let mut frequency = Frequency::at(10.0);
        for _ in 0..100_000 {
            FILTER.follow(&mut frequency, 2.0);
            assert!(frequency.omega <= 11.0 && frequency.integral <= 11.0);
        }
        assert_eq!(frequency.omega, 11.0);
        FILTER.follow(&mut frequency, -0.5);
        assert!(frequency.omega < 11.0 - 0.4, "{frequency:?}");
    }

    #[test]
    fn a_limited_rate_does_not_wind_up_either() {
        let filter = LoopFilter {
            max_change: 1e-3,
            ..FILTER
        };
        let mut frequency = Frequency::at(10.0);
        for _ in 0..100 {
            let before = frequency.omega;
            filter.follow(&mut frequency, 0.8);
            assert!((frequency.omega - before).abs() <= 1e-3 + 1e-15);
        }
        assert_eq!(frequency.integral, 10.0);
    }

    #[test]
    fn a_negative_error_lowers_the_frequency() {
        let mut frequency = Frequency::at(10.0);
        FILTER.follow(&mut frequency, -0.1);
        assert!(frequency.omega < 10.0 && frequency.integral < 10.0);
    }
}
