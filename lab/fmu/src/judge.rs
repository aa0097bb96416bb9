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
mod tests {
    use super::*;

    #[test]
    fn a_lock_has_settled_after_a_dwell_without_a_change() {
        let config = Config { sample_time: 0.01 * TAU, ..Config::for_resonance(1.0, 1.0) };
        let mut judge = Judge::new(&config);
        let periods = config.lock.dwell as usize;
        let mut count = |omega: f64, error: f64, locked: bool| {
            (0..100 * (periods + 1)).position(|_| judge.sample(omega, error, locked))
        };
        assert_eq!(count(1.0, 0.0, false), None);
        assert_eq!(count(1.0, 0.1, true), None, "not in phase");
        let first = count(1.0, 0.0, true).unwrap();
        assert!(first.abs_diff(100 * periods) <= 2, "{first}");
        // Another frequency starts anew.
        let again = count(1.01, 0.0, true).unwrap();
        assert!(again.abs_diff((100.0 * periods as f64 / 1.01) as usize) <= 2, "{again}");
        let mut drifting = Judge::new(&config);
        assert!((0..100 * (periods + 1)).all(|n| !drifting.sample(1.0 + 1e-5 * n as f64, 0.0, true)));
    }
}
