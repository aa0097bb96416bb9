//! Going on in time: steps of co-simulation, and what model exchange is asked.

use std::ptr::null_mut;

use fmi2_component::Status;
use fmi2_component::abi::EventInfo;

use super::Caller;
use super::arguments::{WILD, numbers};
use crate::fuzz::RandomSource;

impl Caller<'_> {
    pub(super) fn step(&mut self, random: &mut RandomSource) -> (&'static str, Status) {
        let (c, f) = (self.master.c, &self.master.f);
        if random.one_in(20) {
            // SAFETY: the instance is alive; so below.
            return ("fmi2CancelStep", unsafe { (f.fmi2CancelStep)(c) });
        }
        let step = match random.below(12) {
            0 => random.pick(&WILD),
            1 => random.between(0.0, 10.0),
            _ => random.between(0.0, 0.01),
        };
        let time = if random.one_in(12) {
            random.pick(&WILD)
        } else {
            self.time
        };
        let status = unsafe { (f.fmi2DoStep)(c, time, step, 0) };
        if status == Status::Ok {
            self.time = time + step;
        }
        ("fmi2DoStep", status)
    }

    pub(super) fn exchange(&mut self, random: &mut RandomSource) -> (&'static str, Status) {
        let (c, f) = (self.master.c, &self.master.f);
        let count = random.pick(&[5, 5, 5, 5, 3, 0, usize::MAX]);
        let mut values = numbers(random);
        if random.one_in(2) {
            values = std::array::from_fn(|_| random.between(-0.01, 0.01));
        }
        let at = if random.one_in(20) {
            null_mut()
        } else {
            values.as_mut_ptr()
        };
        let (mut event, mut end, mut info) = (0, 0, EventInfo::default());
        // SAFETY: as above.
        unsafe {
            match random.below(12) {
                0 => ("fmi2EnterEventMode", (f.fmi2EnterEventMode)(c)),
                1..=2 => ("fmi2NewDiscreteStates", (f.fmi2NewDiscreteStates)(c, &mut info)),
                3..=4 => ("fmi2EnterContinuousTimeMode", (f.fmi2EnterContinuousTimeMode)(c)),
                5 => (
                    "fmi2CompletedIntegratorStep",
                    (f.fmi2CompletedIntegratorStep)(c, 1, &mut event, &mut end),
                ),
                6 => ("fmi2SetTime", (f.fmi2SetTime)(c, values[0])),
                7 => ("fmi2SetContinuousStates", (f.fmi2SetContinuousStates)(c, at, count)),
                8 => ("fmi2GetDerivatives", (f.fmi2GetDerivatives)(c, at, count)),
                9 => ("fmi2GetEventIndicators", (f.fmi2GetEventIndicators)(c, at, count)),
                10 => ("fmi2GetContinuousStates", (f.fmi2GetContinuousStates)(c, at, count)),
                _ => (
                    "fmi2GetNominalsOfContinuousStates",
                    (f.fmi2GetNominalsOfContinuousStates)(c, at, count),
                ),
            }
        }
    }
}
