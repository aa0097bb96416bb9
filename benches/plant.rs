//! What the plant costs in each regime and way of stepping, and how that compares with the closed form and Brent's method in the same run.
//!
//! ```text
//! cargo bench --bench plant
//! ```
//!
//! Absolute times depend on the machine and on what else it does; the ratios in the table at the end hardly do. The table has medians
//! of equal numbers of runs that take turns. CONTRIBUTING.md tells which ratios a change must keep.

mod baseline;

use core::f64::consts::TAU;
use std::hint::black_box;
use std::time::{Duration, Instant};

use baseline::{Baseline, Rig};
use criterion::{Criterion, Throughput};
use lovines::{Drive, Parameters, Plant, State};

const EPSILON: f64 = 0.0084;
/// Periods of a run.
const PERIODS: usize = 100;
/// Samples per period where the plant is sampled.
const SAMPLES: usize = 100;
/// Seconds for the table.
const TABLE: Duration = Duration::from_secs(5);

/// A rig, its start and its drive.
#[derive(Clone, Copy)]
struct Scene {
    parameters: Parameters,
    start: [f64; 4],
    amplitude: f64,
    omega: f64,
}

fn default_rig() -> Parameters {
    Parameters::dimensionless(EPSILON, 1.43, 0.65)
}

/// The steady 1:1 motion of the default scene, dimensionless.
fn lock() -> Scene {
    Scene {
        parameters: default_rig(),
        start: [-0.438_371_55, 0.007_696_65, -1.003_854_15, -0.878_123_25],
        amplitude: EPSILON * 1.1,
        omega: 0.990_417,
    }
}

