//! What the plant costs in each regime and way of stepping, and how that compares with the closed form and Brent's method in the same run.
//!
//! ```text
//! cargo bench --bench plant
//! ```
//!
//! Absolute times depend on the machine and on what else it does; the ratios in the table at the end hardly do. The table has medians
//! of equal numbers of runs that take turns. CONTRIBUTING.md tells which ratios a change must keep.

mod baseline;
mod scene;

use std::hint::black_box;
use std::time::{Duration, Instant};

use criterion::{Criterion, Throughput};
use scene::{PERIODS, SAMPLES, Scene, chatter, lock, nothing, quiet, sensors, settled, states};

/// Seconds for the table.
const TABLE: Duration = Duration::from_secs(5);

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
        "",
        Box::new(move || at_lock.follow(PERIODS, period, states)),
        Some(Box::new(by_period)),
    );
    // What a new plant computes once counts less.
    add(
        "the same, ten times as long",
        "impact",
        "70 ns",
        Box::new(move || at_lock.follow(10 * PERIODS, period, states)),
        None,
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
