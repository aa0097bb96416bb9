//! Calibration of the uncertainties: many noisy runs on rigs whose exact orbits are known.
//!
//! Each run locks, lets the motion decay and tracks some levels of the backbone. The error of every result over its standard
//! uncertainty should be normally distributed: 95 % of them within ±1.96.

use std::cell::RefCell;
use std::rc::Rc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};

use serde::Serialize;
use vines_model::orbit;

use crate::backbone::track;
use crate::comparison::{COMPARED_ABOVE, ExactCurve};
use crate::experiment::{self, Plan, Record};
use crate::identification::identify;
use crate::rig::{BuiltIn, Chain, Drive, GroundTruth, Rig, RigError, Sensors, Simulated};
use crate::scene::{Override, Scene, SceneError};

/// Settings of a rig.
pub type RigSettings = [&'static str; 4];

/// The rigs: the default one, one with lighter particle and harder walls, one with a heavy particle.
pub const RIGS: [RigSettings; 3] = [
    [
        "plant.epsilon=0.0084",
        "plant.lambda=1.43",
        "plant.r=0.65",
        "excitation.G=1.1",
    ],
    [
        "plant.epsilon=0.0042",
        "plant.lambda=1.0",
        "plant.r=0.8",
        "excitation.G=0.75",
    ],
    [
        "plant.epsilon=0.02",
        "plant.lambda=1.43",
        "plant.r=0.6",
        "excitation.G=1.2",
    ],
];
/// Rigs that were not used while the estimators were written.
pub const OTHER_RIGS: [RigSettings; 3] = [
    [
        "plant.epsilon=0.006",
        "plant.lambda=2.0",
        "plant.r=0.7",
        "excitation.G=1.4",
    ],
    [
        "plant.epsilon=0.012",
        "plant.lambda=0.8",
        "plant.r=0.5",
        "excitation.G=1.1",
    ],
    [
        "plant.epsilon=0.03",
        "plant.lambda=1.2",
        "plant.r=0.75",
        "excitation.G=0.9",
    ],
];
/// Signal-to-noise ratios, dB.
pub const RATIOS: [f64; 3] = [40.0, 30.0, 20.0];
/// The levels that are tracked.
const LEVELS: [&str; 3] = ["backbone.C_from=0.6", "backbone.C_to=0.3", "backbone.points=5"];

/// What a result belongs to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Kind {
    /// The locked point, against the exact orbit at the same G.
    Lock,
    /// A settled tracked point, against the exact backbone at the same C.
    Tracked,
    /// A point of the decay with C > 0.2, corrected for the drift, against the same.
    Decay,
}

/// The error of one result.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Outcome {
    /// Signal-to-noise ratio, dB.
    pub snr: f64,
    /// What it belongs to.
    pub kind: Kind,
    /// Name of the quantity.
    pub quantity: &'static str,
    /// Value less exact value.
    pub error: f64,
    /// Standard uncertainty.
    pub uncertainty: f64,
    /// Cramér–Rao bound of the standard deviation; absent where it is not known in closed form.
    pub bound: Option<f64>,
}

