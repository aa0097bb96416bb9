//! One call of any function, with arguments drawn by lot: most of them good, so that sequences get somewhere.

use std::ffi::{c_char, c_int};
use std::ptr::{null, null_mut, without_provenance_mut};

use fmi2_component::Status;
use fmi2_component::abi::EventInfo;

use super::Dice;
use crate::functions::Raw;
use crate::master::{Interface, Master};

/// Values that nobody expects.
const WILD: [f64; 12] = [
    0.0,
    -0.0,
    1.0,
    -1.0,
    1e9,
    1e300,
    -1e300,
    1e-300,
    f64::NAN,
    f64::INFINITY,
    f64::NEG_INFINITY,
    f64::MIN_POSITIVE,
];
/// Elements of an array.
const MOST: usize = 6;
/// What a master has in its hands.
pub(super) struct Caller<'a> {
    master: &'a Master,
    states: [Raw; 3],
    blob: Vec<u8>,
    time: f64,
    /// Value references by type.
    known: [Vec<u32>; 3],
    /// How far set-up has come: what would be in order next.
    stage: usize,
    interface: Interface,
}

/// The types whose variables the descriptions have.
const TYPES: [&str; 3] = ["<Real", "<Integer", "<Boolean"];

/// The references of all variables of a type, and one that is unknown.
fn known(description: &str, kind: &str) -> Vec<u32> {
    let variables = description.split("<ScalarVariable").skip(1);
    let reference = |text: &str| {
        let (_, rest) = text.split_once("valueReference=\"")?;
        rest.split('"').next()?.parse().ok()
    };
    let of_kind = variables.filter(|text| text.contains(kind));
    of_kind.filter_map(reference).chain([u32::MAX]).collect()
}

impl<'a> Caller<'a> {
    pub fn new(master: &'a Master, description: &str, interface: Interface) -> Self {
        Self {
            master,
            states: [null_mut(); 3],
            blob: Vec::new(),
            time: 0.0,
            known: TYPES.map(|kind| known(description, kind)),
            stage: 0,
            interface,
        }
    }

    /// Makes a call; answers which, and its status.
    pub fn call(&mut self, dice: &mut Dice) -> (&'static str, Status) {
        // Now and then the other interface's.
        let exchange = (self.interface == Interface::ModelExchange) != dice.one_in(12);
        match dice.roll(16) {
            0..=3 => self.values(dice),
            4 => self.states(dice),
            5..=6 => self.derivatives(dice),
            7 => self.status(dice),
            8..=10 => self.life(dice),
            _ if exchange => self.exchange(dice),
            _ => self.step(dice),
        }
    }

    fn references(&self, dice: &mut Dice, kind: usize) -> [u32; MOST] {
        // Now and then of another type.
        let kind = if dice.one_in(12) { dice.roll(3) } else { kind };
        std::array::from_fn(|_| self.known[kind][dice.roll(self.known[kind].len())])
    }

    fn values(&mut self, dice: &mut Dice) -> (&'static str, Status) {
        let (c, f) = (self.master.c, &self.master.f);
        let function = dice.roll(12);
        let kind = match function {
            7 | 8 => 1,
            9 | 10 => 2,
            _ => 0,
        };
        let vr = self.references(dice, kind);
        let (vr, count) = (pointer(dice, vr.as_ptr()), count(dice));
        let mut reals = numbers(dice);
        let mut integers = [dice.roll(5) as c_int - 1; MOST];
        let mut strings: [*const c_char; MOST] = [c"\xff%n%s".as_ptr(); MOST];
        strings[1] = dice.pick(&[null(), c"text".as_ptr()]);
        let wrong = dice.one_in(12);
        // SAFETY: arrays have MOST elements, which is no less than a count that is not absurd.
        unsafe {
            match function {
                0..=3 => (
                    "fmi2SetReal",
                    (f.fmi2SetReal)(c, vr, count, if wrong { null() } else { reals.as_ptr() }),
                ),
                4..=6 => (
                    "fmi2GetReal",
                    (f.fmi2GetReal)(
                        c,
                        vr,
                        count,
                        if wrong {
                            null_mut()
                        } else {
                            reals.as_mut_ptr()
                        },
                    ),
                ),
                7 => (
                    "fmi2SetInteger",
                    (f.fmi2SetInteger)(c, vr, count, integers.as_ptr()),
                ),
                8 => (
                    "fmi2GetInteger",
                    (f.fmi2GetInteger)(c, vr, count, integers.as_mut_ptr()),
                ),
                9 => (
                    "fmi2SetBoolean",
                    (f.fmi2SetBoolean)(c, vr, count, integers.as_ptr()),
                ),
                10 => (
                    "fmi2GetBoolean",
                    (f.fmi2GetBoolean)(c, vr, count, integers.as_mut_ptr()),
                ),
                _ if wrong => (
                    "fmi2GetString",
                    (f.fmi2GetString)(c, vr, count, strings.as_mut_ptr()),
                ),
                _ => (
                    "fmi2SetString",
                    (f.fmi2SetString)(c, vr, count, strings.as_ptr()),
                ),
            }
        }
    }

