//! Calibration of the uncertainties: many noisy runs on rigs whose exact orbits are known.
//!
//! Each run locks, lets the motion decay and tracks some levels of the backbone. The error of every result over its standard
//! uncertainty should be normally distributed: 95 % of them within ±1.96.

mod outcome;

use std::cell::RefCell;
use std::rc::Rc;
use std::sync::atomic::{AtomicU64, Ordering};

use rayon::prelude::*;
use vines_model::orbit;

use crate::backbone::track;
use crate::comparison::{COMPARED_ABOVE, ExactCurve, nearest};
use crate::experiment::{self, Plan, Record};
use crate::identification::identify;
use crate::rig::{BuiltIn, Chain, Drive, GroundTruth, Rig, RigError, Sensors, Simulated};
use crate::scene::{Override, Scene, SceneError};

pub use outcome::{Coverage, HALF_WIDTH, Kind, Outcome};

/// epsilon, lambda, r and G of the rigs: the default one, one with lighter particle and harder walls, one with a heavy particle.
pub const RIGS: [[f64; 4]; 3] = [
    [0.0084, 1.43, 0.65, 1.1],
    [0.0042, 1.0, 0.8, 0.75],
    [0.02, 1.43, 0.6, 1.2],
];
/// Rigs that were not used while the estimators were written.
pub const OTHER_RIGS: [[f64; 4]; 3] = [[0.006, 2.0, 0.7, 1.4], [0.012, 0.8, 0.5, 1.1], [0.03, 1.2, 0.75, 0.9]];
/// Signal-to-noise ratios, dB.
pub const RATIOS: [f64; 3] = [40.0, 30.0, 20.0];
/// Further settings: the levels that are tracked, and the reference of the ratios.
const SETTINGS: [&str; 4] = [
    "backbone.C_from=0.6",
    "backbone.C_to=0.3",
    "backbone.points=5",
    "chain.snr_of=\"signal\"",
];

/// All outcomes, and what failed.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Calibration {
    /// Number of runs.
    pub runs: u64,
    /// The errors.
    pub outcomes: Vec<Outcome>,
    /// Results that are missing.
    pub missing: Vec<Missing>,
}

/// What was not measured, or had not settled.
#[derive(Debug, Clone, PartialEq)]
pub struct Missing {
    /// Signal-to-noise ratio, dB.
    pub snr: f64,
    /// What is missing.
    pub what: Part,
    /// Seed of the noise, and the reason.
    pub message: String,
}

/// A part of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Part {
    /// The lock and the decay.
    Lock,
    /// The levels from the one at which tracking ended early.
    Levels,
    /// A tracked point that has not settled.
    Settled,
}

/// The plant with a log of what ideal sensors read.
struct Logged {
    plant: Simulated,
    log: Log,
}

/// Noise-free readings of one run.
type Log = Rc<RefCell<Vec<Sensors>>>;

impl Rig for Logged {
    fn sense(&mut self) -> Result<Sensors, RigError> {
        let sensors = self.plant.sense()?;
        self.log.borrow_mut().push(sensors);
        Ok(sensors)
    }

    fn advance(&mut self, drive: Drive, step: f64) -> Result<(), RigError> {
        self.plant.advance(drive, step)
    }

    fn ground_truth(&mut self) -> Result<Option<GroundTruth>, RigError> {
        self.plant.ground_truth()
    }
}

/// Runs every rig at every ratio with the noise of `seeds`, on all cores. `load` reads the scene with further settings.
pub fn calibrate(
    load: impl Fn(&[Override]) -> Result<Scene, SceneError>,
    rigs: &[[f64; 4]],
    seeds: std::ops::Range<u64>,
    progress: impl Fn(u64) + Sync,
) -> Result<Calibration, SceneError> {
    let mut scenes = Vec::new();
    for [epsilon, lambda, r, g] in rigs {
        for ratio in RATIOS {
            let rig = [
                format!("plant.epsilon={epsilon:?}"),
                format!("plant.lambda={lambda:?}"),
                format!("plant.r={r:?}"),
                format!("excitation.G={g:?}"),
                format!("chain.snr={ratio:?}"),
            ];
            let settings = rig.iter().map(String::as_str).chain(SETTINGS);
            let overrides = settings.map(str::parse).collect::<Result<Vec<Override>, _>>()?;
            scenes.push((ratio, load(&overrides)?));
        }
    }
    let curves: Vec<ExactCurve> = scenes
        .iter()
        .map(|(_, scene)| ExactCurve::of(&scene.dimensionless()))
        .collect();
    let count = (seeds.end - seeds.start) * scenes.len() as u64;
    let done = AtomicU64::new(0);
    let runs = (0..count).into_par_iter().map(|n| {
        let at = (n % scenes.len() as u64) as usize;
        let (ratio, mut scene) = scenes[at].clone();
        // Runs of the same noise would not be independent.
        scene.chain.seed = seeds.start * scenes.len() as u64 + n;
        let run = run(&scene, ratio, &curves[at]);
        progress(done.fetch_add(1, Ordering::Relaxed) + 1);
        run
    });
    // In the order of the runs, whichever core was first.
    let runs: Vec<Calibration> = runs.collect();
    Ok(Calibration {
        runs: count,
        outcomes: runs.iter().flat_map(|run| run.outcomes.iter().copied()).collect(),
        missing: runs.into_iter().flat_map(|run| run.missing).collect(),
    })
}