/// All outcomes, and what failed.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Calibration {
    /// Number of runs.
    pub runs: u64,
    /// The errors.
    pub outcomes: Vec<Outcome>,
    /// Messages of the runs, or parts of runs, that failed, and tracked points that had not settled.
    pub failures: Vec<String>,
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
///
/// # Errors
/// A scene that is refused.
pub fn calibrate(
    load: impl Fn(&[Override]) -> Result<Scene, SceneError>,
    rigs: &[RigSettings],
    seeds: std::ops::Range<u64>,
    progress: impl Fn(u64) + Sync,
) -> Result<Calibration, SceneError> {
    let mut scenes = Vec::new();
    for rig in rigs {
        for ratio in RATIOS {
            let noise = format!("chain.snr={ratio:?}");
            let settings = rig
                .iter()
                .chain(&LEVELS)
                .copied()
                .chain([noise.as_str(), "chain.snr_of=\"signal\""]);
            let overrides = settings.map(str::parse).collect::<Result<Vec<Override>, _>>()?;
            scenes.push((ratio, load(&overrides)?));
        }
    }
    let curves: Vec<ExactCurve> = scenes
        .iter()
        .map(|(_, scene)| ExactCurve::of(&scene.dimensionless()))
        .collect();
    let (next, found) = (AtomicU64::new(0), Mutex::new(Calibration::default()));
    let count = (seeds.end - seeds.start) * scenes.len() as u64;
    let work = || {
        loop {
            let n = next.fetch_add(1, Ordering::Relaxed);
            if n >= count {
                break;
            }
            let at = (n % scenes.len() as u64) as usize;
            let (ratio, mut scene) = scenes[at].clone();
            scene.chain.seed = seeds.start + n / scenes.len() as u64;
            let run = run(&scene, ratio, &curves[at]);
            let mut all = found.lock().unwrap_or_else(PoisonError::into_inner);
            all.runs += 1;
            all.outcomes.extend(run.outcomes);
            all.failures.extend(run.failures);
            progress(all.runs);
        }
    };
    std::thread::scope(|scope| {
        for _ in 0..std::thread::available_parallelism().map_or(1, usize::from) {
            scope.spawn(work);
        }
    });
    Ok(found.into_inner().unwrap_or_else(PoisonError::into_inner))
}

/// One run: a lock with its decay, and a tracked backbone.
fn run(scene: &Scene, snr: f64, curve: &ExactCurve) -> Calibration {
    let mut run = Calibration::default();
    let results = locked(scene, snr, curve).and_then(|outcomes| {
        run.outcomes.extend(outcomes);
        tracked(scene, snr, curve)
    });
    match results {
        Ok((outcomes, unsettled)) => {
            run.outcomes.extend(outcomes);
            run.failures.extend(unsettled);
        }
        Err(error) => run
            .failures
            .push(format!("{snr} dB, seed {}: {error}", scene.chain.seed)),
    }
    run
}

/// An error of any part of a run.
type RunError = Box<dyn std::error::Error>;

fn chained(scene: &Scene, log: &Log) -> Result<Chain, RunError> {
    let plant = Simulated::new(scene.plant, scene.start)?;
    let samples = scene.controller.samples_per_period;
    let rig = Logged { plant, log: Rc::clone(log) };
    Ok(Chain::new(Box::new(rig), &scene.chain, &scene.dimensionless(), samples))
}

fn locked(scene: &Scene, snr: f64, curve: &ExactCurve) -> Result<Vec<Outcome>, RunError> {
    let log = Log::default();
    let mut controller = BuiltIn::new(&scene.controller_config())?;
    let record = experiment::run(
        &mut chained(scene, &log)?,
        &mut controller,
        &Plan::of(scene),
        |_, _, _| {},
    )?;
    let found = identify(&record, scene)?;
    let phase = identify(&with_ideal_sensors(record, &log), scene)?.lock.phase_error_deg;
    let lock = found.lock;
    let distance = |one: &orbit::Orbit| (one.sigma - lock.sigma).hypot(one.c - lock.c);
    let orbits = orbit::phase_resonant(&scene.dimensionless());
    let exact = orbits
        .iter()
        .min_by(|a, b| distance(a).total_cmp(&distance(b)))
        .ok_or("no exact orbit at this G")?;
    let outcome = |kind, quantity, error, uncertainty| Outcome { snr, kind, quantity, error, uncertainty, bound: None };
    let mut outcomes = vec![
        outcome(Kind::Lock, "sigma", lock.sigma - exact.sigma, lock.u_sigma),
        outcome(Kind::Lock, "C", lock.c - exact.c, lock.u_c),
        outcome(Kind::Lock, "G", lock.g - exact.g, lock.u_g),
        outcome(Kind::Lock, "phase", lock.phase_error_deg - phase, lock.u_phase_deg),
    ];
    if let (Some(b), Some(u)) = (lock.b, lock.u_b) {
        outcomes.push(outcome(Kind::Lock, "B", b - exact.b, u));
    }
    for point in found.decay.points.iter().filter(|point| point.c > COMPARED_ABOVE) {
        if let (Some(sigma), Some(u), Some([exact, _])) = (point.sigma_steady, point.u_sigma_steady, curve.at(point.c))
        {
            outcomes.push(outcome(Kind::Decay, "sigma", sigma - exact, u));
        }
    }
    Ok(outcomes)
}

