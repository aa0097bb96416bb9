//! Rig and controller, read period by period.

use thiserror::Error;

use crate::experiment::Sample;
use crate::identification::Cycle;
use crate::rig::{Command, Controller, ControllerError, Drive, Fault, LoopState, Rig, RigError};

/// Why tracking ended early.
#[derive(Debug, Error)]
pub enum TrackError {
    /// The rig failed.
    #[error(transparent)]
    Rig(#[from] RigError),
    /// The controller failed.
    #[error(transparent)]
    Controller(#[from] ControllerError),
    /// The loop did not come near phase resonance in the time allowed.
    #[error("no lock within {periods:.0} periods of the drive; see record.lock_periods and the [controller] section")]
    NoLock {
        /// Time limit, periods.
        periods: f64,
    },
    /// The controller switched the drive off.
    #[error("the controller switched the drive off after {periods:.1} periods: {fault}")]
    Tripped {
        /// Time since the start, periods of the drive.
        periods: f64,
        /// The reason.
        fault: Fault,
    },
}

/// A bench that reads period by period.
pub struct Bench<'a, R: ?Sized, C: ?Sized> {
    pub rig: &'a mut R,
    pub controller: &'a mut C,
    pub sample_time: f64,
    pub target: f64,
    pub taken: usize,
    /// Phase of the drive since the start, turns: the periods so far.
    pub periods: f64,
    pub samples: Vec<Sample>,
}

impl<R: Rig + ?Sized, C: Controller + ?Sized> Bench<'_, R, C> {
    fn sample(&mut self) -> Result<Command, TrackError> {
        let sensors = self.rig.sense()?;
        let command = match self.controller.sample(sensors, true) {
            Ok(command) => command,
            Err(error) => {
                // A failed controller must not leave the rig driven.
                let _ = self.rig.advance(Drive::default(), self.sample_time);
                return Err(error.into());
            }
        };
        self.samples.push(Sample {
            time: self.taken as f64 * self.sample_time,
            sensors,
            command,
            ground_truth: self.rig.ground_truth()?,
        });
        self.taken += 1;
        self.rig.advance(command.drive, self.sample_time)?;
        if command.state.is_some_and(LoopState::is_latched) {
            self.rig.advance(Drive::default(), self.sample_time)?;
            return Err(TrackError::Tripped {
                periods: self.periods,
                fault: command.fault.unwrap_or(Fault::LockLost),
            });
        }
        Ok(command)
    }

    /// One period of the drive.
    pub fn cycle(&mut self) -> Result<Cycle, TrackError> {
        loop {
            let begin = self.samples.len();
            let first = self.periods;
            while self.periods < first.floor() + 1.0 {
                let command = self.sample()?;
                self.periods += command.drive.omega * self.sample_time / std::f64::consts::TAU;
            }
            let phase = first * std::f64::consts::TAU;
            if let Some(cycle) = Cycle::of(&self.samples[begin..], self.sample_time, phase, self.target) {
                return Ok(cycle);
            }
        }
    }
}
