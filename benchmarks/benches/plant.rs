//! What the plant costs in each regime and way of stepping, and how that compares with the closed form and Brent's method in the same run.
//!
//! ```text
//! cargo bench -p vines-benchmarks
//! ```
//!
//! Absolute times depend on the machine and on what else it does; the ratios in the table at the end hardly do: plant and baseline take short
//! turns. The table has medians over the pairs of turns. CONTRIBUTING.md says which ratios a change must keep.

use std::f64::consts::TAU;
use std::time::{Duration, Instant};

use lovines::{Drive, Parameters};
use vines_benchmarks::baseline::Baseline;
use vines_benchmarks::method::{Stepped, begin, measure};
use vines_benchmarks::scene::{Scene, Step};

/// Duration of the measurement, and of the turns of a case in each round.
const DURATION: Duration = Duration::from_secs(10);
const ROUND: Duration = Duration::from_millis(6);
/// A run of the baseline that lasts longer is given up.
const LIMIT: Duration = Duration::from_secs(10);
const EPSILON: f64 = 0.0084;
/// Periods of a run, and samples per period where the plant is sampled.
const PERIODS: usize = 100;
const SAMPLES: usize = 100;

/// What is measured: steps of a scene.
struct Case {
    name: String,
    /// Unit of the costs.
    unit: &'static str,
    scene: Scene,
    /// Largest cost that is accepted.
    accepted: &'static str,
    /// Nanoseconds per run of plant and baseline.
    pairs: Vec<[f64; 2]>,
    /// Units of work in a run.
    work: f64,
}

/// The default rig, dimensionless, from `start` under the drive of `G` = `g` at the frequency `omega`, for one period.
fn period(start: [f64; 4], g: f64, omega: f64) -> Scene {
    let step = Step {
        drive: Drive::harmonic(EPSILON * g, omega),
        duration: TAU / omega,
    };
    let parameters = Parameters::dimensionless(EPSILON, 1.43, 0.65);
    Scene { parameters, start: start.into(), steps: vec![step] }
}

/// The default rig at a detuning and a base amplitude over `b epsilon`, after a thousand periods.
fn settled(sigma: f64, g: f64) -> Scene {
    let scene = period([0.0, 0.0, 0.0, 0.9], g, 1.0 + EPSILON * sigma);
    let Step { drive, duration } = scene.steps[0];
    let mut plant = begin(&scene).expect("a valid scene");
    plant.advance(drive, 1000.0 * duration).expect("a valid step");
    Scene { start: plant.state(), ..scene }
}

impl Case {
    /// A number of steps, each of `part` times the scene's only one and changed by `change`.
    fn new(
        (name, unit, accepted): (&str, &'static str, &'static str),
        scene: &Scene,
        (count, part): (usize, f64),
        change: impl Fn(usize, &mut Step),
    ) -> Self {
        let step = |n: usize| {
            let mut step = scene.steps[0];
            step.duration *= part;
            change(n, &mut step);
            step
        };
        let scene = Scene { steps: (0..count).map(step).collect(), ..scene.clone() };
        Self {
            name: name.to_owned(),
            unit,
            scene,
            accepted,
            pairs: Vec::new(),
            work: f64::NAN,
        }
    }

    fn long(name: &str, accepted: &'static str, scene: &Scene) -> Self {
        let name = format!("{name}, one long step");
        Self::new((&name, "impact", accepted), scene, (1, PERIODS as f64), |_, _| ())
    }

    fn sampled(name: &str, accepted: &'static str, scene: &Scene, change: impl Fn(usize, &mut Step)) -> Self {
        let steps = (PERIODS * SAMPLES, 1.0 / SAMPLES as f64);
        Self::new((name, "sample", accepted), scene, steps, change)
    }
}

