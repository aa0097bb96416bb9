//! The output of one sample.

use super::PhaseLock;
use crate::real::{Real, limited};
use crate::sensing::Measurement;
use crate::signals::Output;
use crate::state::State;
use crate::supervisor::LoopState;

impl PhaseLock {
    pub(super) fn output(&self, state: &State, measured: &Measurement, drive: Real) -> Output {
        let omega = state.frequency.omega;
        let response_amplitude = state.channels.response.amplitude();
        let means = state.dwell.means();
        let (frequency, response_mean) = means.unwrap_or((omega, response_amplitude));
        Output {
            omega,
            amplitude: state.drive.amplitude,
            drive,
            phase_error: measured.measurable.then_some(measured.error),
            response_amplitude,
            response_target: state.amplitude_loop.map(|l| l.setpoint()),
            reference_amplitude: measured.reference_amplitude,
            coherence: state.channels.response.coherence(),
            // Rounding can move the mean of values at a limit beyond the limit.
            frequency: limited(frequency, self.config.omega_min, self.config.omega_max),
            response_mean,
            locked: state.loop_state == LoopState::Locked,
            settled: state.dwell.settled() && state.tuning == self.tuning(),
            state: state.loop_state,
            fault: state.fault,
        }
    }
}
