//! Impacts: what each keeps, and what a million without loss add up to.

use crate::common::scene;
use crate::random::draw;
use crate::table::Table;
use lovines::{Drive, Parameters, Plant, State};
use proptest::prelude::*;
use rayon::prelude::*;

const MASS_RATIOS: [f64; 7] = [1e-6, 1e-5, 1e-4, 0.0084, 0.1, 0.3, 1.0];

/// Elastic impacts, no damping, nothing drives: the energy is to stay.
fn conservative(epsilon: f64, impacts: u64) -> f64 {
    let parameters = Parameters { damping: 0.0, ..Parameters::dimensionless(epsilon, 0.0, 1.0) };
    let start = State { q1: 0.4, dq1: 0.1, q2: 0.2, dq2: -1.1 };
    let mut plant = Plant::new(parameters, start).unwrap();
    let at_start = plant.energy(0.0);
    let mut worst = 0.0f64;
    while plant.totals().impacts < impacts {
        plant.advance(Drive::default(), 100.0).unwrap();
        let energy = plant.energy(0.0) + plant.totals().dissipated;
        worst = worst.max((energy - at_start).abs() / at_start);
    }
    worst
}

/// What an impact at the very start misses, relative to what there is of it: momentum, Newton's law, energy.
fn missed(p: Parameters, velocities: (f64, f64)) -> [f64; 3] {
    let (v1, v2) = velocities;
    let approach = v1 - v2;
    let start = State {
        dq1: v1,
        q2: -p.half_width.copysign(approach),
        dq2: v2,
        ..State::default()
    };
    let mut plant = Plant::new(p, start).expect("a scene that makes sense");
    let before = plant.energy(0.0);
    plant.advance(Drive::default(), 0.0).unwrap();
    assert_eq!(plant.totals().impacts, 1);
    let after = plant.state();
    let (m1, m2) = (p.primary_mass, p.particle_mass);
    let momentum = m1 * (after.dq1 - v1) + m2 * (after.dq2 - v2);
    let law = (after.dq1 - after.dq2) + p.restitution * approach;
    let energy = plant.energy(0.0) + plant.totals().dissipated - before;
    [
        momentum / (m1 * v1.abs() + m2 * v2.abs()),
        law / (v1.abs() + v2.abs()),
        energy / before,
    ]
    .map(f64::abs)
}

pub fn one_by_one(n: usize, table: &mut Table) {
    let worst = (0..n)
        .into_par_iter()
        .map_init(
            || (scene(false), -2.0..2.0f64, -2.0..2.0f64).boxed(),
            |strategy, number| {
                let (s, v1, v2) = draw(strategy, number);
                missed(s.parameters, (v1, v2))
            },
        )
        .reduce(|| [0.0; 3], |a, b| core::array::from_fn(|k| a[k].max(b[k])));
    let what = [
        "momentum that an impact misses, relative",
        "what Newton's law misses, relative",
        "energy and dissipated energy miss at an impact, relative",
    ];
    for (what, worst) in what.iter().zip(worst) {
        table.row(what, &format!("{n} impacts"), worst, 2e-15);
    }
    table.progress("impacts one by one");
}

pub fn drift(impacts: u64, table: &mut Table) {
    let drifts: Vec<_> = (MASS_RATIOS.par_iter())
        .map(|&epsilon| conservative(epsilon, impacts))
        .collect();
    for (epsilon, drift) in MASS_RATIOS.iter().zip(drifts) {
        table.row(
            &format!("r = 1, c = 0, mass ratio {epsilon}: energy drifts by, relative"),
            &format!("{impacts} impacts"),
            drift,
            1e-12,
        );
    }
    table.progress("elastic impacts");
}
