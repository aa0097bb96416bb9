//! The watchdog: holds the last valid drive while the client is silent, and shuts the drive down after a time limit.

use vines_testbench::rig::Drive;

/// Number of samples of the ramp to zero after a shutdown.
pub const RAMP_SAMPLES: u32 = 100;

/// Holds a drive, and shuts it down after too long a silence.
#[derive(Debug, Clone, Copy)]
pub(super) struct Watchdog {
    /// Longest silence, s.
    limit: f64,
    /// Silence so far, s.
    quiet: f64,
    drive: Drive,
    /// Remaining samples of the ramp after the shutdown.
    latched: Option<u32>,
}

impl Watchdog {
    pub fn new(limit: f64) -> Self {
        Self { limit, quiet: 0.0, drive: Drive::default(), latched: None }
    }

    /// A frame has arrived: the silence starts again.
    pub fn heard(&mut self) {
        self.quiet = 0.0;
    }

    /// Sets a new drive; without effect after the shutdown.
    pub fn take(&mut self, drive: Drive) {
        if self.latched.is_none() {
            self.drive = drive;
        }
    }

    /// `seconds` have passed without a frame.
    pub fn silent(&mut self, seconds: f64) {
        self.quiet += seconds;
        if self.quiet > self.limit {
            self.latch();
        }
    }

    /// Shuts the drive down for the rest of the session.
    pub fn latch(&mut self) {
        self.latched.get_or_insert(RAMP_SAMPLES);
    }

    /// Whether the drive has been shut down.
    pub fn is_latched(&self) -> bool {
        self.latched.is_some()
    }

    /// Whether the drive has been shut down and is zero.
    pub fn is_down(&self) -> bool {
        self.latched == Some(0)
    }

    /// The drive of the next sample period.
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

    const DRIVE: Drive = Drive { omega: 2.0, amplitude: 1.0, displacement: 0.5 };

    #[test]
    fn the_last_drive_is_held_until_the_limit() {
        let mut watchdog = Watchdog::new(1.0);
        watchdog.take(DRIVE);
        for _ in 0..4 {
            watchdog.silent(0.25);
            assert_eq!(watchdog.drive(), DRIVE);
        }
        watchdog.heard();
        watchdog.silent(1.0);
        assert!(!watchdog.is_latched());
    }

    #[test]
    fn beyond_the_limit_the_drive_ramps_to_zero_and_stays_there() {
        let mut watchdog = Watchdog::new(1.0);
        watchdog.take(DRIVE);
        watchdog.silent(1.1);
        let mut before = DRIVE.amplitude;
        while !watchdog.is_down() {
            let now = watchdog.drive().amplitude;
            assert!(now < before && before - now < 0.011);
            before = now;
            watchdog.heard();
            watchdog.take(DRIVE);
        }
        assert_eq!(watchdog.drive().amplitude, 0.0);
        assert_eq!(watchdog.drive().omega, DRIVE.omega);
    }
}
