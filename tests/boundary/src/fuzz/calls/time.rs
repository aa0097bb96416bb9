//! Going on in time: steps of co-simulation, and what model exchange is asked.

use std::ptr::null_mut;

use fmi2_component::Status;
use fmi2_component::abi::EventInfo;

use super::Caller;
use super::arguments::{WILD, numbers};
use crate::fuzz::Dice;

impl Caller<'_> {
    pub(super) fn step(&mut self, dice: &mut Dice) -> (&'static str, Status) {
        let (c, f) = (self.master.c, &self.master.f);
        if dice.one_in(20) {
            // SAFETY: the instance is alive; so below.
            return ("fmi2CancelStep", unsafe { (f.fmi2CancelStep)(c) });
        }
        let step = match dice.roll(12) {
            0 => dice.pick(&WILD),
            1 => dice.between(0.0, 10.0),
            _ => dice.between(0.0, 0.01),
        };
        let time = if dice.one_in(12) { dice.pick(&WILD) } else { self.time };
        let status = unsafe { (f.fmi2DoStep)(c, time, step, 0) };
        if status == Status::Ok {
            self.time = time + step;
        }
        ("fmi2DoStep", status)
    }

    pub(super) fn exchange(&mut self, dice: &mut Dice) -> (&'static str, Status) {
        let (c, f) = (self.master.c, &self.master.f);
        let count = dice.pick(&[5, 5, 5, 5, 3, 0, usize::MAX]);
        let mut values = numbers(dice);
        if dice.one_in(2) {
            values = std::array::from_fn(|_| dice.between(-0.01, 0.01));
        }
        let at = if dice.one_in(20) {
            null_mut()
        } else {
            values.as_mut_ptr()
        };
        let (mut event, mut end, mut info) = (0, 0, EventInfo::default());
        // SAFETY: as above.
        unsafe {
            match dice.roll(12) {
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
