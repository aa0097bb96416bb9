//! Guards FMU states: taken, set back, freed, and as bytes.

use std::ptr::{null, null_mut, without_provenance_mut};

use crate::{new, ready};
use fmi2_boundary::{Master, Raw};
use fmi2_component::Status::{self, Error, Ok};

const INFLOW: u32 = 2;
const LEVEL: u32 = 3;

fn read_back(master: &Master, bytes: &[u8]) -> (Status, Raw) {
    let mut state = null_mut();
    let status =
        unsafe { (master.f.fmi2DeSerializeFMUstate)(master.c, bytes.as_ptr().cast(), bytes.len(), &mut state) };
    (status, state)
}

#[test]
fn a_state_set_back_continues_bit_by_bit() {
    let master = ready();
    master.set_real(INFLOW, 0.1);
    master.step(0.0, 0.3);
    let mut state = null_mut();
    assert_eq!(unsafe { (master.f.fmi2GetFMUstate)(master.c, &mut state) }, Ok);
    let run = || {
        (0..5).for_each(|i| assert_eq!(master.step(0.3 + 0.1 * f64::from(i), 0.1), Ok));
        master.bytes()
    };
    let first = run();
    assert_eq!(unsafe { (master.f.fmi2SetFMUstate)(master.c, state) }, Ok);
    assert_eq!(run(), first);
}

#[test]
fn a_serialised_state_continues_in_another_instance() {
    let (one, two) = (ready(), new());
    one.set_real(INFLOW, 0.1);
    one.step(0.0, 0.3);
    let (status, state) = read_back(&two, &one.bytes());
    assert_eq!(status, Ok);
    assert_eq!(unsafe { (two.f.fmi2SetFMUstate)(two.c, state) }, Ok);
    for master in [&one, &two] {
        assert_eq!(master.step(0.3, 0.1), Ok);
    }
    assert_eq!(one.bytes(), two.bytes());
    assert_eq!(one.real(LEVEL), two.real(LEVEL));
}

#[test]
fn a_state_continues_in_an_experiment_that_ends_later() {
    let (short, long, fresh) = (new(), new(), new());
    for (master, stop) in [(&short, 2.5), (&long, 5.0)] {
        unsafe {
            assert_eq!((master.f.fmi2SetupExperiment)(master.c, 0, 0.0, 0.0, 1, stop), Ok);
            assert_eq!((master.f.fmi2EnterInitializationMode)(master.c), Ok);
            assert_eq!((master.f.fmi2ExitInitializationMode)(master.c), Ok);
        }
    }
    short.step(0.0, 2.0);
    for master in [&long, &fresh] {
        let (status, state) = read_back(master, &short.bytes());
        assert_eq!(
            (status, unsafe { (master.f.fmi2SetFMUstate)(master.c, state) }),
            (Ok, Ok)
        );
        assert_eq!(master.step(2.0, 1.0), Ok);
    }
    assert_eq!(long.step(3.0, 3.0), Error);
    long.heard_one(&["stopTime = 5 s"]);
}

#[test]
fn a_state_given_on_entry_is_overwritten_and_thousands_need_not_be_freed() {
    let master = ready();
    let mut state = null_mut();
    let take = |state: &mut Raw| assert_eq!(unsafe { (master.f.fmi2GetFMUstate)(master.c, state) }, Ok);
    take(&mut state);
    let handle = state;
    master.set_real(INFLOW, 0.2);
    take(&mut state);
    assert_eq!(state, handle);
    master.set_real(INFLOW, 0.0);
    unsafe { (master.f.fmi2SetFMUstate)(master.c, state) };
    assert_eq!(master.real(INFLOW), 0.2);
    (0..10_000).for_each(|_| take(&mut null_mut()));
}

#[test]
fn every_damaged_or_truncated_blob_is_refused() {
    let master = ready();
    let good = master.bytes();
    for end in 0..good.len() {
        let (status, state) = read_back(&master, &good[..end]);
        assert_eq!((status, state), (Error, null_mut()), "{end} bytes");
        master.heard();
    }
    for i in 0..good.len() {
        let mut bad = good.clone();
        bad[i] ^= 0x10;
        assert_eq!(read_back(&master, &bad).0, Error, "byte {i}");
    }
    assert_eq!(read_back(&master, &[&good[..], b"!"].concat()).0, Error);
    assert_eq!(master.bytes(), good);
}

#[test]
fn a_handle_that_is_not_of_this_instance_is_refused() {
    let (one, two) = (ready(), ready());
    let mut state = null_mut();
    unsafe {
        (one.f.fmi2GetFMUstate)(one.c, &mut state);
        for foreign in [state, null_mut(), without_provenance_mut(usize::MAX)] {
            assert_eq!((two.f.fmi2SetFMUstate)(two.c, foreign), Error);
            two.heard_one(&["not one that this instance has given out"]);
        }
        let mut freed = state;
        assert_eq!((one.f.fmi2FreeFMUstate)(one.c, &mut freed), Ok);
        assert_eq!((one.f.fmi2SetFMUstate)(one.c, state), Error);
        assert_eq!((one.f.fmi2FreeFMUstate)(one.c, &mut state), Error);
        assert_eq!((one.f.fmi2SerializedFMUstateSize)(one.c, state, &mut 0), Error);
    }
}

#[test]
fn null_and_a_small_buffer_are_dealt_with() {
    let master = ready();
    let (c, f) = (master.c, master.f);
    let mut state = null_mut();
    unsafe {
        assert_eq!((f.fmi2FreeFMUstate)(c, null_mut()), Ok);
        assert_eq!((f.fmi2FreeFMUstate)(c, &mut state), Ok);
        assert_eq!((f.fmi2GetFMUstate)(c, null_mut()), Error);
        assert_eq!((f.fmi2DeSerializeFMUstate)(c, null(), 100, &mut state), Error);
        (f.fmi2GetFMUstate)(c, &mut state);
        assert_eq!((f.fmi2SerializedFMUstateSize)(c, state, null_mut()), Error);
        master.heard();
        assert_eq!((f.fmi2SerializeFMUstate)(c, state, [0; 4].as_mut_ptr(), 4), Error);
        master.heard_one(&["size = 4 is too small"]);
        assert_eq!((f.fmi2SerializeFMUstate)(c, state, null_mut(), 4096), Error);
    }
}
