//! What the plant costs in each regime and way of stepping, and how that compares with the closed form and Brent's method in the same run.
//!
//! ```text
//! cargo bench --bench plant
//! ```
//!
//! Absolute times depend on the machine and on what else it does; the ratios in the table at the end hardly do: plant and baseline take
//! short turns. The table has medians over the pairs of turns. CONTRIBUTING.md tells which ratios a change must keep.

mod baseline;
mod scene;
mod turns;

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

/// Quartiles: the lower one, the median, the upper one.
fn quartiles(mut values: Vec<f64>) -> [f64; 3] {
    values.sort_by(f64::total_cmp);
    [1, 2, 3].map(|n| values[n * (values.len() - 1) / 4])
}

/// Nanoseconds and units of work of a run; none if it came to no end.
fn timed(run: impl Fn() -> Option<u64>) -> Result<(f64, f64), ()> {
    let start = Instant::now();
    let work = black_box(run()).ok_or(())?;
    Ok((start.elapsed().as_nanos() as f64, work as f64))
}

/// The table: every case takes its turn, and in it the plant and the baseline take theirs.
fn table(cases: &[Case]) {
    let mut pairs = vec![Vec::new(); cases.len()];
    let began = Instant::now();
    for n in 0.. {
        if n >= 5 && began.elapsed() >= TABLE {
            break;
        }
        for (case, pairs) in cases.iter().zip(&mut pairs) {
            let mut plant = || timed(|| Some((case.run)()));
            let brent = case
                .brent
                .as_ref()
                .and_then(|run| turns::pair(n, &mut plant, &mut || timed(run)).ok());
            pairs.push(brent.unwrap_or_else(|| [turns::turn(&mut plant).unwrap_or(f64::NAN), f64::NAN]));
        }
    }
    let of = |pairs: &[[f64; 2]], value: fn(&[f64; 2]) -> f64| quartiles(pairs.iter().map(value).collect());
    let lock = cases.iter().position(|case| case.name == LOCK);
    let lock = of(&pairs[lock.expect("the case of the lock")], |pair| pair[0])[1];
    println!(
        "\nMedians of {} pairs of turns each; a lock is the cost of an impact in `{LOCK}`.",
        pairs[0].len()
    );
    println!(
        "{:70} {:>10} {:>8} {:>10} {:>12} {:>16}  accepted",
        "case", "ns", "locks", "Brent ns", "Brent/plant", "quartiles"
    );
    for (case, pairs) in cases.iter().zip(&pairs) {
        let ns = of(pairs, |pair| pair[0])[1];
        let brent = of(pairs, |pair| pair[1])[1];
        let [low, ratio, high] = of(pairs, |pair| pair[1] / pair[0]);
        let compared = match &case.brent {
            Some(_) if brent.is_nan() => ["stalls".to_owned(), "-".to_owned(), "-".to_owned()],
            Some(_) => [
                format!("{brent:.1}"),
                format!("{ratio:.2}"),
                format!("{low:.2} to {high:.2}"),
            ],
            None => ["-", "-", "-"].map(str::to_owned),
        };
        println!(
            "{:70} {ns:10.1} {:8.2} {:>10} {:>12} {:>16}  {}",
            format!("{}, per {}", case.name, case.unit),
            ns / lock,
            compared[0],
            compared[1],
            compared[2],
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
