//! Setting and getting values, and their derivatives.

use std::ffi::{c_char, c_int};
use std::ptr::{null, null_mut};

use fmi2_component::Status;

use super::Caller;
use super::arguments::{MOST, count, numbers, pointer};
use crate::fuzz::RandomSource;

impl Caller<'_> {
    pub(super) fn values(&mut self, random: &mut RandomSource) -> (&'static str, Status) {
        let (c, f) = (self.master.c, &self.master.f);
        let function = random.below(12);
        let kind = match function {
            7 | 8 => 1,
            9 | 10 => 2,
            _ => 0,
        };
        let vr = self.references(random, kind);
        let (vr, count) = (pointer(random, vr.as_ptr()), count(random));
        let mut reals = numbers(random);
        let mut integers = [random.below(5) as c_int - 1; MOST];
        let mut strings: [*const c_char; MOST] = [c"\xff%n%s".as_ptr(); MOST];
        strings[1] = random.pick(&[null(), c"text".as_ptr()]);
        let wrong = random.one_in(12);
        // SAFETY: arrays have MOST elements, which is no less than a count that is not absurd.
        unsafe {
            match function {
                0..=3 => (
                    "fmi2SetReal",
                    (f.fmi2SetReal)(c, vr, count, if wrong { null() } else { reals.as_ptr() }),
                ),
                4..=6 => (
                    "fmi2GetReal",
                    (f.fmi2GetReal)(c, vr, count, if wrong { null_mut() } else { reals.as_mut_ptr() }),
                ),
                7 => ("fmi2SetInteger", (f.fmi2SetInteger)(c, vr, count, integers.as_ptr())),
                8 => (
                    "fmi2GetInteger",
                    (f.fmi2GetInteger)(c, vr, count, integers.as_mut_ptr()),
                ),
                9 => ("fmi2SetBoolean", (f.fmi2SetBoolean)(c, vr, count, integers.as_ptr())),
                10 => (
                    "fmi2GetBoolean",
                    (f.fmi2GetBoolean)(c, vr, count, integers.as_mut_ptr()),
                ),
                _ if wrong => ("fmi2GetString", (f.fmi2GetString)(c, vr, count, strings.as_mut_ptr())),
                _ => ("fmi2SetString", (f.fmi2SetString)(c, vr, count, strings.as_ptr())),
            }
        }
    }

    pub(super) fn derivatives(&mut self, random: &mut RandomSource) -> (&'static str, Status) {
        let (c, f) = (self.master.c, &self.master.f);
        let (unknowns, knowns) = (self.references(random, 0), self.references(random, 0));
        let mut values = numbers(random);
        let vr = pointer(random, unknowns.as_ptr());
        let (count, other) = (count(random), count(random));
        let order = [random.below(6) as c_int - 1; MOST];
        let mut answer = [0.0; MOST];
        // SAFETY: as above.
        unsafe {
            match random.below(3) {
                0 => (
                    "fmi2SetRealInputDerivatives",
                    (f.fmi2SetRealInputDerivatives)(c, vr, count, order.as_ptr(), values.as_ptr()),
                ),
                1 => (
                    "fmi2GetRealOutputDerivatives",
                    (f.fmi2GetRealOutputDerivatives)(c, vr, count, order.as_ptr(), values.as_mut_ptr()),
                ),
                _ => (
                    "fmi2GetDirectionalDerivative",
                    (f.fmi2GetDirectionalDerivative)(
                        c,
                        vr,
                        count,
                        knowns.as_ptr(),
                        other,
                        values.as_ptr(),
                        answer.as_mut_ptr(),
                    ),
                ),
            }
        }
    }
}