fn with_ideal_sensors(mut record: Record, log: &Log) -> Record {
    for (sample, sensors) in record.samples.iter_mut().zip(log.borrow().iter()) {
        sample.sensors = *sensors;
    }
    record
}

fn tracked(scene: &Scene, snr: f64, curve: &ExactCurve) -> Result<(Vec<Outcome>, Vec<String>), RunError> {
    let log = Log::default();
    let mut controller = BuiltIn::new(&scene.backbone_config())?;
    let found = track(&mut chained(scene, &log)?, &mut controller, scene, |_, _| {})?;
    let (mut outcomes, mut unsettled) = (Vec::new(), Vec::new());
    for point in &found.points {
        let Some([sigma, g]) = curve.at(point.c).filter(|_| point.settled) else {
            unsettled.push(format!(
                "{snr} dB, seed {}: not settled at C = {:.3}",
                scene.chain.seed, point.level
            ));
            continue;
        };
        // Frequency and growth of a sinusoid of unknown amplitude and phase in white noise (Rife and Boorstyn, 1974).
        let periods = point.averaged as f64;
        let ratio = 10_f64.powf(-snr / 20.0) / 2_f64.sqrt();
        let slope =
            ratio * (24.0 / (scene.controller.samples_per_period * periods)).sqrt() / (std::f64::consts::TAU * periods);
        let slope = slope / scene.dimensionless().epsilon;
        let outcome = |quantity, error, uncertainty, bound| Outcome {
            snr,
            kind: Kind::Tracked,
            quantity,
            error,
            uncertainty,
            bound: Some(bound),
        };
        outcomes.push(outcome("sigma", point.sigma - sigma, point.u_sigma, slope));
        outcomes.push(outcome("G", point.g - g, point.u_g, 2.0 * point.c * slope));
    }
    Ok((outcomes, unsettled))
}

/// Statistics of the outcomes of one quantity.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Coverage {
    /// Number of results.
    pub count: usize,
    /// Share of the results whose 95 % interval contains the exact value.
    pub covered: f64,
    /// Largest error over its standard uncertainty.
    pub worst: f64,
    /// RMS error.
    pub rms: f64,
    /// RMS of the Cramér–Rao bounds; absent where they are not known.
    pub bound: Option<f64>,
}

/// Half width of a 95 % interval, standard uncertainties.
pub const HALF_WIDTH: f64 = 1.96;

impl Coverage {
    /// Of some outcomes; shares of none are NaN.
    #[must_use]
    pub fn of<'a>(outcomes: impl Iterator<Item = &'a Outcome> + Clone) -> Self {
        let count = outcomes.clone().count();
        let pulls = outcomes.clone().map(|one| one.error.abs() / one.uncertainty);
        let square = |values: &mut dyn Iterator<Item = f64>| {
            (values.map(|value| value * value).sum::<f64>() / count as f64).sqrt()
        };
        let bounds: Option<Vec<f64>> = outcomes.clone().map(|one| one.bound).collect();
        Self {
            count,
            covered: pulls.clone().filter(|pull| *pull <= HALF_WIDTH).count() as f64 / count as f64,
            worst: pulls.fold(0.0, f64::max),
            rms: square(&mut outcomes.map(|one| one.error)),
            bound: bounds.map(|bounds| square(&mut bounds.into_iter())),
        }
    }
}
