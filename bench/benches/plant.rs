//! What the plant costs in each regime and way of stepping, and how that compares with the closed form and Brent's method in the same run.
//!
//! ```text
//! cargo bench -p vines-bench
//! ```
//!
//! Absolute times depend on the machine and on what else it does; the ratios in the table at the end hardly do: plant and baseline take short
//! turns. The table has medians over the pairs of turns. CONTRIBUTING.md says which ratios a change must keep.

use std::f64::consts::TAU;
use std::time::{Duration, Instant};

use criterion::{BatchSize, Criterion, Throughput};
use lovines::{Parameters, Plant, State};
use vines_bench::baseline::Baseline;
use vines_bench::method::{Method, Stepped, measure};
use vines_bench::scene::{Scene, Step};

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

/// A rig in its start and under a harmonic drive; the length of a step is a period.
#[derive(Clone, Copy)]
struct Motion {
    parameters: Parameters,
    start: [f64; 4],
    step: Step,
}

/// The default rig, dimensionless, from `start` under the drive of `G` = `g` at the frequency `omega`.
fn motion(start: [f64; 4], g: f64, omega: f64) -> Motion {
    let step = Step {
        amplitude: EPSILON * g,
        omega,
        signal: [0.0; 4],
        duration: TAU / omega,
    };
    Motion {
        parameters: Parameters::dimensionless(EPSILON, 1.43, 0.65),
        start,
        step,
    }
}

/// The default rig at a detuning and a base amplitude over `b epsilon`, after a thousand periods.
fn settled(sigma: f64, g: f64) -> Motion {
    let motion = motion([0.0, 0.0, 0.0, 0.9], g, 1.0 + EPSILON * sigma);
    let start = State { dq2: 0.9, ..State::default() };
    let mut plant = Plant::new(motion.parameters, start).expect("a valid scene");
    plant.begin(motion.step.drive()).expect("a valid drive");
    plant
        .advance(motion.step.drive(), 1000.0 * motion.step.duration)
        .expect("a valid step");
    let s = plant.state();
    Motion { start: [s.q1, s.dq1, s.q2, s.dq2], ..motion }
}

impl Motion {
    /// A number of steps, each of `part` periods and changed by `change`.
    fn case(&self, name: &str, unit: &'static str, count: usize, part: f64, change: impl Fn(usize, &mut Step)) -> Case {
        let step = |n: usize| {
            let mut step = Step { duration: part * self.step.duration, ..self.step };
            change(n, &mut step);
            step
        };
        let steps = (0..count).map(step).collect();
        Case {
            name: name.to_owned(),
            unit,
            scene: Scene { parameters: self.parameters, start: self.start, steps },
            accepted: "",
            pairs: Vec::new(),
            work: f64::NAN,
        }
    }

    fn long(&self, name: &str) -> Case {
        self.case(
            &format!("{name}, one long step"),
            "impact",
            1,
            PERIODS as f64,
            |_, _| (),
        )
    }

    fn sampled(&self, name: &str, change: impl Fn(usize, &mut Step)) -> Case {
        self.case(name, "sample", PERIODS * SAMPLES, 1.0 / SAMPLES as f64, change)
    }
}

