//! The life cycle, FMU states and status queries.

use std::ffi::c_int;
use std::ptr::{null, null_mut, without_provenance_mut};

use fmi2_component::Status;

use super::Caller;
use super::arguments::WILD;
use crate::fuzz::RandomSource;

impl Caller<'_> {
    pub(super) fn life(&mut self, random: &mut RandomSource) -> (&'static str, Status) {
        let (c, f) = (self.master.c, &self.master.f);
        let categories = [c"logAll".as_ptr(), c"\xfe%s".as_ptr(), null()];
        let number = |random: &mut RandomSource| {
            if random.one_in(4) { random.pick(&WILD) } else { 0.0 }
        };
        // Mostly what is in order.
        let wanted = if random.one_in(4) { random.below(6) } else { self.stage };
        // SAFETY: as the standard asks.
        let (name, status) = unsafe {
            match wanted {
                0 => {
                    self.time = number(random);
                    let (stop, defined) = (number(random), c_int::from(random.one_in(6)));
                    (
                        "fmi2SetupExperiment",
                        (f.fmi2SetupExperiment)(c, 1, number(random), self.time, defined, stop),
                    )
                }
                1 => ("fmi2EnterInitializationMode", (f.fmi2EnterInitializationMode)(c)),
                2 => ("fmi2ExitInitializationMode", (f.fmi2ExitInitializationMode)(c)),
                3 | 4 => {
                    let (on, count) = (random.below(2) as c_int, random.below(4));
                    (
                        "fmi2SetDebugLogging",
                        (f.fmi2SetDebugLogging)(c, on, count, categories.as_ptr()),
                    )
                }
                _ if random.one_in(8) => ("fmi2Terminate", (f.fmi2Terminate)(c)),
                _ => ("fmi2Reset", (f.fmi2Reset)(c)),
            }
        };
        self.stage = match (name, status) {
            ("fmi2Reset", Status::Ok) => 0,
            (_, Status::Ok) if wanted == self.stage => (wanted + 1).min(5),
            // Something is amiss: begin anew.
            (_, Status::Error) => 5,
            _ => self.stage,
        };
        (name, status)
    }

    pub(super) fn states(&mut self, random: &mut RandomSource) -> (&'static str, Status) {
        let (c, f) = (self.master.c, &self.master.f);
        let known = &mut self.states[random.below(3)];
        let made_up = random.pick(&[*known, *known, null_mut(), without_provenance_mut(3)]);
        let mut size = 0;
        // SAFETY: the blob is as long as it is said to be.
        unsafe {
            match random.below(6) {
                0 => ("fmi2GetFMUstate", (f.fmi2GetFMUstate)(c, known)),
                1 => ("fmi2SetFMUstate", (f.fmi2SetFMUstate)(c, made_up)),
                2 => ("fmi2FreeFMUstate", (f.fmi2FreeFMUstate)(c, known)),
                3 => (
                    "fmi2SerializedFMUstateSize",
                    (f.fmi2SerializedFMUstateSize)(c, made_up, &mut size),
                ),
                4 => {
                    self.blob = vec![0; 4000];
                    let bytes = self.blob.as_mut_ptr().cast();
                    let size = random.pick(&[0, 10, self.blob.len()]);
                    (
                        "fmi2SerializeFMUstate",
                        (f.fmi2SerializeFMUstate)(c, made_up, bytes, size),
                    )
                }
                _ => {
                    if let Some(byte) = self.blob.get_mut(random.below(4000)) {
                        *byte ^= random.pick(&[0, 0, 1, 0x80]);
                    }
                    let (bytes, size) = (self.blob.as_ptr().cast(), self.blob.len());
                    (
                        "fmi2DeSerializeFMUstate",
                        (f.fmi2DeSerializeFMUstate)(c, bytes, size, known),
                    )
                }
            }
        }
    }

    pub(super) fn status(&mut self, random: &mut RandomSource) -> (&'static str, Status) {
        let (c, f) = (self.master.c, &self.master.f);
        let kind = random.below(6) as c_int - 1;
        let (mut real, mut integer, mut string, mut status) = (0.0, 0, null(), Status::Ok);
        // SAFETY: one place each.
        unsafe {
            match random.below(5) {
                0 => ("fmi2GetStatus", (f.fmi2GetStatus)(c, kind, &mut status)),
                1 => ("fmi2GetRealStatus", (f.fmi2GetRealStatus)(c, kind, &mut real)),
                2 => ("fmi2GetIntegerStatus", (f.fmi2GetIntegerStatus)(c, kind, &mut integer)),
                3 => ("fmi2GetBooleanStatus", (f.fmi2GetBooleanStatus)(c, kind, null_mut())),
                _ => ("fmi2GetStringStatus", (f.fmi2GetStringStatus)(c, kind, &mut string)),
            }
        }
    }
}
