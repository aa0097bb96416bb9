//! The drive of a served rig: the last valid one, or after a shutdown a ramp to zero.

use vines_testbench::rig::{Drive, Rig, RigError};

/// Number of samples of the ramp to zero after a shutdown.
pub const RAMP_SAMPLES: u32 = 100;

/// A drive that can be shut down for the rest of a session.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Ramp {
    drive: Drive,
    /// Whether the rig holds the displacement of the drive.
    pub holds: bool,
    /// The displacement before that of the drive, m, and whether the drive has arrived since the last sample.
    before: f64,
    is_new: bool,
    /// Remaining samples of the ramp after the shutdown.
    left: Option<u32>,
}

impl Ramp {
    /// Sets a new drive; without effect after the shutdown.
    pub fn set(&mut self, drive: Drive, holds: bool) {
        if self.left.is_none() {
            self.before = self.drive.displacement;
            (self.drive, self.holds, self.is_new) = (drive, holds, true);
        }
    }

    /// Drives the rig for the next sample period of `step` seconds.
    pub fn apply(&mut self, rig: &mut dyn Rig, step: f64) -> Result<(), RigError> {
        if self.holds && !self.is_new && self.left.is_none() {
            self.extrapolate(step);
        }
        self.is_new = false;
        let drive = self.next();
        if self.holds {
            rig.hold(drive, step)
        } else {
            rig.advance(drive, step)
        }
    }

    /// Continues a sine of which the next displacement is late: a base that stops and jumps would be a disturbance of the structure.
    /// A drive without an amplitude is not known to be a sine.
    fn extrapolate(&mut self, step: f64) {
        let Drive { omega, amplitude, displacement } = self.drive;
        if amplitude > 0.0 {
            let next = 2.0 * (omega * step).cos() * displacement - self.before;
            self.before = displacement;
            self.drive.displacement = next.clamp(-amplitude, amplitude);
        }
    }

    /// Shuts the drive down for the rest of the session.
    pub fn shut_down(&mut self) {
        self.left.get_or_insert(RAMP_SAMPLES);
    }

    /// Whether the drive has been shut down.
    pub fn is_shut_down(&self) -> bool {
        self.left.is_some()
    }

    /// Whether the drive has been shut down and is zero.
    pub fn is_down(&self) -> bool {
        self.left == Some(0)
    }

    /// The drive of the next sample period.
    fn next(&mut self) -> Drive {
        let Some(left) = &mut self.left else {
            return self.drive;
        };
        *left = left.saturating_sub(1);
        let share = f64::from(*left) / f64::from(RAMP_SAMPLES);
        Drive {
            omega: self.drive.omega,
            amplitude: share * self.drive.amplitude,
            displacement: share * self.drive.displacement,
        }
    }
}

#[cfg(test)]
#[path = "../tests/unit/ramp.rs"]
mod tests;