fn cases() -> Vec<Case> {
    let at_lock = motion(
        [-0.438_371_55, 0.007_696_65, -1.003_854_15, -0.878_123_25],
        1.1,
        0.990_417,
    );
    // A particle so slow that it meets no wall in a thousand periods.
    let quiet = motion([0.0, 0.0, 0.0, 1e-6], 0.12, 0.990_417);
    let mut cases = vec![
        // The first case is the unit of the others.
        at_lock.long("default lock"),
        at_lock.case("default lock, a step per period", "impact", PERIODS, 1.0, |_, _| ()),
        // What a new plant computes once counts less.
        Case {
            accepted: "70 ns",
            ..at_lock.case("the same, ten times as long", "impact", 10 * PERIODS, 1.0, |_, _| ())
        },
        at_lock.sampled("default lock, 100 samples per period", |_, _| ()),
        quiet.sampled("no impact, 100 samples per period", |_, _| ()),
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
        let accepted = if regime == "symmetric 1:1" {
            "1.5 locks"
        } else {
            "4 locks"
        };
        let case = settled(sigma, g).long(&format!("{regime}, sigma = {sigma}, G = {g}"));
        cases.push(Case { accepted, ..case });
    }
    // Amplitude and frequency, as a phase-locked loop near its lock changes them.
    let retuned = at_lock.sampled("omega and E change at every sample", |n, step| {
        let small = 1e-5 * ((n as f64 * 0.618_033_988_749_895).fract() - 0.5);
        (step.amplitude, step.omega) = (step.amplitude * (1.0 + small), step.omega * (1.0 + small));
    });
    // The base displacement as a signal: held from sample to sample, and with the slope towards the next one.
    let sample = move |n: usize| at_lock.step.amplitude * (TAU * (n % SAMPLES) as f64 / SAMPLES as f64).sin();
    let held = at_lock.sampled("held sample on e, new at every sample", |n, step| {
        (step.amplitude, step.omega, step.signal[0]) = (0.0, 0.0, sample(n));
    });
    let sloped = at_lock.sampled("sloped sample on e, new at every sample", |n, step| {
        let slope = (sample(n + 1) - sample(n)) / step.duration;
        (step.amplitude, step.omega, step.signal) = (0.0, 0.0, [sample(n), slope, 0.0, 0.0]);
    });
    cases.extend([retuned, held, sloped].map(|case| Case { accepted: "45 ns", ..case }));
    for step in [5e-4, 1e-4, 1e-6] {
        let name = format!("default lock, steps of {step:e} rad");
        let case = at_lock.case(&name, "step", 10_000, step / at_lock.step.duration, |_, _| ());
        cases.push(Case { accepted: "25 ns", ..case });
    }
    // The baseline stalls there.
    let chatter = Motion {
        parameters: Parameters::dimensionless(0.05, 1.0, 0.4),
        start: [0.1, 0.0, 0.1, 0.3],
        ..motion([0.0; 4], 1.5 / EPSILON, 0.6)
    };
    cases.push(chatter.case("chatter into sticking and out of it", "period", 20, 1.0, |_, _| ()));
    cases
}

/// Quartiles: the lower one, the median, the upper one.
fn quartiles(pairs: &[[f64; 2]], value: impl Fn(&[f64; 2]) -> f64) -> [f64; 3] {
    let mut values: Vec<f64> = pairs.iter().map(value).collect();
    values.sort_by(f64::total_cmp);
    [1, 2, 3].map(|n| values[n * (values.len() - 1) / 4])
}

/// The cost of a step of the plant in each case, without its setting up.
fn absolute(cases: &[Case]) {
    let mut criterion = Criterion::default()
        .warm_up_time(Duration::from_millis(500))
        .measurement_time(Duration::from_secs(2))
        .configure_from_args();
    let mut group = criterion.benchmark_group("plant");
    for Case { name, scene, .. } in cases {
        let start = || Stepped::start(scene, 0.0).expect("a valid scene");
        let run = |plant: &mut Stepped| scene.steps.iter().try_for_each(|step| plant.step(step));
        group.throughput(Throughput::Elements(scene.steps.len() as u64));
        group.bench_function(name, |b| b.iter_batched_ref(start, run, BatchSize::SmallInput));
    }
    group.finish();
    criterion.final_summary();
}

fn main() {
    let mut cases = cases();
    absolute(&cases);
    // `cargo test --benches` only wants to see each run once.
    let measured = std::env::args().any(|argument| argument == "--bench");
    let (duration, round) = if measured {
        (DURATION, ROUND)
    } else {
        (Duration::ZERO, Duration::ZERO)
    };
    let began = Instant::now();
    while cases[0].pairs.is_empty() || began.elapsed() < duration {
        for Case { scene, pairs, work, unit, .. } in &mut cases {
            let signal = scene.steps.iter().any(|step| step.signal != [0.0; 4]);
            let mut answer = measure::<Baseline>(scene, 1e-12, &[], round, LIMIT);
            if signal || answer.failure.is_some() {
                answer = measure::<Stepped>(scene, 0.0, &[], round, LIMIT);
                answer.ns.fill(f64::NAN);
            }
            *work = if *unit == "impact" {
                answer.impacts as f64
            } else {
                scene.steps.len() as f64
            };
            pairs.extend(
                answer
                    .plant_ns
                    .iter()
                    .zip(&answer.ns)
                    .map(|(plant, brent)| [*plant, *brent]),
            );
        }
    }
    let lock = quartiles(&cases[0].pairs, |pair| pair[0])[1] / cases[0].work;
    println!(
        "Medians of {} pairs of turns each; a lock is the first cost.",
        cases[0].pairs.len()
    );
    println!(
        "{:70} {:>10} {:>8} {:>10} {:>12} {:>16}  accepted",
        "case", "ns", "locks", "Brent ns", "Brent/plant", "quartiles"
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
