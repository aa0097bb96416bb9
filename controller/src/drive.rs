//! Amplitude of the drive.

/// Ramps of the drive amplitude, and the control that makes the measured base amplitude the wanted one.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Drive {
    /// m
    pub amplitude_max: f64,
    /// Largest change in one sample, m, while ramping; infinite to jump.
    pub ramp_step: f64,
    /// Largest change in one sample, m, where the drive is released; infinite to switch off at once.
    pub release_step: f64,
    /// Share of the error of the base amplitude that is taken up in one sample; 0 without control.
    pub control_step: f64,
}

/// State of the drive.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Level {
    /// Amplitude put out, m.
    pub amplitude: f64,
    /// What the control of the base amplitude has added, m.
    trim: f64,
}

impl Drive {
    /// Takes up the error between the wanted and the measured amplitude of the base, m.
    pub fn control(&self, level: &mut Level, wanted: f64, measured: f64) {
        let trim = level.trim + self.control_step * (wanted - measured);
        // Bounded by what the drive can give, so the control does not wind up.
        level.trim = trim.clamp(-wanted, self.amplitude_max - wanted);
    }

    /// Ramps towards `wanted` m for one sample; true where that is reached.
    pub fn ramp(&self, level: &mut Level, wanted: f64) -> bool {
        let target = (wanted + level.trim).clamp(0.0, self.amplitude_max);
        level.amplitude = approach(level.amplitude, target, self.ramp_step);
        level.amplitude == target
    }

    /// Ramps down for one sample, as after a fault.
    pub fn ramp_down(&self, level: &mut Level) {
        self.down(level, self.ramp_step);
    }

    /// Ramps down for one sample, as where the operator has enough.
    pub fn release(&self, level: &mut Level) {
        self.down(level, self.release_step);
    }

    fn down(&self, level: &mut Level, step: f64) {
        level.trim = 0.0;
        level.amplitude = approach(level.amplitude, 0.0, step);
    }
}

fn approach(from: f64, to: f64, step: f64) -> f64 {
    to.clamp(from - step, from + step)
}

#[cfg(test)]
mod tests {
    use super::*;

    const DRIVE: Drive = Drive {
        amplitude_max: 2.0,
        ramp_step: 0.3,
        release_step: f64::INFINITY,
        control_step: 0.1,
    };

    #[test]
    fn a_ramp_ends_exactly_at_the_wanted_amplitude() {
        let mut level = Level::default();
        let samples = (0..10).take_while(|_| !DRIVE.ramp(&mut level, 1.0)).count();
        assert_eq!((samples, level.amplitude), (3, 1.0));
    }

    #[test]
    fn a_release_without_a_ramp_is_at_once() {
        let mut level = Level {
            amplitude: 1.0,
            trim: 0.2,
        };
        DRIVE.release(&mut level);
        assert_eq!(level, Level::default());
    }

    #[test]
    fn the_control_makes_up_for_a_weak_shaker() {
        let mut level = Level::default();
        for _ in 0..1000 {
            DRIVE.ramp(&mut level, 1.0);
            let measured = 0.8 * level.amplitude;
            DRIVE.control(&mut level, 1.0, measured);
        }
        assert!((level.amplitude - 1.25).abs() < 1e-9);
    }

    #[test]
    fn the_control_of_a_dead_shaker_stays_within_its_limit() {
        let mut level = Level::default();
        for _ in 0..1000 {
            DRIVE.ramp(&mut level, 1.0);
            DRIVE.control(&mut level, 1.0, 0.0);
            assert!(level.amplitude <= 2.0);
        }
    }
}
