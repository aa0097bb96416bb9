//! Rig and controller, sample by sample. Whatever fails, the rig is left with a drive of zero as far as it still takes one.

use std::f64::consts::TAU;

use super::{Evidence, ExperimentError, PhaseError, Sample, Stage};
use crate::rig::{Command, Controller, Drive, Fault, LoopState, Rig};
use crate::scene::Scene;

/// Rig and controller, and the samples so far.
pub(crate) struct Bench<'a, R: Rig + ?Sized, C: ?Sized> {
    rig: &'a mut R,
    pub controller: &'a mut C,
    scene: &'a Scene,
    /// s
    pub sample_time: f64,
    pub samples: &'a mut Vec<Sample>,
    /// Samples since the start.
    pub taken: usize,
    /// Phase of the drive since the start, turns.
    pub periods: f64,
    /// Whether the rig was left with a drive.
    driven: bool,
}

impl<'a, R: Rig + ?Sized, C: Controller + ?Sized> Bench<'a, R, C> {
    /// Before the first sample.
    pub fn new(rig: &'a mut R, controller: &'a mut C, scene: &'a Scene, samples: &'a mut Vec<Sample>) -> Self {
        Self {
            rig,
            controller,
            scene,
            sample_time: scene.sample_time(),
            samples,
            taken: 0,
            periods: 0.0,
            driven: false,
        }
    }

    /// One sample; in a stage other than the decay, a controller that switches the drive off is an error.
    pub fn sample(&mut self, stage: Stage) -> Result<Command, ExperimentError> {
        let active = stage != Stage::Decaying;
        let sensors = self.rig.sense()?;
        let command = checked(self.controller.sample(sensors, active)?)?;
        self.samples.push(Sample {
            time: self.taken as f64 * self.sample_time,
            sensors,
            command,
            ground_truth: self.rig.ground_truth()?,
        });
        self.taken += 1;
        self.advance(command.drive)?;
        self.periods += command.drive.omega * self.sample_time / TAU;
        if active && command.state.is_some_and(LoopState::is_latched) {
            self.ramp_down(command)?;
            return Err(self.tripped(stage, &command));
        }
        Ok(command)
    }

    fn advance(&mut self, drive: Drive) -> Result<(), ExperimentError> {
        self.driven = true;
        self.rig.advance(drive, self.sample_time)?;
        self.driven = drive.amplitude != 0.0;
        Ok(())
    }

    /// Follows the controller's ramp after a fault until the drive is off.
    fn ramp_down(&mut self, mut command: Command) -> Result<(), ExperimentError> {
        while command.drive.amplitude > 0.0 {
            let asked = self.controller.sample(self.rig.sense()?, true)?;
            // A ramp never rises, whatever the controller says.
            let amplitude = if asked.drive.amplitude < command.drive.amplitude {
                asked.drive.amplitude
            } else {
                0.0
            };
            command = checked(Command { drive: Drive { amplitude, ..asked.drive }, ..asked })?;
            self.advance(command.drive)?;
        }
        Ok(())
    }

    fn tripped(&self, stage: Stage, command: &Command) -> ExperimentError {
        match command.fault {
            Some(Fault::TimedOut) => self.no_lock(command),
            fault => ExperimentError::Tripped {
                periods: self.periods,
                stage,
                fault: fault.unwrap_or(Fault::LockLost),
                evidence: Box::new(Evidence::of(self.samples, self.scene, |error| self.phase_error(error))),
            },
        }
    }

    /// A phase error, rad, or why there is none.
    fn phase_error(&self, error: Option<f64>) -> PhaseError {
        match error {
            Some(radians) => PhaseError::Degrees(radians.to_degrees()),
            None if self.controller.reports_phase_error() => PhaseError::NotMeasured,
            None => PhaseError::NotReported,
        }
    }

    /// The error of a search without a result.
    pub fn no_lock(&self, command: &Command) -> ExperimentError {
        ExperimentError::NoLock {
            periods: self.periods,
            phase_error: self.phase_error(command.phase_error),
            omega: command.drive.omega,
        }
    }
}

/// An error or a panic must not leave the rig driven.
impl<R: Rig + ?Sized, C: ?Sized> Drop for Bench<'_, R, C> {
    fn drop(&mut self) {
        if self.driven {
            // The run has ended; an error of the rig would not change its result.
            let _ = self.rig.advance(Drive::default(), self.sample_time);
        }
    }
}

/// A command with a drive that a rig can take.
fn checked(command: Command) -> Result<Command, ExperimentError> {
    let Drive { omega, amplitude, displacement } = command.drive;
    if [omega, amplitude, displacement].iter().all(|value| value.is_finite()) {
        Ok(command)
    } else {
        Err(ExperimentError::NotANumber(command.drive))
    }
}
