//! What a sample through the C interface costs: two inputs set, one step, four outputs read, 100 samples a period.
//!
//! Beside it the same sample as Rust calls the plant, with no interface between: the difference is what the shell and the
//! binding add. Both runs are of the same scene and long enough to meet the same share of impacts.

use std::f64::consts::TAU;
use std::hint::black_box;

use criterion::{
    BenchmarkGroup, Criterion, criterion_group, criterion_main, measurement::WallTime,
};
use fmi2_boundary::{Fmu, Interface, Master};
use lovines::{Drive, Parameters, Plant, State};

/// The dimensionless rig of the default scene, near its lock.
const EPSILON: f64 = 0.0084;
const DAMPING: f64 = EPSILON * 1.43;
const RESTITUTION: f64 = 0.65;
const START: State = State {
    q1: -0.42,
    dq1: 0.01,
    q2: -0.99,
    dq2: -0.86,
};
const OMEGA: f64 = 0.990_417;
const AMPLITUDE: f64 = EPSILON * 1.1;
/// Value references of `omega` and `E`, and of `v`, `base`, `der(q2)` and `impact_time`.
const INPUTS: [u32; 2] = [8, 7];
const OUTPUTS: [u32; 4] = [13, 16, 12, 19];

fn locked(plant: &Fmu) -> Master {
    let rig = Master::new(plant, Interface::CoSimulation);
    let scene = [
        (0, 1.0),
        (1, 1.0),
        (2, DAMPING),
        (3, EPSILON),
        (4, 1.0),
        (5, RESTITUTION),
        (9, START.q1),
        (10, START.dq1),
        (11, START.q2),
        (12, START.dq2),
    ];
    for (vr, value) in scene {
        rig.well(rig.set_real(vr, value));
    }
    rig.start();
    rig
}

fn in_rust(group: &mut BenchmarkGroup<WallTime>) {
    let parameters = Parameters {
        restitution: RESTITUTION,
        ..Parameters::dimensionless(EPSILON, 1.43, RESTITUTION)
    };
    let mut plant = Plant::new(parameters, START).expect("the scene makes sense");
    let drive = Drive::harmonic(AMPLITUDE, OMEGA);
    plant.begin(drive);
    let step = TAU / 100.0;
    group.bench_function("the same called from Rust", |b| {
        b.iter(|| {
            plant.advance(black_box(drive), step);
            black_box([
                plant.centre(),
                plant.base().displacement(),
                plant.state().dq2,
                plant.tally().impact_time,
            ])
        });
    });
    group.bench_function("the step alone, called from Rust", |b| {
        b.iter(|| plant.advance(black_box(drive), step));
    });
}

fn samples(c: &mut Criterion) {
    let plant = Fmu::plant();
    let rig = locked(&plant);
    let step = TAU / 100.0;
    let drive = [OMEGA, AMPLITUDE];
    let mut read = [0.0; 4];
    let mut n = 0u32;
    let f = rig.f;
    let mut group = c.benchmark_group("LoViNes");
    // SAFETY: arrays are as long as they are said to be.
    group.bench_function("two inputs, one step, four outputs", |b| {
        b.iter(|| unsafe {
            (f.fmi2SetReal)(rig.c, INPUTS.as_ptr(), 2, black_box(&drive).as_ptr());
            (f.fmi2DoStep)(rig.c, f64::from(n) * step, step, 1);
            (f.fmi2GetReal)(rig.c, OUTPUTS.as_ptr(), 4, read.as_mut_ptr());
            n += 1;
            black_box(&read);
        });
    });
    rig.well(rig.step(f64::from(n) * step, 0.0));
    in_rust(&mut group);
    group.bench_function("two inputs", |b| {
        b.iter(|| unsafe {
            (f.fmi2SetReal)(rig.c, INPUTS.as_ptr(), 2, black_box(&drive).as_ptr())
        });
    });
    group.bench_function("four outputs", |b| {
        b.iter(|| unsafe {
            (f.fmi2GetReal)(
                rig.c,
                OUTPUTS.as_ptr(),
                4,
                black_box(&mut read).as_mut_ptr(),
            )
        });
    });
    group.bench_function("a step of length zero", |b| {
        b.iter(|| unsafe { (f.fmi2DoStep)(rig.c, f64::from(n) * step, 0.0, 1) });
    });
    // What any call through a pointer into the library costs.
    group.bench_function("a call that does nothing", |b| {
        b.iter(|| unsafe { black_box((f.fmi2GetVersion)()) });
    });
    group.finish();
}

criterion_group!(benches, samples);
criterion_main!(benches);
