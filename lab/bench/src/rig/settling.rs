//! Whether the lock of a controller that does not say so has settled.

use std::f64::consts::TAU;

use phase_lock::Config;

/// The lock criterion for a controller that reports no lock of its own, an FMU or a peer: frequency and phase error must stay within the
/// criterion of the configuration for its dwell.
#[derive(Debug, Clone)]
pub struct Settling {
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

impl Settling {
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

    /// Takes a sample; `locked` as the controller says, `phase_error` in rad. Returns whether the lock has settled.
    pub fn sample(&mut self, omega: f64, phase_error: f64, locked: bool) -> bool {
        let [low, high] = [self.range[0].min(omega), self.range[1].max(omega)];
        let in_phase = locked && phase_error.abs() <= self.phase;
        if in_phase && high - low <= self.drift * omega && self.held > 0.0 {
            self.range = [low, high];
            self.held += omega * self.sample_time / TAU;
        } else {
            self.range = [omega; 2];
            self.held = if in_phase { f64::MIN_POSITIVE } else { 0.0 };
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
        let mut settling = Settling::new(&config);
        let periods = config.lock.dwell as usize;
        let mut count = |omega: f64, error: f64, locked: bool| {
            (0..100 * (periods + 1)).position(|_| settling.sample(omega, error, locked))
        };
        assert_eq!(count(1.0, 0.0, false), None);
        assert_eq!(count(1.0, 0.1, true), None, "not in phase");
        let first = count(1.0, 0.0, true).unwrap();
        assert!(first.abs_diff(100 * periods) <= 2, "{first}");
        // Another frequency starts anew.
        let again = count(1.01, 0.0, true).unwrap();
        assert!(again.abs_diff((100.0 * periods as f64 / 1.01) as usize) <= 2, "{again}");
        let mut drifting = Settling::new(&config);
        assert!((0..100 * (periods + 1)).all(|n| !drifting.sample(1.0 + 1e-5 * n as f64, 0.0, true)));
    }
}
