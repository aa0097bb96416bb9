//! Locks of randomly drawn rigs, compared with their exact orbits.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use rayon::prelude::*;
use serde::Serialize;
use thiserror::Error;
use vines_model::orbit::{Orbit, phase_resonant};

use crate::advice;
use crate::experiment::{self, ExperimentError, Plan, Record};
use crate::identification::{self, IdentificationError, Lock};
use crate::rig::{BuiltIn, Chain, Simulated};
use crate::scene::{Controller, Dimensionless, Override, Scene, SceneError};

/// Largest distance from an exact orbit, in sigma and C, of a correct lock.
const CORRECT: f64 = 2e-3;
/// Distance from which on a lock belongs to another orbit.
const NEAR: f64 = 0.02;
/// Largest distance that counts as noise, in standard uncertainties.
const NOISE: f64 = 4.0;
/// A scene at rest, whose plant is replaced. Rigs of the largest mass ratio resonate up to 20 % from omega0.
const SCENE: &str = "[plant]\nepsilon = 0.01\nlambda = 1.0\nr = 0.65\n[excitation]\nG = 1.0\n\
                     [controller]\nomega_min = 0.8\nomega_max = 1.2\n";

/// One rig and how its lock ended.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Row {
    /// Its parameters, with a drive at which a stable symmetric orbit exists.
    pub parameters: Dimensionless,
    /// How the run ended.
    pub outcome: Outcome,
    /// Periods to the lock.
    pub periods: Option<f64>,
    /// Whether the response is held by control, because the drive alone would not hold it.
    pub held: bool,
    /// Distance from the nearest stable orbit, the larger of those in sigma and C.
    pub distance: Option<f64>,
    /// The message, where the lock is not the expected one.
    pub message: Option<String>,
}

/// How a run ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub enum Outcome {
    /// Locked on a stable symmetric orbit, within 2e-3.
    #[serde(rename = "locked")]
    Locked,
    /// Locked in the right regime and farther from the orbit, but within four stated standard uncertainties.
    #[serde(rename = "uncertain")]
    Uncertain,
    /// Locked in the right regime, but farther from the orbit than that.
    #[serde(rename = "inaccurate")]
    Inaccurate,
    /// Locked in another regime; the message says in which.
    #[serde(rename = "other regime")]
    OtherRegime,
    /// No lock, with a reason.
    #[serde(rename = "no lock")]
    NoLock,
    /// No lock, and no reason.
    #[serde(rename = "failed")]
    Failed,
}

