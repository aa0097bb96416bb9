//! Checks of a configuration: the range of each parameter, and the relations between them.

use crate::real::consts::PI;

use crate::amplitude_loop::AmplitudeLoop;
use crate::config::Config;
use crate::detector::PhaseDetector;
use crate::drive::Drive;
use crate::error::{ConfigError, Quantity};
use crate::parameters::PARAMETERS;
use crate::real::Real;

impl Config {
    /// Refuses the first parameter that is out of its range or contradicts another.
    pub(crate) fn check(&self) -> Result<(), ConfigError> {
        for parameter in &PARAMETERS {
            parameter.check(self)?;
        }
        self.check_frequencies()?;
        self.check_drive()?;
        self.check_detector()?;
        self.check_structure()?;
        let lock = &self.lock;
        Quantity::new("lock.unlock_tolerance", lock.unlock_tolerance, "rad").check(
            lock.unlock_tolerance >= lock.phase_tolerance,
            "a finite number, lock.phase_tolerance or above",
        )
    }

    /// Largest bandwidth of the detector, rad/s, for this sample time and number of harmonics.
    #[must_use]
    pub fn bandwidth_max(&self) -> Real {
        1.0 / (PhaseDetector::new(self).coefficients() as Real * self.sample_time)
    }

    /// Order of the highest harmonic of the detector. The sampling must resolve it up to `omega_max`.
    #[must_use]
    pub fn highest_harmonic(&self) -> usize {
        PhaseDetector::new(self).highest_harmonic()
    }

    fn check_frequencies(&self) -> Result<(), ConfigError> {
        Quantity::new("omega_max", self.omega_max, "rad/s")
            .check(self.omega_max > self.omega_min, "a finite number above omega_min")?;
        Quantity::new("omega_start", self.omega_start, "rad/s").check(
            (self.omega_min..=self.omega_max).contains(&self.omega_start),
            "between omega_min and omega_max",
        )
    }

    fn check_drive(&self) -> Result<(), ConfigError> {
        Quantity::new("amplitude", self.amplitude, "m").check(
            self.amplitude <= self.amplitude_limit(),
            "a finite number, 0 or above and at most amplitude_max",
        )?;
        match self.base_bandwidth {
            Some(wide) if wide > self.bandwidth => {
                Err(Quantity::new("base_bandwidth", wide, "rad/s").refuse("above 0 and at most bandwidth, or none"))
            }
            _ => Ok(()),
        }
    }

    /// A damping rate far above the bandwidth leads to gains that overflow, and a delay whose phase is lost in rounding to no reference.
    fn check_structure(&self) -> Result<(), ConfigError> {
        if !AmplitudeLoop::new(self, &Drive::new(self)).is_finite() {
            return Err(
                Quantity::new("damping_rate", self.damping_rate.unwrap_or(0.0), "rad/s").refuse(
                    "a lower value, or none: for this bandwidth, response_gain and sample_time the gains overflow",
                ),
            );
        }
        Quantity::new("delay", self.delay, "s").check(
            self.omega_max * self.delay * Real::EPSILON < 1.0,
            "0 or above, and so short that the rounding error of omega_max delay is below 1 rad",
        )
    }

    fn check_detector(&self) -> Result<(), ConfigError> {
        let detector = PhaseDetector::new(self);
        Quantity::new("bandwidth", self.bandwidth, "rad/s").check(
            detector.total_step() <= 1.0,
            "lower: (2 harmonics + 1) bandwidth sample_time must stay below 1",
        )?;
        let highest = self.highest_harmonic() as Real;
        Quantity::new("sample_time", self.sample_time, "s").check(
            self.omega_max * self.sample_time * highest < PI,
            "more than two samples per period of the highest harmonic at omega_max",
        )
    }
}
