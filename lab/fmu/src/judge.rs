//! Whether the lock of a controller has settled that does not say so itself.

use std::f64::consts::TAU;

use phase_lock::Config;

/// Frequency and phase error must stay within the criterion of the configuration for its dwell.
pub(super) struct Judge {
    /// Largest phase error, rad.
    phase: f64,
    /// Largest relative change of the frequency during the dwell.
    drift: f64,
    /// Periods.
    dwell: f64,
    sample_time: f64,
    /// Periods for which the conditions have held, and the range of the frequency in them, rad/s.
    held: f64,
    range: [f64; 2],
}

impl Judge {
    /// By the lock criterion of `config`.
    pub fn new(config: &Config) -> Self {
        let dwell = f64::from(config.lock.dwell);
        Self {
            phase: config.lock.phase_tolerance,
            drift: config.lock.frequency_drift * dwell,
            dwell,
            sample_time: config.sample_time,
            held: 0.0,
            range: [0.0; 2],
        }
    }

    /// One sample; `locked` as the controller says, `phase_error` in rad.
    pub fn sample(&mut self, omega: f64, phase_error: f64, locked: bool) -> bool {
        let [low, high] = [self.range[0].min(omega), self.range[1].max(omega)];
        let steady = high - low <= self.drift * omega && phase_error.abs() <= self.phase;
        if locked && steady && self.held > 0.0 {
            self.range = [low, high];
            self.held += omega * self.sample_time / TAU;
        } else {
            self.range = [omega; 2];
            self.held = if locked && phase_error.abs() <= self.phase {
                f64::MIN_POSITIVE
            } else {
                0.0
            };
        }
        self.held >= self.dwell
    }
}

#[cfg(test)]
#[path = "../tests/unit/judge.rs"]
mod tests;
