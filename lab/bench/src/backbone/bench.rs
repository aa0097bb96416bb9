//! The bench of the tracking, which reads period by period.

use std::ops::{Deref, DerefMut};

use super::sweep::Sweep;
use crate::experiment::{self, ExperimentError, Stage};
use crate::identification::Cycle;
use crate::rig::{Controller, Rig};

/// A bench that reads period by period.
pub(super) struct Bench<'a, R: Rig + ?Sized, C: ?Sized> {
    pub bench: experiment::Bench<'a, R, C>,
    pub stage: Stage,
    pub target: f64,
    /// The last period.
    pub last: Option<Cycle>,
    /// The levels that are being crossed; none while the response is held.
    pub sweep: Sweep,
}

impl<'a, R: Rig + ?Sized, C: ?Sized> Deref for Bench<'a, R, C> {
    type Target = experiment::Bench<'a, R, C>;

    fn deref(&self) -> &Self::Target {
        &self.bench
    }
}

impl<R: Rig + ?Sized, C: ?Sized> DerefMut for Bench<'_, R, C> {
    fn deref_mut(&mut self) -> &mut Self::Target {
        &mut self.bench
    }
}

impl<R: Rig + ?Sized, C: Controller + ?Sized> Bench<'_, R, C> {
    /// One period of the drive.
    pub fn cycle(&mut self) -> Result<Cycle, ExperimentError> {
        loop {
            let begin = self.samples.len();
            let first = self.periods;
            while self.periods < first.floor() + 1.0 {
                let stage = self.stage;
                self.sample(stage)?;
            }
            let phase = first * std::f64::consts::TAU;
            if let Some(cycle) = Cycle::of(&self.samples[begin..], self.sample_time, phase, self.target) {
                self.last = Some(cycle);
                return Ok(cycle);
            }
        }
    }
}
