//! What the tests share: numbers from the environment, random numbers, comparisons, and reference orbits.
#![allow(dead_code, reason = "each test file uses its own part")]

use std::f64::consts::TAU;

use lovines::{Drive, Parameters, Plant};
use rand_chacha::{ChaCha8Rng, rand_core::Rng};
use vines_model::Dimensionless;
use vines_model::orbit::{Branch, FrequencyResponse, Periodic};

/// The number in the environment variable `name`.
pub fn setting(name: &str, default: u64) -> u64 {
    std::env::var(name).map_or(default, |text| {
        text.parse().unwrap_or_else(|_| panic!("{name}: a number"))
    })
}

/// A random number in a range.
pub fn within(random: &mut ChaCha8Rng, [low, high]: [f64; 2]) -> f64 {
    low + (high - low) * (random.next_u64() as f64 / u64::MAX as f64)
}

/// Requires that two numbers differ by at most `tolerance`, relative to a number above 1.
#[track_caller]
pub fn close(one: f64, other: f64, tolerance: f64) {
    let size = 1f64.max(one.abs());
    assert!((one - other).abs() <= tolerance * size, "{one} and {other}");
}

/// The components of symmetric 1:1 motions.
pub fn symmetric(found: &FrequencyResponse) -> impl Iterator<Item = &Branch> {
    let is_symmetric = |branch: &&Branch| branch.pattern().mirrored && branch.pattern().is_one_to_one();
    found.components.iter().map(|one| &one.branch).filter(is_symmetric)
}

/// (q1, q1', q2, q2') of a motion where the phase of the base is 0.
pub fn at_phase_zero(scene: &Dimensionless, motion: &Periodic) -> [f64; 4] {
    let bounce = motion.bounces[motion.bounces.len() - 1];
    let start = [bounce.q1, bounce.dq1, bounce.q2(), bounce.dq2].into();
    let drive = Dimensionless { g: motion.g, ..*scene }.drive(motion.sigma);
    let mut plant = Plant::new(Parameters::dimensionless(scene.epsilon, scene.lambda, scene.r), start).unwrap();
    // A base at rest takes its phase to the impact at once.
    let still = Drive::harmonic(0.0, 1e9);
    plant.begin(still).unwrap();
    plant
        .advance(still, bounce.phase.rem_euclid(TAU) / still.omega)
        .unwrap();
    plant.begin(drive).unwrap();
    plant.set_state(start).unwrap();
    plant
        .advance(drive, (-bounce.phase).rem_euclid(TAU) / drive.omega)
        .unwrap();
    plant.state().into()
}

const ORBITS: &str = include_str!("../../../../tests/reference/orbits.csv");

/// A row of `tests/reference/orbits.csv`: an exact orbit, and the first-order theory beside it.
#[derive(Debug, Clone, Copy)]
pub struct Row {
    pub epsilon: f64,
    pub lambda: f64,
    pub r: f64,
    pub g: f64,
    pub sigma: f64,
    pub c: f64,
    pub b: f64,
    pub multipliers: [f64; 4],
    /// sigma, C and B.
    pub theory: [f64; 3],
}

impl Row {
    pub fn scene(&self) -> Dimensionless {
        Dimensionless::new(self.epsilon, self.lambda, self.r, self.g)
    }
}

pub fn rows() -> Vec<Row> {
    ORBITS.lines().skip(1).map(row).collect()
}

fn row(line: &str) -> Row {
    let cells: Vec<f64> = line.split(',').map(|cell| cell.parse().unwrap()).collect();
    let [epsilon, lambda, r, g, sigma, c, b, m1, m2, m3, m4, theory @ ..] = &cells[..] else {
        panic!("fourteen columns expected: {line}")
    };
    let [epsilon, lambda, r, g, sigma, c, b] = [epsilon, lambda, r, g, sigma, c, b].map(|one| *one);
    let (multipliers, theory) = ([*m1, *m2, *m3, *m4], theory.try_into().unwrap());
    Row { epsilon, lambda, r, g, sigma, c, b, multipliers, theory }
}