/// One run: a lock with its decay, and a tracked backbone.
fn run(scene: &Scene, snr: f64, curve: &ExactCurve) -> Calibration {
    let mut run = Calibration::default();
    let missing = |what, message: &dyn std::fmt::Display| Missing {
        snr,
        what,
        message: format!("{snr} dB, seed {}: {message}", scene.chain.seed),
    };
    match locked(scene, snr) {
        Ok(outcomes) => run.outcomes.extend(outcomes),
        Err(error) => run.missing.push(missing(Part::Lock, &error)),
    }
    match tracked(scene, snr, curve) {
        Ok((outcomes, lost)) => {
            run.outcomes.extend(outcomes);
            run.missing.extend(lost.iter().map(|(what, why)| missing(*what, why)));
        }
        Err(error) => run.missing.push(missing(Part::Levels, &error)),
    }
    run
}

/// An error of any part of a run.
type RunError = Box<dyn std::error::Error>;

fn chained(scene: &Scene, log: &Log) -> Result<Chain, RunError> {
    let plant = Simulated::new(scene.plant, scene.start)?;
    let rig = Logged { plant, log: Rc::clone(log) };
    Ok(Chain::new(Box::new(rig), scene))
}

fn locked(scene: &Scene, snr: f64) -> Result<Vec<Outcome>, RunError> {
    let log = Log::default();
    let mut controller = BuiltIn::new(&scene.controller_config())?;
    let record = experiment::run(
        &mut chained(scene, &log)?,
        &mut controller,
        &Plan::of(scene),
        |_, _, _| {},
    )?;
    let found = identify(&record, scene)?;
    let ideal = identify(&with_ideal_sensors(record, &log), scene)?;
    let phase = ideal.lock.at.phase_error_deg;
    let lock = found.lock;
    let orbits = orbit::phase_resonant(&scene.dimensionless());
    let exact = nearest(&orbits, &lock).ok_or("no exact orbit at this G")?;
    let epsilon = scene.dimensionless().epsilon;
    let outcome = |kind, quantity, error, uncertainty| Outcome {
        epsilon,
        snr,
        c: lock.at.c,
        kind,
        quantity,
        error,
        uncertainty,
        bound: None,
    };
    let mut outcomes = vec![
        outcome(Kind::Lock, "sigma", lock.at.sigma - exact.sigma, lock.at.u_sigma),
        outcome(Kind::Lock, "C", lock.at.c - exact.c, lock.at.u_c),
        outcome(Kind::Lock, "G", lock.at.g - exact.g, lock.at.u_g),
        outcome(
            Kind::Lock,
            "phase",
            lock.at.phase_error_deg - phase,
            lock.at.u_phase_deg,
        ),
    ];
    if let (Some(b), Some(u)) = (lock.b, lock.u_b) {
        outcomes.push(outcome(Kind::Lock, "B", b - exact.b, u));
    }
    // Both have the same times from the release on.
    let pairs = found.decay.points.iter().zip(&ideal.decay.points);
    for (point, clean) in pairs.filter(|(point, _)| point.c > COMPARED_ABOVE) {
        let outcome = outcome(Kind::Decay, "sigma", point.sigma - clean.sigma, point.u_sigma);
        outcomes.push(Outcome { c: point.c, ..outcome });
    }
    Ok(outcomes)
}

fn with_ideal_sensors(mut record: Record, log: &Log) -> Record {
    for (sample, sensors) in record.samples.iter_mut().zip(log.borrow().iter()) {
        sample.sensors = *sensors;
    }
    record
}

/// Outcomes of the settled points, and what is missing.
type TrackedOutcomes = (Vec<Outcome>, Vec<(Part, String)>);

fn tracked(scene: &Scene, snr: f64, curve: &ExactCurve) -> Result<TrackedOutcomes, RunError> {
    let log = Log::default();
    let mut controller = BuiltIn::new(&scene.backbone_config())?;
    let found = track(&mut chained(scene, &log)?, &mut controller, scene, |_, _| {})?;
    let ended = found.ended.map(|why| (Part::Levels, why.to_string()));
    let (mut outcomes, mut missing) = (Vec::new(), Vec::from_iter(ended));
    for point in &found.points {
        let Some([sigma, g]) = curve.at(point.at.c).filter(|_| point.settled) else {
            missing.push((Part::Settled, format!("not settled at C = {:.3}", point.level)));
            continue;
        };
        // Frequency and growth of a sinusoid of unknown amplitude and phase in white noise (Rife and Boorstyn, 1974).
        let periods = point.averaged as f64;
        let ratio = 10_f64.powf(-snr / 20.0) / 2_f64.sqrt();
        let slope =
            ratio * (24.0 / (scene.controller.samples_per_period * periods)).sqrt() / (std::f64::consts::TAU * periods);
        let slope = slope / scene.dimensionless().epsilon;
        let outcome = |quantity, error, uncertainty, bound| Outcome {
            epsilon: scene.dimensionless().epsilon,
            snr,
            c: point.at.c,
            kind: Kind::Tracked,
            quantity,
            error,
            uncertainty,
            bound: Some(bound),
        };
        outcomes.push(outcome("sigma", point.at.sigma - sigma, point.at.u_sigma, slope));
        outcomes.push(outcome("G", point.at.g - g, point.at.u_g, 2.0 * point.at.c * slope));
    }
    Ok((outcomes, missing))
}
