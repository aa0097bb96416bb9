//! Random sequences of calls, with valid and invalid arguments: no crash, no hang, and a reason for every error.

use std::ffi::{c_char, c_int};
use std::ptr::{null, null_mut, without_provenance_mut};
use std::time::{Duration, Instant};

pub use fastrand::Rng;
use fmi2_component::Status;
use fmi2_component::abi::{CFmuState, EventInfo};
use fmi2_description::FmiType;

use crate::{Fmu, Interface, Master};

/// Calls in a sequence.
const CALLS: usize = 80;
/// Elements of an array.
const MOST: usize = 6;
const INF: f64 = f64::INFINITY;
const LEAST: f64 = f64::MIN_POSITIVE;
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
    INF,
    -INF,
    LEAST,
];

/// Calls a function of the instance; its name and status. The arguments must be as the standard asks, or such as the shell must refuse: arrays
/// have `MOST` elements, which is no less than a count that is not absurd.
macro_rules! call {
    ($caller:ident.$name:ident($($argument:expr),*)) => {
        (stringify!($name), unsafe { ($caller.master.f.$name)($caller.master.c, $($argument),*) })
    };
}

/// A library under random calls, and what became of them.
#[derive(Debug)]
pub struct Fuzzer {
    fmu: Fmu,
    /// Value references of Real, Integer and Boolean variables, and one that is unknown.
    references: [Vec<u32>; 3],
    /// Calls by their status: OK, warning, discard, error, fatal, pending.
    pub statuses: [u64; 6],
    /// Error calls after which the state was compared with the state before: none has changed.
    pub harmless: u64,
    /// The longest call.
    pub longest: Duration,
}

impl Fuzzer {
    /// No call yet.
    pub fn new(fmu: Fmu) -> Self {
        let variables = fmu.parsed().variables;
        let references = [FmiType::Real, FmiType::Integer, FmiType::Boolean].map(|kind| {
            let of_kind = variables
                .iter()
                .filter(|v| v.content().is_some_and(|(of, _)| of == kind));
            of_kind.map(|v| v.value_reference).chain([u32::MAX]).collect()
        });
        let (statuses, harmless, longest) = ([0; 6], 0, Duration::ZERO);
        Self { fmu, references, statuses, harmless, longest }
    }

    /// Makes the sequence of that seed with a new instance. Panics if a call is fatal, or an error without a reason, or an illegal call
    /// has changed something.
    pub fn sequence(&mut self, seed: u64) {
        let fmu = &self.fmu;
        let mut random = Rng::with_seed(seed);
        let interface = if fmu.description.contains("<ModelExchange") && random.bool() {
            Interface::ModelExchange
        } else {
            Interface::CoSimulation
        };
        let master = Master::new(fmu, interface);
        let (states, blob, references) = ([null_mut(); 3], Vec::new(), &self.references);
        let mut caller = Caller {
            master: &master,
            states,
            blob,
            time: 0.0,
            references,
            stage: 0,
            interface,
        };
        if random.bool() {
            master.start();
        }
        for n in 0..CALLS {
            let before = one_in(&mut random, 8).then(|| master.bytes());
            let _ = master.heard();
            let began = Instant::now();
            let (name, status) = caller.call(&mut random);
            self.longest = self.longest.max(began.elapsed());
            self.statuses[status as usize] += 1;
            let heard = master.heard();
            let place = || format!("{} {interface:?}, seed {seed}, call {n}: {name}: {heard:?}", fmu.name);
            assert_ne!(status, Status::Fatal, "{}", place());
            if matches!(status, Status::Error | Status::Discard) {
                let reason = heard.iter().find(|line| line.status == status);
                let reason = reason.unwrap_or_else(|| panic!("no reason: {}", place()));
                assert!(reason.text.starts_with(name), "{}", place());
                let illegal = reason.text.contains("is illegal in state");
                if let Some(before) = before.filter(|_| illegal) {
                    assert_eq!(master.bytes(), before, "harm done: {}", place());
                    let _ = master.heard();
                    self.harmless += 1;
                }
            }
        }
    }
}

/// True once in `many`.
fn one_in(random: &mut Rng, many: usize) -> bool {
    random.usize(..many) == 0
}

fn pick<T: Copy>(random: &mut Rng, of: &[T]) -> T {
    of[random.usize(..of.len())]
}