    fn states(&mut self, dice: &mut Dice) -> (&'static str, Status) {
        let (c, f) = (self.master.c, &self.master.f);
        let known = &mut self.states[dice.roll(3)];
        let made_up = dice.pick(&[*known, *known, null_mut(), without_provenance_mut(3)]);
        let mut size = 0;
        // SAFETY: the blob is as long as it is said to be.
        unsafe {
            match dice.roll(6) {
                0 => ("fmi2GetFMUstate", (f.fmi2GetFMUstate)(c, known)),
                1 => ("fmi2SetFMUstate", (f.fmi2SetFMUstate)(c, made_up)),
                2 => ("fmi2FreeFMUstate", (f.fmi2FreeFMUstate)(c, known)),
                3 => (
                    "fmi2SerializedFMUstateSize",
                    (f.fmi2SerializedFMUstateSize)(c, made_up, &mut size),
                ),
                4 => {
                    self.blob = vec![0; 4000];
                    let bytes = self.blob.as_mut_ptr();
                    let size = dice.pick(&[0, 10, self.blob.len()]);
                    (
                        "fmi2SerializeFMUstate",
                        (f.fmi2SerializeFMUstate)(c, made_up, bytes, size),
                    )
                }
                _ => {
                    if let Some(byte) = self.blob.get_mut(dice.roll(4000)) {
                        *byte ^= dice.pick(&[0, 0, 1, 0x80]);
                    }
                    let (bytes, size) = (self.blob.as_ptr(), self.blob.len());
                    (
                        "fmi2DeSerializeFMUstate",
                        (f.fmi2DeSerializeFMUstate)(c, bytes, size, known),
                    )
                }
            }
        }
    }

