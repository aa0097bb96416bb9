//! What a sample through the C interface costs: two inputs set, one step, four outputs read, 100 samples a period.
//!
//! Beside it the same sample as Rust calls the plant, with no interface between: the difference is what the shell and the
//! binding add. Both are of the same scene: one with two impacts a period, one without any.
//!
//! ```text
//! cargo bench -p fmi2-boundary
//! ```
//!
//! The table at the end is of the least times of many short runs that take turns: those hardly depend on what else the
//! machine does.

use std::f64::consts::TAU;
use std::hint::black_box;
use std::time::{Duration, Instant};

use criterion::{Criterion, Throughput};
use fmi2_boundary::{Fmu, Interface, Master};
use lovines::{Drive, Parameters, Plant, State};

const EPSILON: f64 = 0.0084;
const LAMBDA: f64 = 1.43;
const RESTITUTION: f64 = 0.65;
/// Calls or samples in one run.
const RUN: u32 = 2000;
/// Value references of `omega` and `E`, and of `v`, `base`, `der(q2)` and `impact_time`.
const INPUTS: [u32; 2] = [8, 7];
const OUTPUTS: [u32; 4] = [13, 16, 12, 19];

/// The dimensionless rig of the default scene, one start and one excitation of it.
#[derive(Clone, Copy)]
struct Scene {
    start: State,
    amplitude: f64,
    omega: f64,
}

/// Near its lock: two impacts a period.
const STEADY: Scene = Scene {
    start: State { q1: -0.42, dq1: 0.01, q2: -0.99, dq2: -0.86 },
    amplitude: EPSILON * 1.1,
    omega: 0.990_417,
};

/// The particle is at rest in the middle, and no wall ever comes near it.
const QUIET: Scene = Scene {
    start: State { q1: 0.0, dq1: 0.0, q2: 0.0, dq2: 0.0 },
    amplitude: 1e-3,
    omega: 0.990_417,
};

/// What is set before a step.
#[derive(Clone, Copy)]
enum Inputs {
    /// The same values again and again, as most masters do.
    Same,
    /// Another frequency at every sample, as from a controller that has not settled.
    New,
}

impl Scene {
    fn parameters() -> Parameters {
        Parameters::dimensionless(EPSILON, LAMBDA, RESTITUTION)
    }

    fn step(&self) -> f64 {
        TAU / self.omega / 100.0
    }

    /// `omega` and `E` at sample `n`.
    fn inputs(&self, inputs: Inputs, n: u32) -> [f64; 2] {
        let wobble = match inputs {
            Inputs::Same => 0.0,
            Inputs::New => 1e-6 * f64::from(n % 7),
        };
        [self.omega + wobble, self.amplitude]
    }

    fn fmu(&self, fmu: &Fmu) -> Master {
        let rig = Master::new(fmu, Interface::CoSimulation);
        let (p, start) = (Self::parameters(), self.start);
        let values = [
            (0, p.primary_mass),
            (1, p.stiffness),
            (2, p.damping),
            (3, p.particle_mass),
            (4, p.half_width),
            (5, p.restitution),
            (9, start.q1),
            (10, start.dq1),
            (11, start.q2),
            (12, start.dq2),
        ];
        for (vr, value) in values {
            rig.well(rig.set_real(vr, value));
        }
        rig.start();
        rig
    }

    fn plant(&self) -> Plant {
        let mut plant = Plant::new(Self::parameters(), self.start).expect("the scene makes sense");
        plant.begin(Drive::default()).expect("a valid drive");
        plant
    }
}

/// What is measured: its name, and one run of it.
type Case = (String, Box<dyn FnMut()>);

/// Samples through the C interface.
fn through_c(fmu: &Fmu, scene: Scene, inputs: Inputs) -> Box<dyn FnMut()> {
    let rig = scene.fmu(fmu);
    let (mut n, mut time, step) = (0, 0.0, scene.step());
    let mut read = [0.0; 4];
    Box::new(move || {
        let f = &rig.f;
        for _ in 0..RUN {
            let values = scene.inputs(inputs, n);
            // SAFETY: arrays are as long as they are said to be.
            unsafe {
                (f.fmi2SetReal)(rig.c, INPUTS.as_ptr(), 2, black_box(&values).as_ptr());
                (f.fmi2DoStep)(rig.c, time, step, 1);
                (f.fmi2GetReal)(rig.c, OUTPUTS.as_ptr(), 4, read.as_mut_ptr());
            }
            black_box(&read);
            time += step;
            n += 1;
        }
        rig.well(rig.step(time, 0.0));
    })
}