fn between(random: &mut Rng, from: f64, to: f64) -> f64 {
    from + (to - from) * random.f64()
}

/// Numbers, some of them wild.
fn numbers(random: &mut Rng) -> [f64; MOST] {
    std::array::from_fn(|_| match random.usize(..8) {
        0 => pick(random, &WILD),
        1..=3 => between(random, -1.0, 1.0),
        4 => between(random, 0.0, 100.0),
        _ => between(random, 0.0, 0.01),
    })
}

/// A number of elements: mostly one.
fn count(random: &mut Rng) -> usize {
    match random.usize(..16) {
        0 => pick(random, &[0, usize::MAX, 1 << 40, isize::MAX as usize]),
        1..=11 => 1,
        _ => random.usize(..=MOST),
    }
}

/// An instance, and what its master has got from it.
struct Caller<'a> {
    master: &'a Master,
    states: [CFmuState; 3],
    blob: Vec<u8>,
    time: f64,
    references: &'a [Vec<u32>; 3],
    /// How far set-up has come: what would be in order next.
    stage: usize,
    interface: Interface,
}

impl Caller<'_> {
    /// Value references of a type, now and then of another one.
    fn references(&self, random: &mut Rng, kind: usize) -> [u32; MOST] {
        let kind = if one_in(random, 12) { random.usize(..3) } else { kind };
        std::array::from_fn(|_| pick(random, &self.references[kind]))
    }

    /// Makes a call; returns its name and status.
    fn call(&mut self, random: &mut Rng) -> (&'static str, Status) {
        let r = random;
        let wild = one_in(r, 12);
        let (n, m) = (count(r), count(r));
        let [reals, integers, booleans] = [0, 1, 2].map(|kind| self.references(r, kind));
        let [vr, vi, vb] = [&reals, &integers, &booleans].map(|vr| if one_in(r, 24) { null() } else { vr.as_ptr() });
        let mut x = numbers(r);
        let mut whole = [r.i32(-1..5); MOST];
        let mut strings: [*const c_char; MOST] = [c"\xff%n%s".as_ptr(); MOST];
        strings[1] = pick(r, &[null(), c"text".as_ptr()]);
        // Now and then a function of the other interface.
        let exchange = (self.interface == Interface::ModelExchange) != one_in(r, 12);
        match r.usize(..16) {
            0..=3 => match r.usize(..12) {
                0..=3 => call!(self.fmi2SetReal(vr, n, if wild { null() } else { x.as_ptr() })),
                4..=6 => call!(self.fmi2GetReal(vr, n, if wild { null_mut() } else { x.as_mut_ptr() })),
                7 => call!(self.fmi2SetInteger(vi, n, whole.as_ptr())),
                8 => call!(self.fmi2GetInteger(vi, n, whole.as_mut_ptr())),
                9 => call!(self.fmi2SetBoolean(vb, n, whole.as_ptr())),
                10 => call!(self.fmi2GetBoolean(vb, n, whole.as_mut_ptr())),
                _ if wild => call!(self.fmi2GetString(vr, n, strings.as_mut_ptr())),
                _ => call!(self.fmi2SetString(vr, n, strings.as_ptr())),
            },
            4 => self.state(r),
            5..=6 => match r.usize(..3) {
                0 => call!(self.fmi2SetRealInputDerivatives(vr, n, whole.as_ptr(), x.as_ptr())),
                1 => call!(self.fmi2GetRealOutputDerivatives(vr, n, whole.as_ptr(), x.as_mut_ptr())),
                _ => {
                    let (knowns, mut answer) = (self.references(r, 0), [0.0; MOST]);
                    let (known, along, answer) = (knowns.as_ptr(), x.as_ptr(), answer.as_mut_ptr());
                    call!(self.fmi2GetDirectionalDerivative(vr, n, known, m, along, answer))
                }
            },
            7 => match r.usize(..5) {
                0 => call!(self.fmi2GetStatus(whole[0], &mut Status::Ok)),
                1 => call!(self.fmi2GetRealStatus(whole[0], &mut x[0])),
                2 => call!(self.fmi2GetIntegerStatus(whole[0], &mut 0)),
                3 => call!(self.fmi2GetBooleanStatus(whole[0], null_mut())),
                _ => call!(self.fmi2GetStringStatus(whole[0], &mut strings[0])),
            },
            8..=10 => self.life(r),
            _ if exchange => {
                if r.bool() {
                    x = std::array::from_fn(|_| between(r, -0.01, 0.01));
                }
                let at = if one_in(r, 20) { null_mut() } else { x.as_mut_ptr() };
                let n = pick(r, &[5, 5, 5, 5, 3, 0, usize::MAX]);
                match r.usize(..12) {
                    0 => call!(self.fmi2EnterEventMode()),
                    1..=2 => call!(self.fmi2NewDiscreteStates(&mut EventInfo::default())),
                    3..=4 => call!(self.fmi2EnterContinuousTimeMode()),
                    5 => call!(self.fmi2CompletedIntegratorStep(1, &mut 0, &mut 0)),
                    6 => call!(self.fmi2SetTime(x[0])),
                    7 => call!(self.fmi2SetContinuousStates(at, n)),
                    8 => call!(self.fmi2GetDerivatives(at, n)),
                    9 => call!(self.fmi2GetEventIndicators(at, n)),
                    10 => call!(self.fmi2GetContinuousStates(at, n)),
                    _ => call!(self.fmi2GetNominalsOfContinuousStates(at, n)),
                }
            }
            _ if one_in(r, 20) => call!(self.fmi2CancelStep()),
            _ => {
                let step = match r.usize(..12) {
                    0 => pick(r, &WILD),
                    1 => between(r, 0.0, 10.0),
                    _ => between(r, 0.0, 0.01),
                };
                let time = if one_in(r, 12) { pick(r, &WILD) } else { self.time };
                let done = call!(self.fmi2DoStep(time, step, 0));
                if done.1 == Status::Ok {
                    self.time = time + step;
                }
                done
            }
        }
    }

    /// The life cycle: mostly what is in order.
    fn life(&mut self, r: &mut Rng) -> (&'static str, Status) {
        let mut time = || if one_in(r, 4) { pick(r, &WILD) } else { 0.0 };
        let [start, stop, tolerance] = [time(), time(), time()];
        let wanted = if one_in(r, 4) { r.usize(..6) } else { self.stage };
        let defined = c_int::from(one_in(r, 6));
        let categories = [c"logAll".as_ptr(), c"\xfe%s".as_ptr(), null()];
        let (on, count) = (c_int::from(r.bool()), r.usize(..4));
        let done = match wanted {
            0 => {
                self.time = start;
                call!(self.fmi2SetupExperiment(1, tolerance, start, defined, stop))
            }
            1 => call!(self.fmi2EnterInitializationMode()),
            2 => call!(self.fmi2ExitInitializationMode()),
            3 | 4 => call!(self.fmi2SetDebugLogging(on, count, categories.as_ptr())),
            _ if one_in(r, 8) => call!(self.fmi2Terminate()),
            _ => call!(self.fmi2Reset()),
        };
        self.stage = match done {
            ("fmi2Reset", Status::Ok) => 0,
            (_, Status::Ok) if wanted == self.stage => (wanted + 1).min(5),
            // Something is amiss: a reset comes next.
            (_, Status::Error) => 5,
            _ => self.stage,
        };
        done
    }

    /// FMU states, handles that were never given out, and damaged bytes.
    fn state(&mut self, r: &mut Rng) -> (&'static str, Status) {
        let own = &mut self.states[r.usize(..3)];
        let any = pick(r, &[*own, *own, null_mut(), without_provenance_mut(3)]);
        match r.usize(..6) {
            0 => call!(self.fmi2GetFMUstate(own)),
            1 => call!(self.fmi2SetFMUstate(any)),
            2 => call!(self.fmi2FreeFMUstate(own)),
            3 => call!(self.fmi2SerializedFMUstateSize(any, &mut 0)),
            4 => {
                self.blob = vec![0; 4000];
                let size = pick(r, &[0, 10, self.blob.len()]);
                call!(self.fmi2SerializeFMUstate(any, self.blob.as_mut_ptr().cast(), size))
            }
            _ => {
                if let Some(byte) = self.blob.get_mut(r.usize(..4000)) {
                    *byte ^= pick(r, &[0, 0, 1, 0x80]);
                }
                let (bytes, size) = (self.blob.as_ptr().cast(), self.blob.len());
                call!(self.fmi2DeSerializeFMUstate(bytes, size, own))
            }
        }
    }
}