/// Why the rigs could not be drawn.
#[derive(Debug, Error)]
pub enum RandomRigError {
    /// The scene refuses a setting.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The plant refuses a parameter.
    #[error(transparent)]
    Plant(#[from] lovines::InvalidValue),
    /// The controller refuses a setting.
    #[error(transparent)]
    Controller(#[from] phase_lock::ConfigError),
}

/// Draws `count` rigs and locks each, on all cores, from the start of the scene, at rest unless `settings` say otherwise: epsilon from 0.001 to 0.05
/// and lambda from 0.1 to 3 (uniform logarithms), r from 0.2 to 0.97, and G across the range with a stable symmetric orbit. A rig is drawn
/// again if no stable orbit of its G lies within the limits of the frequency.
///
/// # Errors
/// Settings that scene or controller refuse.
pub fn locks(count: usize, seed: u64, settings: &[Override]) -> Result<Vec<Row>, RandomRigError> {
    let Controller { omega_min, omega_max, .. } = Scene::parse("random rig", SCENE, settings)?.controller;
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut uniform = move |low: f64, high: f64| low + (high - low) * (random.next_u64() as f64 / u64::MAX as f64);
    let mut rigs = Vec::with_capacity(count);
    while rigs.len() < count {
        let epsilon = uniform(1e-3_f64.ln(), 0.05_f64.ln()).exp();
        let lambda = uniform(0.1_f64.ln(), 3.0_f64.ln()).exp();
        let r = uniform(0.2, 0.97);
        let share = uniform(0.0, 1.0);
        let d = Dimensionless::new(epsilon, lambda, r, 0.0);
        let Some([low, high]) = advice::stable_range(&d) else {
            continue;
        };
        let d = Dimensionless { g: low + share * (high - low), ..d };
        let stable: Vec<Orbit> = phase_resonant(&d).into_iter().filter(|orbit| orbit.stable).collect();
        if stable
            .iter()
            .any(|orbit| (omega_min..=omega_max).contains(&orbit.omega))
        {
            rigs.push((d, stable));
        }
    }
    rigs.par_iter().map(|(d, stable)| lock(d, stable, settings)).collect()
}

fn lock(d: &Dimensionless, stable: &[Orbit], settings: &[Override]) -> Result<Row, RandomRigError> {
    let drawn = [
        format!("plant.epsilon={:?}", d.epsilon),
        format!("plant.lambda={:?}", d.lambda),
        format!("plant.r={:?}", d.r),
        format!("excitation.G={:?}", d.g),
        "record.decay_periods=3".into(),
    ];
    let drawn = drawn
        .iter()
        .map(|setting| setting.parse())
        .collect::<Result<Vec<Override>, _>>();
    let settings = [drawn.map_err(SceneError::from)?, settings.to_vec()].concat();
    let scene = Scene::parse("random rig", SCENE, &settings)?;
    let rig = Simulated::new(scene.plant, scene.start)?;
    let mut rig = Chain::around(Box::new(rig), &scene);
    let mut controller = BuiltIn::new(&scene.controller_config())?;
    let mut samples = Vec::new();
    let outcome = experiment::run_into(
        &mut samples,
        rig.as_mut(),
        &mut controller,
        &Plan::of(&scene),
        |_, _, _| {},
    );
    let outcome = outcome.map_err(|error| {
        let reason = advice::reason(&scene, advice::last_regime(&samples, &scene));
        (error, reason)
    });
    Ok(judge(&scene, stable, outcome))
}

/// The outcome of a lock that is `off` the nearest stable orbit, in sigma and C, and why it is not on it.
fn of_lock(lock: &Lock, off: [f64; 2], reason: impl FnOnce() -> String) -> (Outcome, Option<String>) {
    let largest = off[0].max(off[1]);
    if largest <= CORRECT {
        return (Outcome::Locked, None);
    }
    if off[0] <= NOISE * lock.at.u_sigma && off[1] <= NOISE * lock.at.u_c {
        let why = format!(
            "the standard uncertainties are {:.1e} in sigma and {:.1e} in C",
            lock.at.u_sigma, lock.at.u_c
        );
        return (Outcome::Uncertain, Some(why));
    }
    let why = if largest < NEAR {
        "the response still approaches the orbit, slowly; set smaller controller.frequency_tolerance and \
         controller.amplitude_tolerance"
            .into()
    } else {
        reason()
    };
    (Outcome::Inaccurate, Some(why))
}

/// Judges a record, or the error of a run and its reason.
fn judge(scene: &Scene, stable: &[Orbit], outcome: Result<Record, (ExperimentError, Option<String>)>) -> Row {
    let parameters = scene.dimensionless();
    let row = Row {
        parameters,
        outcome: Outcome::Failed,
        periods: None,
        held: false,
        distance: None,
        message: None,
    };
    let record = match outcome {
        Ok(record) => record,
        Err((error, reason)) => {
            let outcome = if reason.is_some() {
                Outcome::NoLock
            } else {
                Outcome::Failed
            };
            let message = reason.map_or_else(|| error.to_string(), |why| format!("{error}; {why}"));
            return Row { outcome, message: Some(message), ..row };
        }
    };
    let periods = record.settled as f64 / scene.controller.samples_per_period;
    let row = Row { periods: Some(periods), held: record.held, ..row };
    // A held response needs no stability under a constant drive.
    let all = phase_resonant(&parameters);
    let orbits = if record.held { &all } else { stable };
    let distance = |sigma: f64, c: f64| {
        let distances = orbits
            .iter()
            .map(|orbit| [(orbit.sigma - sigma).abs(), (orbit.c - c).abs()]);
        let largest = |[sigma, c]: &[f64; 2]| sigma.max(*c);
        distances
            .min_by(|one, other| largest(one).total_cmp(&largest(other)))
            .unwrap_or([f64::INFINITY; 2])
    };
    let message = |sigma: f64, c: f64, why: &str| Some(format!("locked at sigma = {sigma:.4}, C = {c:.4}: {why}"));
    let reason = |regime| advice::reason(scene, Some(regime)).unwrap_or_default();
    match identification::identify(&record, scene) {
        Ok(found) => {
            let lock = found.lock;
            let off = distance(lock.at.sigma, lock.at.c);
            let row = Row { distance: Some(off[0].max(off[1])), ..row };
            let (outcome, why) = of_lock(&lock, off, || reason(lock.regime));
            let message = why.and_then(|why| message(lock.at.sigma, lock.at.c, &why));
            Row { outcome, message, ..row }
        }
        Err(IdentificationError::Regime { regime, sigma, c, .. }) => {
            let off = distance(sigma, c);
            Row {
                outcome: Outcome::OtherRegime,
                distance: Some(off[0].max(off[1])),
                message: message(sigma, c, &reason(regime)),
                ..row
            }
        }
        Err(error) => Row { message: Some(error.to_string()), ..row },
    }
}