    fn derivatives(&mut self, dice: &mut Dice) -> (&'static str, Status) {
        let (c, f) = (self.master.c, &self.master.f);
        let (unknowns, knowns) = (self.references(dice, 0), self.references(dice, 0));
        let mut values = numbers(dice);
        let vr = pointer(dice, unknowns.as_ptr());
        let (count, other) = (count(dice), count(dice));
        let order = [dice.roll(6) as c_int - 1; MOST];
        let mut answer = [0.0; MOST];
        // SAFETY: as above.
        unsafe {
            match dice.roll(3) {
                0 => (
                    "fmi2SetRealInputDerivatives",
                    (f.fmi2SetRealInputDerivatives)(c, vr, count, order.as_ptr(), values.as_ptr()),
                ),
                1 => (
                    "fmi2GetRealOutputDerivatives",
                    (f.fmi2GetRealOutputDerivatives)(
                        c,
                        vr,
                        count,
                        order.as_ptr(),
                        values.as_mut_ptr(),
                    ),
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

    fn status(&mut self, dice: &mut Dice) -> (&'static str, Status) {
        let (c, f) = (self.master.c, &self.master.f);
        let kind = dice.roll(6) as c_int - 1;
        let (mut real, mut integer, mut string, mut status) = (0.0, 0, null(), Status::Ok);
        // SAFETY: one place each.
        unsafe {
            match dice.roll(5) {
                0 => ("fmi2GetStatus", (f.fmi2GetStatus)(c, kind, &mut status)),
                1 => (
                    "fmi2GetRealStatus",
                    (f.fmi2GetRealStatus)(c, kind, &mut real),
                ),
                2 => (
                    "fmi2GetIntegerStatus",
                    (f.fmi2GetIntegerStatus)(c, kind, &mut integer),
                ),
                3 => (
                    "fmi2GetBooleanStatus",
                    (f.fmi2GetBooleanStatus)(c, kind, null_mut()),
                ),
                _ => (
                    "fmi2GetStringStatus",
                    (f.fmi2GetStringStatus)(c, kind, &mut string),
                ),
            }
        }
    }

    fn life(&mut self, dice: &mut Dice) -> (&'static str, Status) {
        let (c, f) = (self.master.c, &self.master.f);
        let categories = [c"logAll".as_ptr(), c"\xfe%s".as_ptr(), null()];
        let number = |dice: &mut Dice| {
            if dice.one_in(4) {
                dice.pick(&WILD)
            } else {
                0.0
            }
        };
        // Mostly what is in order.
        let wanted = if dice.one_in(4) {
            dice.roll(6)
        } else {
            self.stage
        };
        // SAFETY: as the standard asks.
        let (name, status) = unsafe {
            match wanted {
                0 => {
                    self.time = number(dice);
                    let (stop, defined) = (number(dice), c_int::from(dice.one_in(6)));
                    (
                        "fmi2SetupExperiment",
                        (f.fmi2SetupExperiment)(c, 1, number(dice), self.time, defined, stop),
                    )
                }
                1 => (
                    "fmi2EnterInitializationMode",
                    (f.fmi2EnterInitializationMode)(c),
                ),
                2 => (
                    "fmi2ExitInitializationMode",
                    (f.fmi2ExitInitializationMode)(c),
                ),
                3 | 4 => {
                    let (on, count) = (dice.roll(2) as c_int, dice.roll(4));
                    (
                        "fmi2SetDebugLogging",
                        (f.fmi2SetDebugLogging)(c, on, count, categories.as_ptr()),
                    )
                }
                _ if dice.one_in(8) => ("fmi2Terminate", (f.fmi2Terminate)(c)),
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

    fn step(&mut self, dice: &mut Dice) -> (&'static str, Status) {
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
        let time = if dice.one_in(12) {
            dice.pick(&WILD)
        } else {
            self.time
        };
        let status = unsafe { (f.fmi2DoStep)(c, time, step, 0) };
        if status == Status::Ok {
            self.time = time + step;
        }
        ("fmi2DoStep", status)
    }

    fn exchange(&mut self, dice: &mut Dice) -> (&'static str, Status) {
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
                1..=2 => (
                    "fmi2NewDiscreteStates",
                    (f.fmi2NewDiscreteStates)(c, &mut info),
                ),
                3..=4 => (
                    "fmi2EnterContinuousTimeMode",
                    (f.fmi2EnterContinuousTimeMode)(c),
                ),
                5 => (
                    "fmi2CompletedIntegratorStep",
                    (f.fmi2CompletedIntegratorStep)(c, 1, &mut event, &mut end),
                ),
                6 => ("fmi2SetTime", (f.fmi2SetTime)(c, values[0])),
                7 => (
                    "fmi2SetContinuousStates",
                    (f.fmi2SetContinuousStates)(c, at, count),
                ),
                8 => ("fmi2GetDerivatives", (f.fmi2GetDerivatives)(c, at, count)),
                9 => (
                    "fmi2GetEventIndicators",
                    (f.fmi2GetEventIndicators)(c, at, count),
                ),
                10 => (
                    "fmi2GetContinuousStates",
                    (f.fmi2GetContinuousStates)(c, at, count),
                ),
                _ => (
                    "fmi2GetNominalsOfContinuousStates",
                    (f.fmi2GetNominalsOfContinuousStates)(c, at, count),
                ),
            }
        }
    }
}

fn numbers(dice: &mut Dice) -> [f64; MOST] {
    std::array::from_fn(|_| match dice.roll(8) {
        0 => dice.pick(&WILD),
        1..=3 => dice.between(-1.0, 1.0),
        4 => dice.between(0.0, 100.0),
        _ => dice.between(0.0, 0.01),
    })
}

fn count(dice: &mut Dice) -> usize {
    match dice.roll(16) {
        0 => dice.pick(&[0, usize::MAX, 1 << 40, isize::MAX as usize]),
        1..=11 => 1,
        _ => dice.roll(MOST + 1),
    }
}

fn pointer<T>(dice: &mut Dice, pointer: *const T) -> *const T {
    if dice.one_in(24) { null() } else { pointer }
}
