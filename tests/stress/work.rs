//! Work per natural period at extreme values.

use crate::table::Table;
use lovines::{Drive, Parameters, Plant, State};
use rayon::prelude::*;
use std::f64::consts::TAU;
use std::hint::black_box;
use std::time::{Duration, Instant};

/// Evaluations that are accepted per impact, drive cycle or natural period, whichever are the most in a natural period.
const MOST_EVALUATIONS: f64 = 100.0;

const DAMPING_RATIOS: [f64; 15] = [
    0.0, 1e-12, 1e-6, 1e-3, 1e-2, 0.1, 0.5, 1.0, 2.0, 10.0, 1e2, 1e3, 1e4, 1e5, 1e6,
];
/// Amplitudes of the base, half-widths; frequencies, omega0.
const AMPLITUDES: [f64; 6] = [0.0, 1e-3, 0.1, 1.0, 30.0, 1e3];
const FREQUENCIES: [f64; 9] = [1e-3, 0.03, 0.3, 1.0, 1.7, 10.0, 30.0, 300.0, 1e3];
/// Steps that each drive is followed for; fewer once so many impacts or so much time have passed. A step is a natural period, or
/// [`CYCLES`] of the drive where those are shorter: the work is then scaled to a natural period.
const STEPS: u32 = 20;
const CYCLES: f64 = 10.0;
const ENOUGH_IMPACTS: u64 = 100_000;
const ENOUGH_TIME: Duration = Duration::from_millis(200);

/// The hardest natural period of a drive.
#[derive(Clone, Copy, Debug, Default)]
struct Hardest {
    amplitude: f64,
    ratio: f64,
    impacts: f64,
    ns: f64,
    evaluations: f64,
    /// Evaluations per impact, drive cycle or natural period, whichever are the most in that period.
    per_unit: f64,
}

impl Hardest {
    fn or(self, other: Self) -> Self {
        let more = if other.evaluations > self.evaluations {
            other
        } else {
            self
        };
        Self { per_unit: self.per_unit.max(other.per_unit), ..more }
    }
}

fn rig(zeta: f64) -> Parameters {
    Parameters {
        damping: 2.0 * zeta,
        ..Parameters::dimensionless(0.0084, 1.0, 0.65)
    }
}

fn hardest(zeta: f64, amplitude: f64, ratio: f64) -> Hardest {
    let start = State { q1: 0.1, q2: -0.2, dq2: 0.9, ..State::default() };
    let mut plant = Plant::new(rig(zeta), start).expect("valid values");
    let drive = Drive::harmonic(amplitude, ratio);
    plant.begin(drive).expect("valid values");
    let mut worst = Hardest::default();
    let (began, mut impacts) = (Instant::now(), 0);
    let steps_per_period = (ratio / CYCLES).max(1.0);
    for _ in 0..STEPS {
        let before = Instant::now();
        let outcome = plant.advance(drive, TAU / steps_per_period).expect("valid values");
        black_box(plant.state());
        let ns = before.elapsed().as_nanos() as f64 * steps_per_period;
        let in_a_period = outcome.impacts as f64 * steps_per_period;
        let units = in_a_period.max(ratio).max(1.0);
        let evaluations = outcome.evaluations as f64 * steps_per_period;
        worst = worst.or(Hardest {
            amplitude,
            ratio,
            impacts: in_a_period,
            ns,
            evaluations,
            per_unit: evaluations / units,
        });
        impacts += outcome.impacts;
        if impacts > ENOUGH_IMPACTS || began.elapsed() > ENOUGH_TIME {
            break;
        }
    }
    worst
}

/// The hardest natural period for each damping ratio, over all drives; some of them in the short form.
pub fn sweep(long: bool, table: &mut Table) {
    let every = if long { 1 } else { 4 };
    let mut rows = Vec::new();
    for zeta in DAMPING_RATIOS {
        let drives: Vec<(f64, f64)> = (AMPLITUDES.iter())
            .flat_map(|&amplitude| FREQUENCIES.map(|ratio| (amplitude, ratio)))
            .step_by(every)
            .collect();
        let worst = (drives
            .par_iter()
            .map(|&(amplitude, ratio)| hardest(zeta, amplitude, ratio)))
        .reduce(Hardest::default, Hardest::or);
        rows.push((zeta, drives.len(), worst));
        table.progress(&format!("work at damping ratio {zeta}"));
    }
    let lines: Vec<String> = (rows.iter())
        .map(|(zeta, drives, w)| {
            format!(
                "| {zeta:e} | {drives} | E = {:e} b, omega = {:e} omega0 | {:.0} | {:.1} | {:.0} | {:.1} |",
                w.amplitude,
                w.ratio,
                w.impacts,
                1e-3 * w.ns,
                w.evaluations,
                w.per_unit,
            )
        })
        .collect();
    table.second(
        "Work in a natural period, at most, over all drives of a damping ratio. Per unit: per impact, drive cycle or \
         natural period, whichever are the most.",
        "| damping ratio | drives | hardest drive | impacts | µs | evaluations | evaluations per unit |",
        &lines,
    );
    for (zeta, drives, worst) in rows {
        table.row(
            &format!("damping ratio {zeta:e}: evaluations per impact, drive cycle or natural period"),
            &format!("{drives} drives"),
            worst.per_unit,
            MOST_EVALUATIONS,
        );
    }
}
