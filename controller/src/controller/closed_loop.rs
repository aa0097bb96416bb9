//! A sample while the loop is closed.

use super::PhaseLock;
use crate::capture::Observation;
use crate::real::Real;
use crate::sensing::Measurement;
use crate::state::State;
use crate::supervisor::LoopState;

/// Phase error, rad, up to which a larger drive certainly gives a larger response.
const PHASE_RANGE: Real = crate::real::consts::FRAC_PI_3;

impl PhaseLock {
    /// One sample of the capture. (A call: a locked loop needs none of its code.)
    #[inline(never)]
    pub(super) fn capture(&self, state: &mut State, measured: &Measurement) {
        let complete = self.capture.advance(
            &mut state.capture,
            &mut state.amplitude_loop,
            &Observation {
                omega: state.frequency.omega,
                drive: state.drive.amplitude,
                response: state.channels.response.amplitude(),
                mean: state.approach.response,
                holding: state.approach.holding,
                error: measured.valid.then_some(measured.error),
            },
        );
        self.close_loop(state, measured);
        state.approach.lowest = Real::MAX;
        state.ready = complete;
        if complete {
            state.amplitude_loop = None;
        }
    }

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
        let elapsed = state.acquiring as Real * self.config.sample_time;
        let rate = self.capture.observer_rate(&state.capture, reading, self.approach.rate);
        let holding = self
            .approach
            .observe(&mut state.approach, before, reading, measured.cosine, rate);
        let holding = near.then_some(holding);
        if let Some(amplitude_loop) = &mut state.amplitude_loop {
            let (amplitude, shift) = self
                .amplitude_loop
                .follow(amplitude_loop, before, near.then_some(reading));
            state.drive.amplitude = amplitude;
            filter.shift(&mut state.frequency, shift);
            state.ready = amplitude_loop.has_arrived();
        } else {
            let amplitude = self.config.amplitude;
            let setpoint = match holding {
                Some(holding) if state.loop_state != LoopState::Locked => {
                    let descent = self.capture.drive(&state.capture, holding, measured.error);
                    descent.unwrap_or_else(|| match state.capture.is_first() {
                        true => self.approach.shape(&mut state.approach, amplitude, holding, elapsed),
                        false => amplitude,
                    })
                }
                _ => amplitude,
            };
            if measured.valid && measured.has_sensor {
                drive.control(&mut state.drive, setpoint, measured.reference_amplitude);
            }
            let arrived = drive.ramp(&mut state.drive, setpoint);
            state.ready = arrived || setpoint != amplitude;
        }
    }
}
