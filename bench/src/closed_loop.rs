//! The plant with the phase-lock controller in the loop, 100 samples per period.

use core::f64::consts::TAU;
use std::time::Instant;

use lovines::{Drive, Parameters, Plant, State};
use phase_lock::{Config, Input};
use serde_json::{Value, json};

const SAMPLES: usize = 100;
const EPSILON: f64 = 0.0084;
const LAMBDA: f64 = 1.43;

/// Runs the pair for so many periods of the free oscillation; `see` gets what drives the plant, sample by sample.
fn run(periods: usize, mut see: impl FnMut(f64, f64)) -> Plant {
    let parameters = Parameters::dimensionless(EPSILON, LAMBDA, 0.65);
    let start = State { dq2: 0.9, ..State::default() };
    let mut plant = Plant::new(parameters, start).expect("the scene makes sense");
    let lock = Config {
        sample_time: TAU / SAMPLES as f64,
        omega_min: 0.9,
        omega_max: 1.1,
        damping_rate: Some(0.5 * EPSILON * LAMBDA),
        ..Config::for_resonance(1.0, EPSILON * 1.1)
    }
    .build()
    .expect("the settings make sense");
    let mut state = lock.start();
    for _ in 0..periods * SAMPLES {
        let input = Input {
            response: plant.centre(),
            reference: Some(plant.base_displacement()),
            active: true,
        };
        let output = lock.process(&mut state, input);
        see(output.amplitude, output.omega);
        let drive = Drive::harmonic(output.amplitude, output.omega);
        plant
            .advance(drive, TAU / SAMPLES as f64)
            .expect("the controller puts out a valid drive");
    }
    plant
}

/// Amplitude and frequency of the drive, sample by sample.
pub fn record(periods: usize) -> Vec<[f64; 2]> {
    let mut drives = Vec::new();
    run(periods, |amplitude, omega| drives.push([amplitude, omega]));
    drives
}

/// Nanoseconds per sample of the pair, again and again for about `budget` seconds.
pub fn measure(periods: usize, budget: f64) -> Value {
    let began = Instant::now();
    let mut ns = Vec::new();
    while ns.is_empty() || began.elapsed().as_secs_f64() < budget {
        let start = Instant::now();
        std::hint::black_box(run(periods, |_, _| {}));
        ns.push(start.elapsed().as_nanos() as f64 / (periods * SAMPLES) as f64);
    }
    json!({ "ns": ns })
}
