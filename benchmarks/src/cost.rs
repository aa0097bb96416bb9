//! The plant alone: how its run time grows with the work, and its cost with the phase-lock controller in the loop.

use std::f64::consts::TAU;
use std::path::Path;
use std::time::Instant;

use lovines::{Drive, Parameters, Plant, State};
use phase_lock::{Config, Input};
use serde_json::{Value, json};

use crate::median;
use crate::method::begin;
use crate::scene::Scene;

/// Periods that samples are followed for.
const PERIODS: usize = 100;

/// Wall times, ns, of repetitions for about `budget` seconds, `least` of them at least; and the work of one.
fn timed(budget: f64, least: usize, mut run: impl FnMut() -> u64) -> (Vec<f64>, u64) {
    let began = Instant::now();
    let (mut times, mut work) = (Vec::new(), 0);
    while times.len() < least || began.elapsed().as_secs_f64() < budget {
        let start = Instant::now();
        work = std::hint::black_box(run());
        times.push(start.elapsed().as_nanos() as f64);
    }
    (times, work)
}

/// Points `[size, ns, units of work]` of the steady scene up to `most` of what grows.
///
/// # Errors
/// An unknown name of what grows, or a scene that cannot be read.
pub fn growth(folder: &Path, what: &str, budget: f64, most: f64) -> anyhow::Result<Value> {
    let scene = Scene::load(folder, "steady")?;
    let start = begin(&scene).map_err(|failure| anyhow::anyhow!(failure.0))?;
    let (drive, period) = (scene.steps[0].drive, scene.steps[0].duration);
    let step_by_step = |steps: usize, duration: f64| {
        let mut plant = start;
        for _ in 0..steps {
            plant.advance(drive, duration).expect("a valid step");
            std::hint::black_box((plant.centre(), plant.base_displacement()));
        }
        steps as u64
    };
    let in_one_step = |impacts: f64| {
        let mut plant = start;
        plant.advance(drive, 0.5 * impacts * period).expect("a valid step");
        plant.totals().impacts
    };
    let mut points = Vec::new();
    let mut size = 10.0;
    while size <= most * 1.001 {
        let count = f64::round(size) as usize;
        let (times, work) = match what {
            "periods" => timed(budget, 3, || step_by_step(count, period)),
            "impacts" => timed(budget, 3, || in_one_step(size)),
            "samples per period" => timed(budget, 3, || step_by_step(PERIODS * count, period / count as f64)),
            _ => anyhow::bail!("{what}: there are periods, impacts and samples per period"),
        };
        let grown = if what == "impacts" { work as f64 } else { count as f64 };
        points.push([grown, median(times), work as f64]);
        size *= 10f64.sqrt();
    }
    Ok(json!({ "points": points }))
}

const SAMPLES: usize = 100;
const EPSILON: f64 = 0.0084;
const LAMBDA: f64 = 1.43;

/// Runs plant and controller for a number of periods of the free oscillation; `see` gets amplitude and frequency of the drive at every sample.
fn coupled(periods: usize, mut see: impl FnMut(f64, f64)) -> Plant {
    let parameters = Parameters::dimensionless(EPSILON, LAMBDA, 0.65);
    let start = State { dq2: 0.9, ..State::default() };
    let mut plant = Plant::new(parameters, start).expect("the scene makes sense");
    let config = Config {
        sample_time: TAU / SAMPLES as f64,
        omega_min: 0.9,
        omega_max: 1.1,
        damping_rate: Some(0.5 * EPSILON * LAMBDA),
        ..Config::for_resonance(1.0, EPSILON * 1.1)
    };
    let lock = config.build().expect("the settings make sense");
    let mut state = lock.start();
    for _ in 0..periods * SAMPLES {
        let reference = Some(plant.base_displacement());
        let input = Input { response: plant.centre(), reference, active: true };
        let output = lock.process(&mut state, input);
        see(output.amplitude, output.omega);
        let drive = Drive::harmonic(output.amplitude, output.omega);
        let advanced = plant.advance(drive, config.sample_time);
        advanced.expect("the controller puts out a valid drive");
    }
    plant
}

/// Amplitude and frequency of the drive, sample by sample.
pub fn record(periods: usize) -> Vec<[f64; 2]> {
    let mut drives = Vec::new();
    coupled(periods, |amplitude, omega| drives.push([amplitude, omega]));
    drives
}

/// Nanoseconds per sample of the pair, again and again for about `budget` seconds.
pub fn closed_loop(periods: usize, budget: f64) -> Value {
    let (times, samples) = timed(budget, 1, || {
        std::hint::black_box(coupled(periods, |_, _| {}));
        (periods * SAMPLES) as u64
    });
    let ns: Vec<f64> = times.into_iter().map(|ns| ns / samples as f64).collect();
    json!({ "ns": ns })
}
