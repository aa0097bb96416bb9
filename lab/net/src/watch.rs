//! The watch over a silent link: the last good drive is held, and after a stated time taken away for good.

use vines_testbench::rig::Drive;

/// Samples in which the drive of a paced rig is brought to zero.
pub const RAMP_SAMPLES: u32 = 100;

/// Holds a drive, and takes it away when nothing has been heard for too long.
#[derive(Debug, Clone, Copy)]
pub(super) struct Watch {
    /// Longest silence, s.
    limit: f64,
    /// Silence so far, s.
    quiet: f64,
    drive: Drive,
    /// Samples of the ramp that are left, once the limit has passed.
    latched: Option<u32>,
}

impl Watch {
    pub fn new(limit: f64) -> Self {
        Self {
            limit,
            quiet: 0.0,
            drive: Drive::default(),
            latched: None,
        }
    }

    /// Something was heard: the silence begins anew.
    pub fn heard(&mut self) {
        self.quiet = 0.0;
    }

    /// A new drive; without effect once the drive has been taken away.
    pub fn take(&mut self, drive: Drive) {
        if self.latched.is_none() {
            self.drive = drive;
        }
    }

    /// `seconds` have passed without a word.
    pub fn silent(&mut self, seconds: f64) {
        self.quiet += seconds;
        if self.quiet > self.limit {
            self.latch();
        }
    }

    /// Takes the drive away, for good.
    pub fn latch(&mut self) {
        self.latched.get_or_insert(RAMP_SAMPLES);
    }

    /// Whether the drive has been taken away.
    pub fn is_latched(&self) -> bool {
        self.latched.is_some()
    }

    /// Whether the drive has been taken away and is zero by now.
    pub fn is_down(&self) -> bool {
        self.latched == Some(0)
    }

    /// The drive of the coming sample period.
    pub fn drive(&mut self) -> Drive {
        let Some(left) = &mut self.latched else {
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
mod tests {
    use super::*;

    const DRIVE: Drive = Drive {
        omega: 2.0,
        amplitude: 1.0,
        displacement: 0.5,
    };

    #[test]
    fn the_last_drive_is_held_until_the_limit() {
        let mut watch = Watch::new(1.0);
        watch.take(DRIVE);
        for _ in 0..4 {
            watch.silent(0.25);
            assert_eq!(watch.drive(), DRIVE);
        }
        watch.heard();
        watch.silent(1.0);
        assert!(!watch.is_latched());
    }

    #[test]
    fn beyond_the_limit_the_drive_goes_to_zero_step_by_step_and_never_comes_back() {
        let mut watch = Watch::new(1.0);
        watch.take(DRIVE);
        watch.silent(1.1);
        let mut before = DRIVE.amplitude;
        while !watch.is_down() {
            let now = watch.drive().amplitude;
            assert!(now < before && before - now < 0.011);
            before = now;
            watch.heard();
            watch.take(DRIVE);
        }
        assert_eq!(watch.drive().amplitude, 0.0);
        assert_eq!(watch.drive().omega, DRIVE.omega);
    }
}
