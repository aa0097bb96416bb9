//! The state of the controller.

use crate::amplitude_loop::AmplitudeState;
use crate::drive::DriveState;
use crate::loop_filter::Frequency;
use crate::oscillator::Oscillator;
use crate::real::Real;
use crate::sensing::Channels;
use crate::stationarity::Dwell;
use crate::supervisor::{Fault, LoopState};

/// The state, which changes with every sample. A copy that is restored later continues with the same bits.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct State {
    pub(crate) oscillator: Oscillator,
    pub(crate) channels: Channels,
    pub(crate) frequency: Frequency,
    pub(crate) drive: DriveState,
    /// Present while the response amplitude is controlled instead of the drive amplitude.
    pub(crate) amplitude_loop: Option<AmplitudeState>,
    pub(crate) dwell: Dwell,
    pub(crate) loop_state: LoopState,
    pub(crate) fault: Option<Fault>,
    /// Whether the last sample ended a ramp.
    pub(crate) ready: bool,
    /// Whether the last sample ended a period in which the lock was lost.
    pub(crate) lost: bool,
    /// Samples since acquiring began.
    pub(crate) acquiring: u64,
    /// Drive amplitude and phase target to which the dwell applies.
    pub(crate) tuning: (Real, Real),
}

impl State {
    /// The state before the first sample.
    pub(crate) fn new(omega_start: Real, tuning: (Real, Real)) -> Self {
        Self {
            oscillator: Oscillator::default(),
            channels: Channels::default(),
            frequency: Frequency::at(omega_start),
            drive: DriveState::default(),
            amplitude_loop: None,
            dwell: Dwell::default(),
            loop_state: LoopState::Idle,
            fault: None,
            ready: false,
            lost: false,
            acquiring: 0,
            tuning,
        }
    }
}
