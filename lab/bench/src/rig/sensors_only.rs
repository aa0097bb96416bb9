//! A rig that shows its sensors only, as a real one does.

use super::{Drive, Rig, RigError, Sensors};

/// A rig without its ground truth.
pub struct SensorsOnly(Box<dyn Rig>);

impl SensorsOnly {
    /// Hides the ground truth of a rig.
    #[must_use]
    pub fn around(rig: Box<dyn Rig>) -> Self {
        Self(rig)
    }
}

impl Rig for SensorsOnly {
    fn sense(&mut self) -> Result<Sensors, RigError> {
        self.0.sense()
    }

    fn advance(&mut self, drive: Drive, step: f64) -> Result<(), RigError> {
        self.0.advance(drive, step)
    }

    fn hold(&mut self, drive: Drive, step: f64) -> Result<(), RigError> {
        self.0.hold(drive, step)
    }
}
