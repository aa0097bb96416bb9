//! Tests of the state machine.

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
fn states_and_faults_are_found_by_their_numbers() {
    for (number, state) in LoopState::ALL.into_iter().enumerate() {
        assert_eq!(
            (state as usize, LoopState::of_number(number as i32)),
            (number, Some(state))
        );
    }
    for (number, fault) in Fault::ALL.into_iter().enumerate() {
        assert_eq!(Fault::of_number(number as i32 + 1), Some(fault));
    }
    assert_eq!((LoopState::of_number(7), Fault::of_number(0)), (None, None));
}

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
fn no_state_drives_after_active_becomes_false() {
    for state in LoopState::ALL {
        assert!(!drives(state.next(&Conditions { active: false, ..ACTIVE }).0));
    }
}

#[test]
fn no_state_drives_on_a_fault() {
    let conditions = Conditions { fault: Some(Fault::Sensor), ..ACTIVE };
    for state in LoopState::ALL {
        assert!(!drives(state.next(&conditions).0));
    }
}

#[test]
fn a_latched_state_ends_only_when_active_becomes_false() {
    for state in [LoopState::LockLost, LoopState::Tripped] {
        assert_eq!(state.next(&ACTIVE).0, state);
        assert_eq!(state.next(&Conditions { active: false, ..ACTIVE }).0, LoopState::Idle);
    }
}

#[test]
fn a_lock_is_lost_only_from_locked() {
    let conditions = Conditions { lost: true, settled: false, ..ACTIVE };
    assert_eq!(LoopState::Locked.next(&conditions).0, LoopState::LockLost);
    assert_eq!(LoopState::Acquiring.next(&conditions).0, LoopState::Acquiring);
}
