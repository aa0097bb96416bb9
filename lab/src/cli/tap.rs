//! A stage around a rig that shows every sample to a function: for `--record` and `--watch`.

use vines::record::Sample;
use vines::rig::{Drive, GroundTruth, Rig, RigError, RigStage, Sensors};

/// A rig whose samples are shown to a function, each with the time to the next one, s.
pub(super) struct Tap<F> {
    rig: Box<dyn Rig>,
    now: Sample,
    on_sample: F,
}

impl<F: FnMut(Sample, f64) + 'static> Tap<F> {
    pub(super) fn around(rig: Box<dyn Rig>, on_sample: F) -> Box<dyn Rig> {
        Box::new(Self { rig, now: Sample::default(), on_sample })
    }
}

impl<F: FnMut(Sample, f64) + 'static> RigStage for Tap<F> {
    fn inner(&mut self) -> &mut dyn Rig {
        self.rig.as_mut()
    }

    fn sense(&mut self) -> Result<Sensors, RigError> {
        self.now.sensors = self.rig.sense()?;
        Ok(self.now.sensors)
    }

    fn advance(&mut self, drive: Drive, step: f64) -> Result<(), RigError> {
        self.now.command.drive = drive;
        (self.on_sample)(self.now, step);
        self.now.time += step;
        self.rig.advance(drive, step)
    }

    fn ground_truth(&mut self) -> Result<Option<GroundTruth>, RigError> {
        self.now.ground_truth = self.rig.ground_truth()?;
        Ok(self.now.ground_truth)
    }
}
