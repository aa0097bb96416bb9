//! The rigs, starts and drives that are timed, and how the plant and the baseline follow them.

use core::f64::consts::TAU;
use std::hint::black_box;

use lovines::{Drive, Parameters, Plant, State};

use crate::baseline::Baseline;

const EPSILON: f64 = 0.0084;
/// Periods of a run.
pub const PERIODS: usize = 100;
/// Samples per period where the plant is sampled.
pub const SAMPLES: usize = 100;
/// A rig, its start and its drive.
#[derive(Clone, Copy)]
pub struct Scene {
    parameters: Parameters,
    start: [f64; 4],
    amplitude: f64,
    omega: f64,
}

fn default_rig() -> Parameters {
    Parameters::dimensionless(EPSILON, 1.43, 0.65)
}

/// The steady 1:1 motion of the default scene, dimensionless.
pub fn lock() -> Scene {
    Scene {
        parameters: default_rig(),
        start: [-0.438_371_55, 0.007_696_65, -1.003_854_15, -0.878_123_25],
        amplitude: EPSILON * 1.1,
        omega: 0.990_417,
    }
}

/// The same rig, with a particle so slow that it meets no wall in a thousand periods.
pub fn quiet() -> Scene {
    Scene { start: [0.0, 0.0, 0.0, 1e-6], amplitude: 1e-3, ..lock() }
}

/// A chatter into sticking and out of it.
pub fn chatter() -> Scene {
    Scene {
        parameters: Parameters::dimensionless(0.05, 1.0, 0.4),
        start: [0.1, 0.0, 0.1, 0.3],
        amplitude: 1.5,
        omega: 0.6,
    }
}

/// The default rig at a detuning and a base amplitude over `b epsilon`, after a thousand periods.
pub fn settled(sigma: f64, g: f64) -> Scene {
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
    pub fn drive(&self) -> Drive {
        Drive::harmonic(self.amplitude, self.omega)
    }

    pub fn period(&self) -> f64 {
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
        Baseline::new(self.parameters, self.start, 1e-12)
    }

    /// So many equal steps; `read` after each. The impacts met.
    pub fn follow(&self, steps: usize, step: f64, read: fn(&Plant)) -> u64 {
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
    pub fn compare(&self, steps: usize, step: f64) -> Option<u64> {
        let mut baseline = self.baseline();
        for _ in 0..steps {
            baseline.advance(black_box(self.amplitude), self.omega, step).ok()?;
            black_box((baseline.q1, baseline.q2));
        }
        Some(baseline.impacts)
    }

    /// The drives of a hundred samples per period.
    pub fn drives(&self, drive: fn(&Self, usize) -> Drive) -> Vec<Drive> {
        (0..PERIODS * SAMPLES).map(|n| drive(self, n)).collect()
    }

    /// A hundred samples per period, each with a drive of its own; v and the base displacement are read. The samples.
    pub fn sampled(&self, drives: &[Drive]) -> u64 {
        let mut plant = self.plant();
        let step = self.period() / SAMPLES as f64;
        for drive in drives {
            plant.advance(black_box(*drive), step).unwrap();
            sensors(&plant);
        }
        drives.len() as u64
    }

    /// The same by the baseline, which takes a drive of the built-in oscillator only; none if it stalls.
    pub fn compare_sampled(&self, drives: &[Drive]) -> Option<u64> {
        let mut baseline = self.baseline();
        let step = self.period() / SAMPLES as f64;
        for drive in drives {
            baseline.advance(black_box(drive.amplitude), drive.omega, step).ok()?;
            black_box((baseline.q1, baseline.q2));
        }
        Some(drives.len() as u64)
    }

    /// Amplitude and frequency of sample `n`, as a phase-locked loop near its lock changes them.
    pub fn retuned(&self, n: usize) -> Drive {
        let small = 1e-5 * ((n as f64 * 0.618_033_988_749_895).fract() - 0.5);
        Drive::harmonic(self.amplitude * (1.0 + small), self.omega * (1.0 + small))
    }

    /// The base displacement at sample `n`.
    fn sample(&self, n: usize) -> f64 {
        self.amplitude * (TAU * (n % SAMPLES) as f64 / SAMPLES as f64).sin()
    }

    /// The sample held on the input `e`.
    pub fn held(&self, n: usize) -> Drive {
        Drive::held(self.sample(n))
    }

    /// The sample on the input `e` with the slope towards the next one.
    pub fn sloped(&self, n: usize) -> Drive {
        let slope = (self.sample(n + 1) - self.sample(n)) * SAMPLES as f64 / self.period();
        Drive {
            signal: [self.sample(n), slope, 0.0, 0.0],
            ..Drive::default()
        }
    }
}

pub fn nothing(_: &Plant) {}

pub fn sensors(plant: &Plant) {
    black_box((plant.centre(), plant.base_displacement()));
}

pub fn states(plant: &Plant) {
    black_box(plant.state());
}
