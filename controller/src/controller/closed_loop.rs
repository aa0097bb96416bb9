//! A sample while the loop is closed.

use super::PhaseLock;
use crate::real::Real;
use crate::sensing::Measurement;
use crate::state::State;

/// Phase error, rad, up to which a larger drive certainly gives a larger response.
const PHASE_RANGE: Real = crate::real::consts::FRAC_PI_3;

impl PhaseLock {
    /// One sample of the closed loop.
    pub(super) fn close_loop(&self, state: &mut State, measured: &Measurement) {
        let Self { filter, drive, .. } = self;
        if measured.valid {
            filter.follow(&mut state.frequency, measured.error);
        } else {
            filter.hold(&mut state.frequency);
        }
        let reading = state.channels.response.amplitude();
        let near = measured.valid && measured.error.abs() < PHASE_RANGE;
        let before = state.drive.amplitude;
        if let Some(amplitude_loop) = &mut state.amplitude_loop {
            let (amplitude, shift) = self
                .amplitude_loop
                .follow(amplitude_loop, before, near.then_some(reading));
            state.drive.amplitude = amplitude;
            filter.shift(&mut state.frequency, shift);
            state.ready = amplitude_loop.has_arrived();
        } else {
            let setpoint = self.config.amplitude;
            if measured.valid && measured.has_sensor {
                drive.control(&mut state.drive, setpoint, measured.reference_amplitude);
            }
            state.ready = drive.ramp(&mut state.drive, setpoint);
        }
    }
}
