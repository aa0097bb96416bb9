//! Ctrl-C and SIGTERM while a rig is driven: the drive becomes zero and the session ends before the program does.

use std::{
    process,
    sync::{
        Arc, OnceLock,
        atomic::{AtomicBool, Ordering},
    },
};

use vines::rig::{Drive, GroundTruth, Rig, RigError, Sensors};

use super::failure::Failure;

/// Exit code of a program that a signal ended: 128 and the number of SIGINT.
pub(super) const INTERRUPTED: u8 = 130;

/// A flag that a signal sets. A second signal ends the program at once.
pub(super) fn stop_flag() -> Result<Arc<AtomicBool>, Failure> {
    static FLAG: OnceLock<Arc<AtomicBool>> = OnceLock::new();
    if let Some(flag) = FLAG.get() {
        return Ok(Arc::clone(flag));
    }
    let flag = Arc::clone(FLAG.get_or_init(Arc::default));
    let signal = Arc::clone(&flag);
    ctrlc::set_handler(move || {
        if signal.swap(true, Ordering::Relaxed) {
            process::exit(INTERRUPTED.into());
        }
    })
    .map_err(|error| Failure::run(format!("cannot wait for Ctrl-C: {error}")))?;
    Ok(flag)
}

/// The run was interrupted.
#[derive(Debug, thiserror::Error)]
#[error("interrupted by a signal; the drive is zero")]
pub(super) struct Interrupted;

/// A rig that stops on a signal.
pub(super) struct Interruptible {
    rig: Box<dyn Rig>,
    sample_time: f64,
    stop: Arc<AtomicBool>,
}

impl Interruptible {
    /// `sample_time` in s.
    pub(super) fn around(rig: Box<dyn Rig>, sample_time: f64, stop: &Arc<AtomicBool>) -> Self {
        Self { rig, sample_time, stop: Arc::clone(stop) }
    }
}

impl Rig for Interruptible {
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

    fn hold(&mut self, displacement: f64, step: f64) -> Result<(), RigError> {
        self.rig.hold(displacement, step)
    }

    fn ground_truth(&mut self) -> Result<Option<GroundTruth>, RigError> {
        self.rig.ground_truth()
    }
}