fn cases() -> Vec<Case> {
    let at_lock = [-0.438_371_55, 0.007_696_65, -1.003_854_15, -0.878_123_25];
    let lock = &period(at_lock, 1.1, 0.990_417);
    // A particle so slow that it meets no wall in a thousand periods.
    let quiet = period([0.0, 0.0, 0.0, 1e-6], 0.12, 0.990_417);
    let each_period = ("default lock, a step per period", "impact", "");
    let longer = ("the same, ten times as long", "impact", "70 ns");
    let mut cases = vec![
        // The first case is the unit of the others.
        Case::long("default lock", "", lock),
        Case::new(each_period, lock, (PERIODS, 1.0), |_, _| ()),
        // What a new plant computes once counts less.
        Case::new(longer, lock, (10 * PERIODS, 1.0), |_, _| ()),
        Case::sampled("default lock, 100 samples per period", "", lock, |_, _| ()),
        Case::sampled("no impact, 100 samples per period", "", &quiet, |_, _| ()),
    ];
    for (regime, accepted, sigma, g) in [
        ("symmetric 1:1", "1.5 locks", -0.5, 1.2),
        ("symmetric 1:1", "1.5 locks", 0.0, 1.2),
        ("symmetric 1:1", "1.5 locks", 1.0, 1.2),
        ("symmetric 1:1", "1.5 locks", -0.5, 1.5),
        ("symmetric 1:1", "1.5 locks", 0.0, 1.5),
        ("symmetric 1:1", "1.5 locks", 1.0, 1.5),
        ("asymmetric 1:1", "4 locks", -1.14, 1.5),
        ("three impacts per period", "4 locks", 0.0, 2.5),
        ("chaotic", "4 locks", -1.0, 2.6),
        ("modulated", "4 locks", 0.0, 0.8),
    ] {
        let name = format!("{regime}, sigma = {sigma}, G = {g}");
        cases.push(Case::long(&name, accepted, &settled(sigma, g)));
    }
    // Amplitude and frequency, as a phase-locked loop near its lock changes them.
    cases.push(Case::sampled(
        "omega and E change at every sample",
        "45 ns",
        lock,
        |n, step| {
            let small = 1e-5 * ((n as f64 * 0.618_033_988_749_895).fract() - 0.5);
            let Drive { amplitude, omega, .. } = step.drive;
            step.drive = Drive::harmonic(amplitude * (1.0 + small), omega * (1.0 + small));
        },
    ));
    // The base displacement as a signal: held from sample to sample, and with the slope towards the next one.
    let amplitude = lock.steps[0].drive.amplitude;
    let sample = |n: usize| amplitude * (TAU * (n % SAMPLES) as f64 / SAMPLES as f64).sin();
    cases.push(Case::sampled(
        "held sample on e, new at every sample",
        "45 ns",
        lock,
        |n, step| {
            step.drive = Drive::held(sample(n));
        },
    ));
    cases.push(Case::sampled(
        "sloped sample on e, new at every sample",
        "45 ns",
        lock,
        |n, step| {
            step.drive = Drive::held(sample(n));
            step.drive.signal[1] = (sample(n + 1) - sample(n)) / step.duration;
        },
    ));
    for step in [5e-4, 1e-4, 1e-6] {
        let name = format!("default lock, steps of {step:e} rad");
        let steps = (10_000, step / lock.steps[0].duration);
        cases.push(Case::new((&name, "step", "25 ns"), lock, steps, |_, _| ()));
    }
    // The baseline stalls there.
    let parameters = Parameters::dimensionless(0.05, 1.0, 0.4);
    let chatter = Scene {
        parameters,
        ..period([0.1, 0.0, 0.1, 0.3], 1.5 / EPSILON, 0.6)
    };
    let name = ("chatter into sticking and out of it", "period", "");
    cases.push(Case::new(name, &chatter, (20, 1.0), |_, _| ()));
    cases
}

/// Quartiles: the lower one, the median, the upper one.
fn quartiles(pairs: &[[f64; 2]], value: impl Fn(&[f64; 2]) -> f64) -> [f64; 3] {
    let mut values: Vec<f64> = pairs.iter().map(value).collect();
    values.sort_by(f64::total_cmp);
    [1, 2, 3].map(|n| values[n * (values.len() - 1) / 4])
}

fn main() {
    let mut cases = cases();
    // `cargo test --benches` only wants to see each run once.
    let measured = u32::from(std::env::args().any(|argument| argument == "--bench"));
    let (duration, round) = (measured * DURATION, measured * ROUND);
    let began = Instant::now();
    while cases[0].pairs.is_empty() || began.elapsed() < duration {
        for Case { scene, pairs, work, unit, .. } in &mut cases {
            let signal = scene.steps.iter().any(|step| step.drive.signal != [0.0; 4]);
            let mut answer = measure::<Baseline>(scene, 1e-12, &[], round, LIMIT);
            if signal || answer.failure.is_some() {
                answer = measure::<Stepped>(scene, 0.0, &[], round, LIMIT);
                answer.ns.fill(f64::NAN);
            }
            let units = [scene.steps.len() as u64, answer.impacts];
            *work = units[usize::from(*unit == "impact")] as f64;
            let both = answer.plant_ns.iter().zip(&answer.ns);
            pairs.extend(both.map(|(plant, brent)| [*plant, *brent]));
        }
    }
    let lock = quartiles(&cases[0].pairs, |pair| pair[0])[1] / cases[0].work;
    let pairs = cases[0].pairs.len();
    println!("Medians of {pairs} pairs of turns each; a lock is the first cost.");
    let [case, ns, locks, brent, ratio] = ["case", "ns", "locks", "Brent ns", "Brent/plant"];
    println!(
        "{case:70} {ns:>10} {locks:>8} {brent:>10} {ratio:>12} {:>16}  accepted",
        "quartiles"
    );
    for Case { name, unit, accepted, pairs, work, .. } in &cases {
        let [ns, brent] = [0, 1].map(|n| quartiles(pairs, |pair| pair[n])[1] / work);
        let [low, ratio, high] = quartiles(pairs, |pair| pair[1] / pair[0]);
        let (name, locks) = (format!("{name}, per {unit}"), ns / lock);
        let quartiles = format!("{low:.2} to {high:.2}");
        let line = format!("{name:70} {ns:10.1} {locks:8.2} {brent:10.1} {ratio:12.2} {quartiles:>16}  {accepted}");
        // No baseline: it takes no signal, and stalls where contacts accumulate.
        println!("{}", line.replace("NaN", "  -"));
    }
}