/// The same as Rust calls the plant; without outputs where `read` is false.
fn from_rust(scene: Scene, inputs: Inputs, read: bool) -> Box<dyn FnMut()> {
    let mut plant = scene.plant();
    let (mut n, step) = (0, scene.step());
    Box::new(move || {
        for _ in 0..RUN {
            let [omega, amplitude] = scene.inputs(inputs, n);
            plant
                .advance(black_box(Drive::harmonic(amplitude, omega)), step)
                .expect("a valid drive");
            if read {
                black_box([
                    plant.centre(),
                    plant.base_displacement(),
                    plant.state().dq2,
                    plant.totals().impact_time,
                ]);
            }
            n += 1;
        }
    })
}

/// One kind of call alone, after a step.
fn alone(fmu: &Fmu, what: fn(&Master, &mut [f64; 4])) -> Box<dyn FnMut()> {
    let rig = QUIET.fmu(fmu);
    rig.well(rig.set_real(7, QUIET.amplitude));
    rig.well(rig.set_real(8, QUIET.omega));
    rig.well(rig.step(0.0, QUIET.step()));
    let mut read = [QUIET.omega, QUIET.amplitude, 0.0, 0.0];
    Box::new(move || {
        for _ in 0..RUN {
            what(&rig, black_box(&mut read));
        }
    })
}

/// All that is measured, samples in pairs: through C, and as called from Rust.
fn cases() -> Vec<Case> {
    let fmu = Fmu::plant();
    let mut cases: Vec<Case> = Vec::new();
    for (name, scene, inputs) in [
        ("no impact", QUIET, Inputs::Same),
        ("no impact, omega new in every step", QUIET, Inputs::New),
        ("two impacts a period", STEADY, Inputs::Same),
        ("two impacts a period, omega new", STEADY, Inputs::New),
    ] {
        cases.push((format!("{name}: through C"), through_c(&fmu, scene, inputs)));
        cases.push((format!("{name}: from Rust"), from_rust(scene, inputs, true)));
    }
    cases.push((
        "no impact, the step alone: from Rust".into(),
        from_rust(QUIET, Inputs::Same, false),
    ));
    // SAFETY: arrays are as long as they are said to be; so below.
    let set: fn(&Master, &mut [f64; 4]) =
        |rig, values| unsafe { _ = (rig.f.fmi2SetReal)(rig.c, INPUTS.as_ptr(), 2, values.as_ptr()) };
    let get: fn(&Master, &mut [f64; 4]) = |rig, values| unsafe {
        _ = (rig.f.fmi2GetReal)(rig.c, OUTPUTS.as_ptr(), 4, values.as_mut_ptr());
    };
    let zero: fn(&Master, &mut [f64; 4]) = |rig, _| unsafe { _ = (rig.f.fmi2DoStep)(rig.c, QUIET.step(), 0.0, 1) };
    let nothing: fn(&Master, &mut [f64; 4]) = |rig, _| unsafe {
        black_box((rig.f.fmi2GetVersion)());
    };
    cases.push(("fmi2SetReal of two inputs".into(), alone(&fmu, set)));
    cases.push(("fmi2GetReal of four outputs".into(), alone(&fmu, get)));
    cases.push(("fmi2DoStep of length zero".into(), alone(&fmu, zero)));
    cases.push(("a call that does nothing".into(), alone(&fmu, nothing)));
    cases
}

/// Least nanoseconds of a sample or call, all cases taking turns.
fn least(cases: &mut [Case]) {
    let mut least = vec![f64::INFINITY; cases.len()];
    let began = Instant::now();
    while began.elapsed() < Duration::from_secs(4) {
        for (best, (_, run)) in least.iter_mut().zip(&mut *cases) {
            let start = Instant::now();
            run();
            *best = best.min(start.elapsed().as_nanos() as f64 / f64::from(RUN));
        }
    }
    println!("\nLeast times of runs that take turns:");
    for ((name, _), ns) in cases.iter().zip(&least) {
        println!("{name:50} {ns:8.2} ns");
    }
}

fn main() {
    let mut criterion = Criterion::default().configure_from_args();
    let mut cases = cases();
    let mut group = criterion.benchmark_group("LoViNes");
    for (name, run) in &mut cases {
        group.throughput(Throughput::Elements(RUN.into()));
        group.bench_function(name.as_str(), |b| b.iter(&mut *run));
    }
    group.finish();
    criterion.final_summary();
    // `cargo test --benches` only wants to see each run once.
    if std::env::args().any(|argument| argument == "--bench") {
        least(&mut cases);
    }
}
