//! What the plant costs in each regime and way of stepping, and how that compares with the closed form and Brent's method in the same run.
//!
//! ```text
//! cargo bench --bench plant
//! ```
//!
//! Absolute times depend on the machine and on what else it does; the ratios hardly do: plant and baseline take short turns. The table has
//! medians over the pairs of turns. CONTRIBUTING.md says which ratios a change must keep.

mod baseline;

use core::f64::consts::TAU;
use std::hint::black_box;
use std::time::{Duration, Instant};

use baseline::Baseline;
use lovines::{Drive, Parameters, Plant, State};

/// Duration of the measurement.
const DURATION: Duration = Duration::from_secs(5);
const EPSILON: f64 = 0.0084;
/// Periods of a run, and samples per period where the plant is sampled.
const PERIODS: usize = 100;
const SAMPLES: usize = 100;

/// A rig, its start and its drive.
#[derive(Clone, Copy)]
struct Scene {
    parameters: Parameters,
    start: [f64; 4],
    amplitude: f64,
    omega: f64,
}

/// The steady 1:1 motion of the default scene, dimensionless.
fn lock() -> Scene {
    Scene {
        parameters: Parameters::dimensionless(EPSILON, 1.43, 0.65),
        start: [-0.438_371_55, 0.007_696_65, -1.003_854_15, -0.878_123_25],
        amplitude: EPSILON * 1.1,
        omega: 0.990_417,
    }
}

