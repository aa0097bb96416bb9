//! Random sequences of calls with good and bad arguments: no crash, and a status for every call.

mod master;

use std::ptr::{null, null_mut, without_provenance_mut};

use fmi2_component::Status;
use fmi2_example_tank::variables::GUID;
use master::*;

/// A linear congruential generator: the same sequences on every machine.
struct RandomSource(u64);

impl RandomSource {
    fn below(&mut self, limit: usize) -> usize {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) as usize % limit
    }

    fn pick<T: Copy>(&mut self, of: &[T]) -> T {
        of[self.below(of.len())]
    }
}

const NUMBERS: [f64; 9] = [
    0.0,
    0.1,
    1.0,
    -1.0,
    1e300,
    -0.0,
    f64::NAN,
    f64::INFINITY,
    f64::MIN_POSITIVE,
];

fn call(c: Raw, random: &mut RandomSource, states: &mut [Raw; 2], time: &mut f64) -> Status {
    let mut reals = [random.pick(&NUMBERS), random.pick(&NUMBERS)];
    let vr = [random.below(7) as u32, random.below(7) as u32];
    let count = random.pick(&[0, 1, 2, 2, 2, usize::MAX]);
    let pointer = random.pick(&[vr.as_ptr(), vr.as_ptr(), vr.as_ptr(), null()]);
    let (mut integers, mut strings) = ([random.below(3) as i32 - 1; 2], [c"\xff%n".as_ptr(), null()]);
    let known = &mut states[random.below(2)];
    let step = random.pick(&[0.1, 0.1, 0.1, reals[0]]);
    unsafe {
        match random.below(22) {
            0 => fmi2SetupExperiment(c, 0, 0.0, reals[0], integers[0], reals[1]),
            1 => fmi2EnterInitializationMode(c),
            2 => fmi2ExitInitializationMode(c),
            3 => fmi2Terminate(c),
            4 => fmi2Reset(c),
            5 => fmi2GetReal(c, pointer, count, reals.as_mut_ptr()),
            6 => fmi2SetReal(c, pointer, count, reals.as_ptr()),
            7 => fmi2GetInteger(c, pointer, count, integers.as_mut_ptr()),
            8 => fmi2SetInteger(c, pointer, count, integers.as_ptr()),
            9 => fmi2GetBoolean(c, pointer, count, integers.as_mut_ptr()),
            10 => fmi2SetBoolean(c, pointer, count, integers.as_ptr()),
            11 => fmi2GetString(c, pointer, count, strings.as_mut_ptr()),
            12 => fmi2SetString(c, pointer, count, strings.as_ptr()),
            13 => fmi2GetFMUstate(c, known),
            14 => fmi2SetFMUstate(c, random.pick(&[*known, null_mut(), without_provenance_mut(3)])),
            15 => fmi2FreeFMUstate(c, known),
            16 => fmi2SetRealInputDerivatives(c, pointer, count, integers.as_ptr(), reals.as_ptr()),
            17 => fmi2GetRealOutputDerivatives(c, pointer, count, integers.as_ptr(), reals.as_mut_ptr()),
            18 => fmi2GetRealStatus(c, random.below(5) as i32, reals.as_mut_ptr()),
            19 => fmi2SetDebugLogging(c, integers[0], count.min(2), strings.as_ptr()),
            20 => fmi2DeSerializeFMUstate(c, vr.as_ptr().cast(), 8, known),
            _ => {
                let status = fmi2DoStep(c, *time, step, 0);
                fmi2GetRealStatus(c, 2, time);
                status
            }
        }
    }
}

#[test]
fn calls_in_any_order_are_answered_and_every_error_has_a_reason() {
    for seed in 0..500 {
        let random = &mut RandomSource(seed);
        let master = if seed % 2 == 0 {
            Master::new(GUID)
        } else {
            Master::ready(GUID)
        };
        let (mut states, mut time) = ([null_mut(); 2], 0.0);
        for _ in 0..60 {
            master.heard();
            let status = call(master.c, random, &mut states, &mut time);
            assert_ne!(status, Status::Fatal, "{:?}", master.heard());
            if status == Status::Error {
                assert!(master.heard().iter().any(|line| line.status == Status::Error));
            }
        }
    }
}
