//! The sequence: what may follow what.

/// State of the sequence. The numbers are those of the FMU's `state`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Phase {
    /// Not armed; the drive is off, or on its way there after a fault. The oscillator runs at `omega_start`.
    #[default]
    Idle = 0,
    /// The drive rises at `omega_start`; the loop is open.
    Ramping = 1,
    /// The loop is closed, and not yet locked.
    Acquiring = 2,
    /// Phase resonance is held.
    Locked = 3,
    /// The phase escaped. The drive ramps down; latched until `active` is taken away.
    LockLost = 4,
    /// A [`Fault`] other than a lost lock. The drive ramps down; latched until `active` is taken away.
    Tripped = 5,
    /// `active` was taken away: the drive is released, the frequency stays.
    ShutDown = 6,
}

/// Why the drive was taken away. The numbers are those of the FMU's `fault`, where 0 is none.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Fault {
    /// A sensor read NaN, infinity, or a number beyond all reason.
    Sensor = 1,
    /// The response exceeded `response_max`.
    ResponseTooLarge = 2,
    /// No lock within `acquire_timeout`.
    TimedOut = 3,
    /// The phase escaped, or the response was lost in noise, while locked.
    LockLost = 4,
}

/// What the sequence depends on.
#[derive(Clone, Copy, Debug, Default)]
pub struct Signs {
    /// The operator wants the drive.
    pub active: bool,
    /// A reading that cannot be tolerated.
    pub fault: Option<Fault>,
    /// The ramp has ended.
    pub ready: bool,
    /// The lock criterion is met.
    pub settled: bool,
    /// The phase has escaped.
    pub escaped: bool,
    /// Acquiring has taken too long.
    pub late: bool,
}

impl Phase {
    /// Whether the drive is on.
    #[must_use]
    pub fn is_driving(self) -> bool {
        self.is_closed() || self == Self::Ramping
    }

    /// Whether the loop is closed.
    #[must_use]
    pub fn is_closed(self) -> bool {
        matches!(self, Self::Acquiring | Self::Locked)
    }

    /// The next state, and the fault that led there.
    pub(crate) fn next(self, signs: &Signs) -> (Self, Option<Fault>) {
        match self {
            Self::Ramping | Self::Acquiring | Self::Locked if !signs.active => {
                (Self::ShutDown, None)
            }
            Self::LockLost | Self::Tripped if !signs.active => (Self::Idle, None),
            Self::LockLost | Self::Tripped => (self, None),
            Self::Idle | Self::ShutDown if !signs.active => (self, None),
            _ if signs.fault.is_some() => (Self::Tripped, signs.fault),
            Self::Idle | Self::ShutDown => (Self::Ramping, None),
            Self::Ramping if signs.ready => (Self::Acquiring, None),
            Self::Acquiring if signs.settled => (Self::Locked, None),
            Self::Acquiring if signs.late => (Self::Tripped, Some(Fault::TimedOut)),
            Self::Locked if signs.escaped => (Self::LockLost, Some(Fault::LockLost)),
            running => (running, None),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ACTIVE: Signs = Signs {
        active: true,
        fault: None,
        ready: true,
        settled: true,
        escaped: false,
        late: false,
    };
    const ALL: [Phase; 7] = [
        Phase::Idle,
        Phase::Ramping,
        Phase::Acquiring,
        Phase::Locked,
        Phase::LockLost,
        Phase::Tripped,
        Phase::ShutDown,
    ];

    #[test]
    fn the_way_to_a_lock_leaves_no_state_out() {
        let mut phase = Phase::Idle;
        for expected in [
            Phase::Ramping,
            Phase::Acquiring,
            Phase::Locked,
            Phase::Locked,
        ] {
            phase = phase.next(&ACTIVE).0;
            assert_eq!(phase, expected);
        }
    }

    #[test]
    fn nothing_drives_once_active_is_taken_away() {
        for phase in ALL {
            assert!(
                !phase
                    .next(&Signs {
                        active: false,
                        ..ACTIVE
                    })
                    .0
                    .is_driving()
            );
        }
    }

    #[test]
    fn no_state_drives_on_a_fault() {
        let signs = Signs {
            fault: Some(Fault::Sensor),
            ..ACTIVE
        };
        for phase in ALL {
            assert!(!phase.next(&signs).0.is_driving());
        }
    }

    #[test]
    fn what_is_latched_needs_active_taken_away() {
        for phase in [Phase::LockLost, Phase::Tripped] {
            assert_eq!(phase.next(&ACTIVE).0, phase);
            assert_eq!(
                phase
                    .next(&Signs {
                        active: false,
                        ..ACTIVE
                    })
                    .0,
                Phase::Idle
            );
        }
    }

    #[test]
    fn a_lock_is_lost_only_from_locked() {
        let signs = Signs {
            escaped: true,
            settled: false,
            ..ACTIVE
        };
        assert_eq!(Phase::Locked.next(&signs).0, Phase::LockLost);
        assert_eq!(Phase::Acquiring.next(&signs).0, Phase::Acquiring);
    }
}
