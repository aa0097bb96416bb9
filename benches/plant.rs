//! What the plant costs, and how that compares with the closed form and Brent's method in the same run.
//!
//! ```text
//! cargo bench --bench plant
//! ```
//!
//! Absolute times depend on the machine and on what else it does; the ratios at the end hardly do. They are of the least
//! times of many short runs that take turns. CONTRIBUTING.md tells which ratios a change must keep.

mod baseline;

use core::f64::consts::TAU;
use std::hint::black_box;
use std::time::{Duration, Instant};

use baseline::{Baseline, Rig};
use criterion::{Criterion, Throughput};
use lovines::{Drive, Parameters, Plant, State};

/// A rig, its start and its drive.
#[derive(Clone, Copy)]
struct Scene {
    parameters: Parameters,
    start: [f64; 4],
    amplitude: f64,
    omega: f64,
}

/// The steady 1:1 motion of the default scene, dimensionless.
fn steady() -> Scene {
    Scene {
        parameters: Parameters::dimensionless(0.0084, 1.43, 0.65),
        start: [-0.438_371_55, 0.007_696_65, -1.003_854_15, -0.878_123_25],
        amplitude: 0.0084 * 1.1,
        omega: 0.990_417,
    }
}

/// The same rig, with a particle so slow that it meets no wall in a thousand periods.
fn quiet() -> Scene {
    Scene {
        start: [0.0, 0.0, 0.0, 1e-6],
        amplitude: 1e-3,
        ..steady()
    }
}

/// A chatter into sticking and out of it.
fn chatter() -> Scene {
    Scene {
        parameters: Parameters::dimensionless(0.05, 1.0, 0.4),
        start: [0.1, 0.0, 0.1, 0.3],
        amplitude: 1.5,
        omega: 0.6,
    }
}

impl Scene {
    fn plant(&self) -> Plant {
        let [q1, dq1, q2, dq2] = self.start;
        let start = State { q1, dq1, q2, dq2 };
        Plant::new(self.parameters, start).expect("the scene makes sense")
    }

    fn baseline(&self) -> Baseline {
        let p = self.parameters;
        let rig = Rig {
            primary_mass: p.primary_mass,
            stiffness: p.stiffness,
            damping: p.damping,
            particle_mass: p.particle_mass,
            half_width: p.half_width,
            restitution: p.restitution,
        };
        Baseline::new(rig, self.start, 1e-12)
    }

    /// So many periods in so many steps each; `read` after every step. The impacts met.
    fn follow(&self, periods: usize, steps: f64, read: impl Fn(&Plant)) -> u64 {
        let mut plant = self.plant();
        let drive = Drive::harmonic(self.amplitude, self.omega);
        let step = TAU / self.omega / steps;
        for _ in 0..(periods as f64 * steps) as usize {
            plant.advance(black_box(drive), step).unwrap();
            read(&plant);
        }
        states(&plant);
        plant.totals().impacts
    }

    /// The same by the baseline.
    fn compare(&self, periods: usize, steps: f64) -> u64 {
        let mut baseline = self.baseline();
        let step = TAU / self.omega / steps;
        for _ in 0..(periods as f64 * steps) as usize {
            baseline
                .advance(black_box(self.amplitude), self.omega, step)
                .expect("nothing sticks here");
        }
        baseline.impacts
    }
}

fn sensors(plant: &Plant) {
    black_box((plant.centre(), plant.base_displacement()));
}

fn states(plant: &Plant) {
    black_box(plant.state());
}

/// What is measured: its name, how much work one run is and of what, and the run.
type Case = (&'static str, u64, &'static str, fn() -> u64);

const PERIODS: usize = 100;

const CASES: &[Case] = &[
    (
        "baseline, steady 1:1, a step per period",
        2 * PERIODS as u64,
        "impact",
        || steady().compare(PERIODS, 1.0),
    ),
    (
        "steady 1:1, a step per period, read at the end",
        2 * PERIODS as u64,
        "impact",
        || steady().follow(PERIODS, 1.0, |_| {}),
    ),
    (
        "steady 1:1, a step per period",
        2 * PERIODS as u64,
        "impact",
        || steady().follow(PERIODS, 1.0, states),
    ),
    (
        "steady 1:1, one long step",
        2 * PERIODS as u64,
        "impact",
        || steady().follow(PERIODS, 1.0 / PERIODS as f64, states),
    ),
    (
        "steady 1:1, 100 steps per period, v and base read",
        100 * PERIODS as u64,
        "step",
        || steady().follow(PERIODS, 100.0, sensors),
    ),
    (
        "baseline, no impact, 100 steps per period",
        100 * PERIODS as u64,
        "step",
        || quiet().compare(PERIODS, 100.0),
    ),
    (
        "no impact, 100 steps per period, v and base read",
        100 * PERIODS as u64,
        "step",
        || quiet().follow(PERIODS, 100.0, sensors),
    ),
    (
        "chatter into sticking and out of it, 20 periods",
        1,
        "run",
        || chatter().follow(20, 1.0, states),
    ),
];

/// Least nanoseconds per unit of work, all cases taking turns.
fn least() -> Vec<f64> {
    let mut least = vec![f64::INFINITY; CASES.len()];
    let began = Instant::now();
    while began.elapsed() < Duration::from_secs(2) {
        for (best, (_, work, _, run)) in least.iter_mut().zip(CASES) {
            let start = Instant::now();
            black_box(run());
            *best = best.min(start.elapsed().as_nanos() as f64 / *work as f64);
        }
    }
    least
}

fn ratios() {
    let least = least();
    let per = |name: &str| {
        let at = CASES.iter().position(|case| case.0 == name);
        least[at.expect("a case")]
    };
    println!(
        "\nLeast times of runs that take turns, and the ratio to the closed form with Brent's method:"
    );
    let impact = per("baseline, steady 1:1, a step per period");
    let step = per("baseline, no impact, 100 steps per period");
    for ((name, _, unit, _), ns) in CASES.iter().zip(&least) {
        let ratio = match *unit {
            "impact" => format!("{:8.2} times as fast", impact / ns),
            "step" => format!("{:8.2} times as fast", step / ns),
            _ => format!("{:8.2} baseline impacts", ns / impact),
        };
        println!("{name:52} {ns:10.1} ns per {unit:6} {ratio}");
    }
}

fn main() {
    let mut criterion = Criterion::default().configure_from_args();
    let mut group = criterion.benchmark_group("plant");
    for (name, work, _, run) in CASES {
        group.throughput(Throughput::Elements(*work));
        group.bench_function(*name, |b| b.iter(run));
    }
    group.finish();
    criterion.final_summary();
    // `cargo test --benches` only wants to see each run once.
    if std::env::args().any(|argument| argument == "--bench") {
        ratios();
    }
}
