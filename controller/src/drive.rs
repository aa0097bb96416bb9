//! Amplitude of the drive.

use crate::config::Config;
use crate::oscillator::Complex;
use crate::real::{self, Real};

/// Ramps of the drive amplitude, and the control of the measured base amplitude.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct DriveGenerator {
    /// m
    pub amplitude_max: Real,
    /// Largest change per sample during a ramp, m; infinite for a step change.
    pub ramp_step: Real,
    /// Largest change per sample after `active` became false, m; infinite to switch off at once.
    pub release_step: Real,
    /// Share of the base amplitude's error that the control corrects per sample; 0 without control.
    pub control_step: Real,
}

/// State of the drive.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct DriveState {
    /// Amplitude of the output, m.
    pub amplitude: Real,
    /// Correction by the control of the base amplitude, m.
    trim: Real,
}

/// The drive in the present sample.
#[derive(Clone, Copy, Debug)]
pub struct PresentDrive {
    /// `exp(i phase)` of the oscillator.
    pub rotor: Complex,
    /// Frequency, rad/s.
    pub omega: Real,
    /// Amplitude, m.
    pub amplitude: Real,
}

impl DriveGenerator {
    /// The drive of a configuration.
    pub fn new(config: &Config) -> Self {
        Self {
            amplitude_max: config.amplitude_limit(),
            ramp_step: config.change(config.ramp_rate),
            release_step: config.change(config.release_rate),
            control_step: config.step(config.base_bandwidth.unwrap_or(0.0)),
        }
    }

    /// Corrects the error between setpoint and measured amplitude of the base, m.
    pub fn control(&self, state: &mut DriveState, setpoint: Real, measured: Real) {
        let trim = state.trim + self.control_step * (setpoint - measured);
        // Anti-windup: the trim stays within the range of the drive.
        state.trim = real::limited(trim, -setpoint, self.amplitude_max - setpoint);
    }

    /// Ramps towards `setpoint`, m, for one sample. Returns whether the setpoint is reached.
    pub fn ramp(&self, state: &mut DriveState, setpoint: Real) -> bool {
        let target = real::limited(setpoint + state.trim, 0.0, self.amplitude_max);
        state.amplitude = approach(state.amplitude, target, self.ramp_step);
        state.amplitude == target
    }
}

impl DriveState {
    /// Ramps down for one sample by at most `step`, m.
    pub fn ramp_down(&mut self, step: Real) {
        self.trim = 0.0;
        self.amplitude = approach(self.amplitude, 0.0, step);
    }
}

fn approach(from: Real, to: Real, step: Real) -> Real {
    real::limited(to, from - step, from + step)
}
