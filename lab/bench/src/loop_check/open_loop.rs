//! A rig that is driven with its loop open.

use std::f64::consts::TAU;

use crate::rig::{Drive, Rig, RigError};
use vines_model::numerics::standard_deviation;

/// Periods between looks at a response that falls.
pub(super) const DECAY: usize = 10;
/// Most looks.
const PAUSES: usize = 40;
/// Share of the response that is left at most from look to look.
const FALLS: f64 = 0.98;
/// Looks in succession at which the response has not fallen: a particle that still hits the walls now and then makes it rise for a while.
const PATIENCE: usize = 4;

/// A rig whose loop is open, and what it has read: the phase of its oscillator, rad, response and base.
pub(super) struct OpenLoop<'a, R: ?Sized> {
    pub rig: &'a mut R,
    pub omega: f64,
    pub step: f64,
    pub phase: f64,
    pub readings: Vec<[f64; 3]>,
    pub has_base: bool,
}

impl<R: Rig + ?Sized> OpenLoop<'_, R> {
    /// Drives with an amplitude, m, and keeps the readings.
    pub fn drive(&mut self, samples: usize, amplitude: f64) -> Result<(), RigError> {
        for _ in 0..samples {
            let (omega, phase) = (self.omega, self.phase);
            let sensors = self.rig.sense()?;
            self.has_base |= sensors.reference.is_some();
            self.readings
                .push([phase, sensors.response, sensors.reference.unwrap_or(0.0)]);
            let drive = Drive { omega, amplitude, displacement: amplitude * phase.sin() };
            self.rig.advance(drive, self.step)?;
            self.phase += omega * self.step;
        }
        Ok(())
    }

    /// Listens for `quiet` samples, and as long as a response above `enough` (RMS, m) falls from one `pause` to the next.
    pub fn rest(&mut self, quiet: usize, pause: usize, enough: f64) -> Result<(), RigError> {
        let (mut least, mut since) = (f64::INFINITY, 0);
        for n in 0..=PAUSES {
            self.drive(if n == 0 { quiet } else { pause }, 0.0)?;
            let last = &self.readings[self.readings.len() - quiet..];
            let response = scatter(last, 1);
            // Noise does not fall.
            since = if response < FALLS * least { 0 } else { since + 1 };
            least = least.min(response);
            if response <= enough || since >= PATIENCE {
                break;
            }
        }
        Ok(())
    }

    /// Brings the phase of the rig's oscillator to a multiple of 2 pi, with no drive.
    pub fn end(&mut self, samples: usize) -> Result<(), RigError> {
        let omega = (TAU - self.phase % TAU) / (samples as f64 * self.step);
        for _ in 0..samples {
            self.rig.sense()?;
            self.rig.advance(Drive { omega, ..Drive::default() }, self.step)?;
        }
        Ok(())
    }
}

/// RMS of a reading about its mean: a sensor has an offset, and so has the centre of mass of a rig whose particle does not lie in the middle.
pub(super) fn scatter(readings: &[[f64; 3]], of: usize) -> f64 {
    standard_deviation(&readings.iter().map(|reading| reading[of]).collect::<Vec<f64>>())
}