/// The default rig at a detuning and a base amplitude over `b epsilon`, after a thousand periods.
fn settled(sigma: f64, g: f64) -> Scene {
    let (start, omega) = ([0.0, 0.0, 0.0, 0.9], 1.0 + EPSILON * sigma);
    let scene = Scene { start, amplitude: EPSILON * g, omega, ..lock() };
    let mut plant = scene.plant();
    plant
        .advance(scene.drive(), 1000.0 * scene.period())
        .expect("a valid step");
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
        let mut plant = Plant::new(self.parameters, State { q1, dq1, q2, dq2 }).expect("a valid scene");
        plant.begin(self.drive()).expect("a valid drive");
        plant
    }

    /// Steps of one length under these drives, each followed by `read`. The impacts met.
    fn follow(&self, drives: impl Iterator<Item = Drive>, step: f64, read: fn(&Plant)) -> u64 {
        let mut plant = self.plant();
        for drive in drives {
            plant.advance(black_box(drive), step).expect("a valid step");
            read(&plant);
        }
        states(&plant);
        plant.totals().impacts
    }

    /// The same by the baseline, which takes a drive of the built-in oscillator only; none if it stalls.
    fn compare(&self, drives: impl Iterator<Item = Drive>, step: f64) -> Option<u64> {
        let mut baseline = Baseline::new(self.parameters, self.start, 1e-12);
        for drive in drives {
            baseline.advance(black_box(drive.amplitude), drive.omega, step).ok()?;
            black_box((baseline.q1, baseline.q2));
        }
        Some(baseline.impacts)
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

/// A run and its units of work; none if it stalls.
type Run = Box<dyn Fn() -> Option<u64>>;

/// What is measured.
struct Case {
    name: String,
    unit: &'static str,
    plant: Run,
    /// The closed form with Brent's method on the same work.
    brent: Option<Run>,
    /// Largest cost that is accepted.
    accepted: &'static str,
}

/// Equal steps, whose work is told in impacts, or in steps where `unit` says so.
fn equal(name: &str, scene: Scene, (steps, step): (usize, f64), unit: &'static str, read: fn(&Plant)) -> Case {
    let work = move |impacts: u64| if unit == "impact" { impacts } else { steps as u64 };
    let drives = move || std::iter::repeat_n(scene.drive(), steps);
    Case {
        name: name.to_owned(),
        unit,
        plant: Box::new(move || Some(work(scene.follow(drives(), step, read)))),
        brent: Some(Box::new(move || scene.compare(drives(), step).map(work))),
        accepted: "",
    }
}

/// A hundred samples per period, each with a drive of its own, which is computed before anything is timed.
fn sampled(name: &str, scene: Scene, drive: fn(&Scene, usize) -> Drive) -> Case {
    let drives: Vec<Drive> = (0..PERIODS * SAMPLES).map(|n| drive(&scene, n)).collect();
    let (same, step, samples) = (drives.clone(), scene.period() / SAMPLES as f64, drives.len() as u64);
    let plant = move || {
        scene.follow(drives.iter().copied(), step, sensors);
        Some(samples)
    };
    Case {
        name: name.to_owned(),
        unit: "sample",
        plant: Box::new(plant),
        brent: Some(Box::new(move || {
            scene.compare(same.iter().copied(), step).map(|_| samples)
        })),
        accepted: "45 ns",
    }
}

fn cases() -> Vec<Case> {
    let at_lock = lock();
    // A particle so slow that it meets no wall in a thousand periods.
    let quiet = Scene { start: [0.0, 0.0, 0.0, 1e-6], amplitude: 1e-3, ..lock() };
    let period = at_lock.period();
    let long = |name: &str, scene: Scene| {
        let name = format!("{name}, one long step");
        equal(&name, scene, (1, PERIODS as f64 * scene.period()), "impact", states)
    };
    let by_sample = (PERIODS * SAMPLES, period / SAMPLES as f64);
    let mut cases = vec![
        // The first case is the unit of the others.
        long("default lock", at_lock),
        equal(
            "default lock, a step per period, read at the end",
            at_lock,
            (PERIODS, period),
            "impact",
            nothing,
        ),
        equal(
            "default lock, a step per period, state read after each",
            at_lock,
            (PERIODS, period),
            "impact",
            states,
        ),
        // What a new plant computes once counts less.
        Case {
            accepted: "70 ns",
            ..equal(
                "the same, ten times as long",
                at_lock,
                (10 * PERIODS, period),
                "impact",
                states,
            )
        },
        equal(
            "default lock, 100 samples per period",
            at_lock,
            by_sample,
            "sample",
            sensors,
        ),
        equal("no impact, 100 samples per period", quiet, by_sample, "sample", sensors),
    ];
    for (regime, sigma, g) in [
        ("symmetric 1:1", -0.5, 1.2),
        ("symmetric 1:1", 0.0, 1.2),
        ("symmetric 1:1", 1.0, 1.2),
        ("symmetric 1:1", -0.5, 1.5),
        ("symmetric 1:1", 0.0, 1.5),
        ("symmetric 1:1", 1.0, 1.5),
        ("asymmetric 1:1", -1.14, 1.5),
        ("three impacts per period", 0.0, 2.5),
        ("chaotic", -1.0, 2.6),
        ("modulated", 0.0, 0.8),
    ] {
        let name = format!("{regime}, sigma = {sigma}, G = {g}");
        let accepted = if regime == "symmetric 1:1" {
            "1.5 locks"
        } else {
            "4 locks"
        };
        cases.push(Case { accepted, ..long(&name, settled(sigma, g)) });
    }
    cases.push(sampled("omega and E change at every sample", at_lock, Scene::retuned));
    for (name, drive) in [
        ("held", Scene::held as fn(&Scene, usize) -> Drive),
        ("sloped", Scene::sloped),
    ] {
        let name = format!("{name} sample on e, new at every sample");
        cases.push(Case { brent: None, ..sampled(&name, at_lock, drive) });
    }
    for step in [5e-4, 1e-4, 1e-6] {
        let name = format!("default lock, steps of {step:e} rad");
        cases.push(Case {
            accepted: "25 ns",
            ..equal(&name, at_lock, (10_000, step), "step", sensors)
        });
    }
    // The baseline stalls there.
    let chatter = Scene {
        parameters: Parameters::dimensionless(0.05, 1.0, 0.4),
        start: [0.1, 0.0, 0.1, 0.3],
        amplitude: 1.5,
        omega: 0.6,
    };
    let name = "chatter into sticking and out of it, 20 periods";
    cases.push(equal(name, chatter, (20, chatter.period()), "period", states));
    cases
}

/// Quartiles: the lower one, the median, the upper one.
fn quartiles(pairs: &[[f64; 2]], value: fn(&[f64; 2]) -> f64) -> [f64; 3] {
    let mut values: Vec<f64> = pairs.iter().map(value).collect();
    values.sort_by(f64::total_cmp);
    [1, 2, 3].map(|n| values[n * (values.len() - 1) / 4])
}

/// Nanoseconds and units of work of a run; an error if it stalls.
fn timed(run: &Run) -> Result<(f64, f64), ()> {
    let start = Instant::now();
    let work = black_box(run()).ok_or(())?;
    Ok((start.elapsed().as_nanos() as f64, work as f64))
}

fn main() {
    let cases = cases();
    // `cargo test --benches` only wants to see each run once.
    let measured = std::env::args().any(|argument| argument == "--bench");
    let duration = if measured { DURATION } else { Duration::ZERO };
    let mut pairs = vec![Vec::new(); cases.len()];
    let began = Instant::now();
    for n in 0.. {
        if n >= 5 && began.elapsed() >= duration {
            break;
        }
        for (case, pairs) in cases.iter().zip(&mut pairs) {
            let mut plant = || timed(&case.plant);
            let both = case
                .brent
                .as_ref()
                .map(|run| baseline::pair(n, &mut plant, &mut || timed(run)));
            let alone = |()| [baseline::turn(&mut || timed(&case.plant)).unwrap_or(f64::NAN), f64::NAN];
            pairs.push(both.unwrap_or(Err(())).unwrap_or_else(alone));
        }
    }
    let lock = quartiles(&pairs[0], |pair| pair[0])[1];
    println!(
        "Medians of {} pairs of turns each; a lock is the first cost.",
        pairs[0].len()
    );
    println!(
        "{:70} {:>10} {:>8} {:>10} {:>12} {:>16}  accepted",
        "case", "ns", "locks", "Brent ns", "Brent/plant", "quartiles"
    );
    for (case, pairs) in cases.iter().zip(&pairs) {
        let [ns, brent] = [quartiles(pairs, |pair| pair[0])[1], quartiles(pairs, |pair| pair[1])[1]];
        let [low, ratio, high] = quartiles(pairs, |pair| pair[1] / pair[0]);
        let name = format!("{}, per {}", case.name, case.unit);
        let quartiles = format!("{low:.2} to {high:.2}");
        println!(
            "{name:70} {ns:10.1} {:8.2} {brent:10.1} {ratio:12.2} {quartiles:>16}  {}",
            ns / lock,
            case.accepted
        );
    }
}
