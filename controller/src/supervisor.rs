//! The state machine of the loop.

use core::fmt;

/// State of the loop. The numbers are those of the FMU's `state`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum LoopState {
    /// Not armed; the drive is off, or still ramps down after a fault. The oscillator runs at `omega_start`.
    #[default]
    Idle = 0,
    /// The drive ramps up at `omega_start`; the loop is open.
    Ramping = 1,
    /// The loop is closed, but not yet locked.
    Acquiring = 2,
    /// Locked at phase resonance.
    Locked = 3,
    /// The lock was lost. The drive ramps down; latched until `active` becomes false.
    LockLost = 4,
    /// A [`Fault`] other than a lost lock. The drive ramps down; latched until `active` becomes false.
    Tripped = 5,
    /// `active` became false: the drive is released, the frequency stays constant.
    ShutDown = 6,
}

/// Reason why the drive was switched off. The numbers are those of the FMU's `fault`, where 0 means no fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Fault {
    /// A sensor read NaN, infinity, or more than 1e100 m, or a reading did not change for a sixth of a period.
    Sensor = 1,
    /// The response exceeded `response_max`.
    ResponseTooLarge = 2,
    /// No lock within `acquire_timeout`.
    TimedOut = 3,
    /// The phase error exceeded `unlock_tolerance`, or the response was no longer valid, while locked.
    LockLost = 4,
    /// No valid measurement for `signal_timeout`, or none in the first periods of the drive: the amplitude of a channel is too small, or its noise too large.
    NoSignal = 5,
    /// A reading differed from its prediction by more than `residual_max`, or the response contradicts the power of its drive.
    Implausible = 6,
}

impl LoopState {
    const ALL: [Self; 7] = [
        Self::Idle,
        Self::Ramping,
        Self::Acquiring,
        Self::Locked,
        Self::LockLost,
        Self::Tripped,
        Self::ShutDown,
    ];

    /// The state of that number.
    #[must_use]
    pub fn of_number(number: i32) -> Option<Self> {
        Self::ALL.into_iter().find(|state| *state as i32 == number)
    }

    /// Whether the loop is closed.
    #[must_use]
    pub fn is_closed(self) -> bool {
        matches!(self, Self::Acquiring | Self::Locked)
    }

    /// Whether a fault has switched the drive off; latched until `active` becomes false.
    #[must_use]
    pub fn is_latched(self) -> bool {
        matches!(self, Self::LockLost | Self::Tripped)
    }

    /// The next state, and the fault that caused it.
    pub(crate) fn next(self, conditions: &Conditions) -> (Self, Option<Fault>) {
        match self {
            Self::Ramping | Self::Acquiring | Self::Locked if !conditions.active => (Self::ShutDown, None),
            Self::LockLost | Self::Tripped if !conditions.active => (Self::Idle, None),
            Self::LockLost | Self::Tripped => (self, None),
            Self::Idle | Self::ShutDown if !conditions.active => (self, None),
            _ if conditions.fault.is_some() => (Self::Tripped, conditions.fault),
            Self::Idle | Self::ShutDown => (Self::Ramping, None),
            Self::Ramping if conditions.ready => (Self::Acquiring, None),
            Self::Acquiring if conditions.settled => (Self::Locked, None),
            Self::Acquiring if conditions.timed_out => (Self::Tripped, Some(Fault::TimedOut)),
            Self::Locked if conditions.lost => (Self::LockLost, Some(Fault::LockLost)),
            running => (running, None),
        }
    }
}

impl Fault {
    const ALL: [Self; 6] = [
        Self::Sensor,
        Self::ResponseTooLarge,
        Self::TimedOut,
        Self::LockLost,
        Self::NoSignal,
        Self::Implausible,
    ];

    /// The fault of that number; none for 0.
    #[must_use]
    pub fn of_number(number: i32) -> Option<Self> {
        Self::ALL.into_iter().find(|fault| *fault as i32 == number)
    }

    /// What has happened.
    #[must_use]
    pub fn text(self) -> &'static str {
        match self {
            Self::Sensor => {
                "a sensor read no number, or did not change for a sixth of a period, as at the end of its range"
            }
            Self::ResponseTooLarge => "the response exceeded its limit",
            Self::TimedOut => "the time limit for the lock is over",
            Self::LockLost => "the lock was lost",
            Self::NoSignal => {
                "the response or the base could not be measured: too small an amplitude, or too much noise"
            }
            Self::Implausible => {
                "a reading or the response is implausible: a sensor, the drive or the clock has failed, or the motion is irregular"
            }
        }
    }
}

impl fmt::Display for LoopState {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Idle => "idle",
            Self::Ramping => "ramping",
            Self::Acquiring => "acquiring",
            Self::Locked => "locked",
            Self::LockLost => "lock lost",
            Self::Tripped => "tripped",
            Self::ShutDown => "shut down",
        })
    }
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.text())
    }
}

/// Conditions of the transitions.
#[derive(Clone, Copy, Debug, Default)]
pub struct Conditions {
    /// The operator requests the drive.
    pub active: bool,
    /// Fault of a sensor reading.
    pub fault: Option<Fault>,
    /// The ramp has ended.
    pub ready: bool,
    /// The lock criterion is met.
    pub settled: bool,
    /// The phase error or the validity of the response ends the lock.
    pub lost: bool,
    /// The time limit for acquiring the lock is over.
    pub timed_out: bool,
}

#[cfg(test)]
#[cfg(not(feature = "f32"))]
mod tests {
    use super::*;

    /// Whether the drive is on.
    fn drives(state: LoopState) -> bool {
        state.is_closed() || state == LoopState::Ramping
    }

    const ACTIVE: Conditions = Conditions {
        active: true,
        fault: None,
        ready: true,
        settled: true,
        lost: false,
        timed_out: false,
    };

    #[test]
    fn locking_passes_through_every_state_in_order() {
        let mut state = LoopState::Idle;
        for expected in [
            LoopState::Ramping,
            LoopState::Acquiring,
            LoopState::Locked,
            LoopState::Locked,
        ] {
            state = state.next(&ACTIVE).0;
            assert_eq!(state, expected);
        }
    }

    #[test]
    fn no_state_drives_when_inactive_or_on_a_fault_and_a_latched_one_ends_only_when_inactive() {
        let inactive = Conditions { active: false, ..ACTIVE };
        let faulty = Conditions { fault: Some(Fault::Sensor), ..ACTIVE };
        for state in LoopState::ALL {
            assert!(!drives(state.next(&inactive).0) && !drives(state.next(&faulty).0));
            let is_latched = [LoopState::LockLost, LoopState::Tripped].contains(&state);
            assert_eq!(state.is_latched(), is_latched);
            if is_latched {
                assert_eq!(
                    (state.next(&ACTIVE).0, state.next(&inactive).0),
                    (state, LoopState::Idle)
                );
            }
        }
    }
}
