//! A rig that stops on a flag, which a signal or another thread sets.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use thiserror::Error;

use super::{Drive, GroundTruth, Rig, RigError, Sensors};

/// The flag was set.
#[derive(Debug, Error)]
#[error("interrupted by a signal; the drive is zero")]
pub struct Interrupted;

/// A rig that stops on a flag: it gets a zero drive, and its next reading is the error [`Interrupted`].
pub struct Stoppable {
    rig: Box<dyn Rig>,
    sample_time: f64,
    stop: Arc<AtomicBool>,
}

impl Stoppable {
    /// `sample_time` in s.
    pub fn around(rig: Box<dyn Rig>, sample_time: f64, stop: &Arc<AtomicBool>) -> Self {
        Self { rig, sample_time, stop: Arc::clone(stop) }
    }
}

impl Rig for Stoppable {
    fn sense(&mut self) -> Result<Sensors, RigError> {
        let sensors = self.rig.sense()?;
        if self.stop.load(Ordering::Relaxed) {
            self.rig.advance(Drive::default(), self.sample_time)?;
            return Err(RigError::Failed(Interrupted.into()));
        }
        Ok(sensors)
    }

    fn advance(&mut self, drive: Drive, step: f64) -> Result<(), RigError> {
        self.rig.advance(drive, step)
    }

    fn hold(&mut self, drive: Drive, step: f64) -> Result<(), RigError> {
        self.rig.hold(drive, step)
    }

    fn ground_truth(&mut self) -> Result<Option<GroundTruth>, RigError> {
        self.rig.ground_truth()
    }
}

#[cfg(test)]
#[path = "../../tests/unit/stoppable.rs"]
mod tests;
