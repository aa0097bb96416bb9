//! The `[record]` section: how long to drive, to record and to average.

use serde::{Deserialize, Serialize};

use super::{Controller, SceneError, validate::Quantity};

/// Durations of an experiment.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Record {
    /// Time limit for the lock, natural periods; by default at least 3000, and 20 relaxation times.
    pub lock_periods: Option<f64>,
    /// How long the settled lock is held and measured, natural periods.
    pub hold_periods: f64,
    /// Length of the recorded decay, natural periods; by default as long as the linear response takes to fall to 5 %.
    pub decay_periods: Option<f64>,
    /// Window of the fit along the decay, periods of the motion.
    pub window_periods: f64,
}

impl Default for Record {
    fn default() -> Self {
        Self {
            lock_periods: None,
            hold_periods: 20.0,
            decay_periods: None,
            window_periods: 2.5,
        }
    }
}

/// Most samples of one record: about 2 GiB in memory.
const MOST_SAMPLES: f64 = 2e7;

impl Record {
    /// `lock_periods` is the time limit for the lock, as set or by default.
    pub(super) fn check(&self, controller: &Controller, lock_periods: f64) -> Result<(), SceneError> {
        let unit = "(natural periods)";
        Quantity::new("record.lock_periods", lock_periods, unit).positive()?;
        Quantity::new("record.hold_periods", self.hold_periods, unit).check(
            (3.0..=1e6).contains(&self.hold_periods),
            "must be from 3 (to count impacts and measure) to 1000000",
        )?;
        if let Some(decay_periods) = self.decay_periods {
            Quantity::new("record.decay_periods", decay_periods, unit).positive()?;
        }
        let longest = self.decay_periods.unwrap_or(1000.0);
        Quantity::new("record.window_periods", self.window_periods, "(periods)").check(
            (0.5..=longest).contains(&self.window_periods),
            format!("must be from 0.5 to {longest} (decay_periods, or 1000)"),
        )?;
        let samples =
            controller.samples_per_period * (lock_periods + self.hold_periods + self.decay_periods.unwrap_or(0.0));
        Quantity::new("samples_per_period times all periods of [record]", samples, "samples")
            .check(samples <= MOST_SAMPLES, "must be at most 20 million")
    }
}
