//! A rig that stops on a flag, which a signal or another thread sets.

use std::sync::{
    Arc,
    atomic::{AtomicBool, Ordering},
};

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
    #[must_use]
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

    fn hold(&mut self, displacement: f64, step: f64) -> Result<(), RigError> {
        self.rig.hold(displacement, step)
    }

    fn ground_truth(&mut self) -> Result<Option<GroundTruth>, RigError> {
        self.rig.ground_truth()
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Mutex;

    use super::*;

    struct Log(Arc<Mutex<Vec<Drive>>>);

    impl Rig for Log {
        fn sense(&mut self) -> Result<Sensors, RigError> {
            Ok(Sensors { response: 1.0, reference: None })
        }

        fn advance(&mut self, drive: Drive, _: f64) -> Result<(), RigError> {
            self.0.lock().unwrap().push(drive);
            Ok(())
        }
    }

    #[test]
    fn a_rig_that_is_stopped_gets_a_zero_drive_and_fails() {
        let (drives, stop) = (Arc::default(), Arc::default());
        let mut rig = Stoppable::around(Box::new(Log(Arc::clone(&drives))), 0.1, &stop);
        let drive = Drive { omega: 1.0, amplitude: 2.0, displacement: 0.0 };
        assert_eq!(rig.sense().unwrap().response, 1.0);
        rig.advance(drive, 0.1).unwrap();
        stop.store(true, Ordering::Relaxed);
        assert!(rig.sense().unwrap_err().cause::<Interrupted>().is_some());
        assert_eq!(*drives.lock().unwrap(), [drive, Drive::default()]);
    }
}
