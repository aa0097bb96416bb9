//! What a call through the C interface costs: two inputs set, one step, four outputs read, 100 steps a period.

use criterion::{Criterion, criterion_group, criterion_main};
use fmi2_boundary::{Fmu, Master};
use std::hint::black_box;

fn samples(c: &mut Criterion) {
    let plant = Fmu::plant();
    let rig = Master::new(&plant, fmi2_boundary::Interface::CoSimulation);
    // The dimensionless rig of the default scene, at its lock.
    let scene = [
        (0, 1.0),
        (1, 1.0),
        (2, 0.0084 * 1.43),
        (3, 0.0084),
        (4, 1.0),
        (5, 0.65),
        (9, -0.42),
        (10, 0.01),
        (11, -0.99),
        (12, -0.86),
    ];
    for (vr, value) in scene {
        rig.well(rig.set_real(vr, value));
    }
    rig.start();
    let step = std::f64::consts::TAU / 100.0;
    let (inputs, outputs) = ([8, 7], [13, 16, 12, 19]);
    let drive = [0.990_417, 0.0084 * 1.1];
    let mut read = [0.0; 4];
    let mut n = 0u32;
    let f = rig.f;
    let mut group = c.benchmark_group("LoViNes");
    // SAFETY: arrays are as long as they are said to be.
    group.bench_function("two inputs, one step, four outputs", |b| {
        b.iter(|| unsafe {
            (f.fmi2SetReal)(rig.c, inputs.as_ptr(), 2, black_box(&drive).as_ptr());
            (f.fmi2DoStep)(rig.c, f64::from(n) * step, step, 1);
            (f.fmi2GetReal)(rig.c, outputs.as_ptr(), 4, read.as_mut_ptr());
            n += 1;
            black_box(&read);
        });
    });
    group.bench_function("two inputs", |b| {
        b.iter(|| unsafe {
            (f.fmi2SetReal)(rig.c, inputs.as_ptr(), 2, black_box(&drive).as_ptr())
        });
    });
    group.bench_function("four outputs", |b| {
        b.iter(|| unsafe {
            (f.fmi2GetReal)(
                rig.c,
                outputs.as_ptr(),
                4,
                black_box(&mut read).as_mut_ptr(),
            )
        });
    });
    group.bench_function("a step of length zero", |b| {
        b.iter(|| unsafe { (f.fmi2DoStep)(rig.c, f64::from(n) * step, 0.0, 1) });
    });
    group.finish();
}

criterion_group!(benches, samples);
criterion_main!(benches);