/// The same rig, with a particle so slow that it meets no wall in a thousand periods.
fn quiet() -> Scene {
    Scene { start: [0.0, 0.0, 0.0, 1e-6], amplitude: 1e-3, ..lock() }
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

/// The default rig at a detuning and a base amplitude over `b epsilon`, after a thousand periods.
fn settled(sigma: f64, g: f64) -> Scene {
    let scene = Scene {
        start: [0.0, 0.0, 0.0, 0.9],
        amplitude: EPSILON * g,
        omega: 1.0 + EPSILON * sigma,
        ..lock()
    };
    let mut plant = scene.plant();
    plant.advance(scene.drive(), 1000.0 * scene.period()).unwrap();
    let s = plant.state();
    Scene { start: [s.q1, s.dq1, s.q2, s.dq2], ..scene }
}

impl Scene {
    fn drive(&self) -> Drive {
        Drive::harmonic(self.amplitude, self.omega)
    }

    fn period(&self) -> f64 {
        TAU / self.omega
    }

    fn plant(&self) -> Plant {
        let [q1, dq1, q2, dq2] = self.start;
        let start = State { q1, dq1, q2, dq2 };
        let mut plant = Plant::new(self.parameters, start).expect("a valid scene");
        plant.begin(self.drive()).unwrap();
        plant
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

    /// So many equal steps; `read` after each. The impacts met.
    fn follow(&self, steps: usize, step: f64, read: fn(&Plant)) -> u64 {
        let mut plant = self.plant();
        let drive = self.drive();
        for _ in 0..steps {
            plant.advance(black_box(drive), step).unwrap();
            read(&plant);
        }
        states(&plant);
        plant.totals().impacts
    }

    /// The same by the baseline; none if it stalls.
    fn compare(&self, steps: usize, step: f64) -> Option<u64> {
        let mut baseline = self.baseline();
        for _ in 0..steps {
            baseline.advance(black_box(self.amplitude), self.omega, step).ok()?;
            black_box((baseline.q1, baseline.q2));
        }
        Some(baseline.impacts)
    }

    /// The drives of a hundred samples per period.
    fn drives(&self, drive: fn(&Self, usize) -> Drive) -> Vec<Drive> {
        (0..PERIODS * SAMPLES).map(|n| drive(self, n)).collect()
    }

    /// A hundred samples per period, each with a drive of its own; v and the base displacement are read. The samples.
    fn sampled(&self, drives: &[Drive]) -> u64 {
        let mut plant = self.plant();
        let step = self.period() / SAMPLES as f64;
        for drive in drives {
            plant.advance(black_box(*drive), step).unwrap();
            sensors(&plant);
        }
        drives.len() as u64
    }

    /// The same by the baseline, which takes a drive of the built-in oscillator only; none if it stalls.
    fn compare_sampled(&self, drives: &[Drive]) -> Option<u64> {
        let mut baseline = self.baseline();
        let step = self.period() / SAMPLES as f64;
        for drive in drives {
            baseline.advance(black_box(drive.amplitude), drive.omega, step).ok()?;
            black_box((baseline.q1, baseline.q2));
        }
        Some(drives.len() as u64)
    }

    /// Amplitude and frequency of sample `n`, as a phase-locked loop near its lock changes them.
    fn retuned(&self, n: usize) -> Drive {
        let small = 1e-5 * ((n as f64 * 0.618_033_988_749_895).fract() - 0.5);
        Drive::harmonic(self.amplitude * (1.0 + small), self.omega * (1.0 + small))
    }

    /// The base displacement at sample `n`.
    fn sample(&self, n: usize) -> f64 {
        self.amplitude * (TAU * (n % SAMPLES) as f64 / SAMPLES as f64).sin()
    }

    /// The sample held on the input `e`.
    fn held(&self, n: usize) -> Drive {
        Drive::held(self.sample(n))
    }

    /// The sample on the input `e` with the slope towards the next one.
    fn sloped(&self, n: usize) -> Drive {
        let slope = (self.sample(n + 1) - self.sample(n)) * SAMPLES as f64 / self.period();
        Drive {
            signal: [self.sample(n), slope, 0.0, 0.0],
            ..Drive::default()
        }
    }
}

fn nothing(_: &Plant) {}

fn sensors(plant: &Plant) {
    black_box((plant.centre(), plant.base_displacement()));
}

fn states(plant: &Plant) {
    black_box(plant.state());
}

/// A run of the baseline: how much work it was, or none if it stalled.
type Brent = Box<dyn Fn() -> Option<u64>>;

/// What is measured; each run returns how much work it was.
struct Case {
    name: String,
    unit: &'static str,
    run: Box<dyn Fn() -> u64>,
    /// The closed form with Brent's method on the same work.
    brent: Option<Brent>,
    /// What the table says of the largest cost that is accepted.
    target: &'static str,
}

/// Name of the case that the ratios refer to.
const LOCK: &str = "default lock, one long step";

fn cases() -> Vec<Case> {
    let mut cases = Vec::new();
    let mut add = |name: &str, unit, target, run: Box<dyn Fn() -> u64>, brent: Option<Brent>| {
        cases.push(Case { name: name.to_owned(), unit, run, brent, target });
    };
    let long = |scene: Scene| -> Box<dyn Fn() -> u64> {
        Box::new(move || scene.follow(1, PERIODS as f64 * scene.period(), states))
    };
    let long_brent =
        |scene: Scene| -> Option<Brent> { Some(Box::new(move || scene.compare(1, PERIODS as f64 * scene.period()))) };
    let (at_lock, empty) = (lock(), quiet());
    let period = at_lock.period();
    add(LOCK, "impact", "", long(at_lock), long_brent(at_lock));
    let by_period = move || at_lock.compare(PERIODS, period);
    add(
        "default lock, a step per period, read at the end",
        "impact",
        "",
        Box::new(move || at_lock.follow(PERIODS, period, nothing)),
        Some(Box::new(by_period)),
    );
    add(
        "default lock, a step per period, state read after each",
        "impact",
        "70 ns",
        Box::new(move || at_lock.follow(PERIODS, period, states)),
        Some(Box::new(by_period)),
    );
    for g in [1.2, 1.5] {
        for sigma in [-0.5, 0.0, 1.0] {
            let scene = settled(sigma, g);
            let name = format!("symmetric 1:1, sigma = {sigma}, G = {g}, one long step");
            add(&name, "impact", "1.5 locks", long(scene), long_brent(scene));
        }
    }
    for (what, sigma, g) in [
        ("asymmetric 1:1, sigma = -1.14, G = 1.5", -1.14, 1.5),
        ("three impacts per period, sigma = 0, G = 2.5", 0.0, 2.5),
        ("chaotic, sigma = -1, G = 2.6", -1.0, 2.6),
        ("modulated, sigma = 0, G = 0.8", 0.0, 0.8),
    ] {
        let scene = settled(sigma, g);
        let name = format!("{what}, one long step");
        add(&name, "impact", "4 locks", long(scene), long_brent(scene));
    }
    let (sample, samples) = (period / SAMPLES as f64, PERIODS * SAMPLES);
    let count = move |_impacts: u64| samples as u64;
    // Computed before anything is timed.
    let [retuned, held, sloped] = [Scene::retuned, Scene::held, Scene::sloped].map(|one| at_lock.drives(one));
    let same = retuned.clone();
    add(
        "default lock, 100 samples per period",
        "sample",
        "",
        Box::new(move || count(at_lock.follow(samples, sample, sensors))),
        Some(Box::new(move || at_lock.compare(samples, sample).map(count))),
    );
    add(
        "no impact, 100 samples per period",
        "sample",
        "",
        Box::new(move || count(empty.follow(samples, sample, sensors))),
        Some(Box::new(move || empty.compare(samples, sample).map(count))),
    );
    add(
        "omega and E change at every sample",
        "sample",
        "45 ns",
        Box::new(move || at_lock.sampled(&retuned)),
        Some(Box::new(move || at_lock.compare_sampled(&same))),
    );
    add(
        "held sample on e, new at every sample",
        "sample",
        "45 ns",
        Box::new(move || at_lock.sampled(&held)),
        None,
    );
    add(
        "sloped sample on e, new at every sample",
        "sample",
        "45 ns",
        Box::new(move || at_lock.sampled(&sloped)),
        None,
    );
    for step in [5e-4, 1e-4, 1e-6] {
        let steps = 10_000;
        add(
            &format!("default lock, steps of {step:e} rad"),
            "step",
            "25 ns",
            Box::new(move || {
                at_lock.follow(steps, step, sensors);
                steps as u64
            }),
            Some(Box::new(move || {
                at_lock.compare(steps, step)?;
                Some(steps as u64)
            })),
        );
    }
    add(
        "chatter into sticking and out of it, 20 periods",
        "run",
        "",
        Box::new(|| {
            chatter().follow(20, chatter().period(), states);
            1
        }),
        None,
    );
    cases
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// ns per unit of work; none if the run came to no end.
fn timed(run: impl Fn() -> Option<u64>) -> Option<f64> {
    let start = Instant::now();
    let work = black_box(run())?;
    Some(start.elapsed().as_nanos() as f64 / work as f64)
}

/// The table: every case takes its turn, and so does the baseline.
fn table(cases: &[Case]) {
    let mut plant = vec![Vec::new(); cases.len()];
    let mut brent = vec![Vec::new(); cases.len()];
    let began = Instant::now();
    while plant[0].len() < 5 || began.elapsed() < TABLE {
        for (n, case) in cases.iter().enumerate() {
            plant[n].extend(timed(|| Some((case.run)())));
            if let Some(run) = &case.brent {
                brent[n].extend(timed(run));
            }
        }
    }
    let runs = plant[0].len();
    let plant: Vec<f64> = plant.into_iter().map(median).collect();
    let lock = cases.iter().position(|case| case.name == LOCK);
    let lock = plant[lock.expect("the case of the lock")];
    println!("\nMedians of {runs} runs each, taking turns; a lock is the cost of an impact in `{LOCK}`.");
    println!(
        "{:70} {:>10} {:>8} {:>10} {:>12}  accepted",
        "case", "ns", "locks", "Brent ns", "Brent/plant"
    );
    for ((case, ns), brent) in cases.iter().zip(plant).zip(brent) {
        let (brent, ratio) = if brent.is_empty() {
            let why = case.brent.as_ref().map_or("-", |_| "stalls");
            (why.to_owned(), "-".to_owned())
        } else {
            let brent = median(brent);
            (format!("{brent:.1}"), format!("{:.2}", brent / ns))
        };
        println!(
            "{:70} {ns:10.1} {:8.2} {brent:>10} {ratio:>12}  {}",
            format!("{}, per {}", case.name, case.unit),
            ns / lock,
            case.target,
        );
    }
}

fn main() {
    let cases = cases();
    let mut criterion = Criterion::default()
        .warm_up_time(Duration::from_millis(500))
        .measurement_time(Duration::from_secs(2))
        .configure_from_args();
    let mut group = criterion.benchmark_group("plant");
    for case in &cases {
        group.throughput(Throughput::Elements((case.run)()));
        group.bench_function(&case.name, |b| b.iter(&case.run));
    }
    group.finish();
    criterion.final_summary();
    // `cargo test --benches` only wants to see each run once.
    if std::env::args().any(|argument| argument == "--bench") {
        table(&cases);
    }
}
