//! Accuracy of the estimators of the decay: their bias on clean data, and their sensitivity to noise.
//!
//! The reference is the decay of the plant itself: the plant is stopped at every zero crossing of v, which is located to the last
//! digits by advancing a copy of the plant in closed form. The time between every second crossing is the mean period between
//! them. This reference uses no samples, no window and no model.

use serde::Serialize;

use crate::comparison::COMPARED_ABOVE;
use crate::experiment::{self, ExperimentError, Plan, Record, Sample};
use crate::identification::decay_points;
use crate::rig::{BuiltIn, Command, ControllerError, Drive, NormalDistribution, Rig, RigError, Simulated};
use crate::scene::{Estimator, Scene};
use vines_model::numerics::{mean, mean_square, try_bisection};

/// The decay's true detuning over the time since the release.
#[derive(Debug, Clone, PartialEq)]
pub struct Truth {
    /// `(omega0 t, sigma)` at the middle of each period.
    points: Vec<(f64, f64)>,
}

/// Error of an estimator over the points with C > 0.2.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Quality {
    /// The estimator.
    pub estimator: Estimator,
    /// Window of the fit, periods.
    pub window: f64,
    /// Signal-to-noise ratio relative to the held response, dB; absent for clean data.
    pub snr: Option<f64>,
    /// RMS error of sigma over all seeds.
    pub rms: f64,
    /// Mean error of sigma.
    pub bias: f64,
    /// Number of points per seed.
    pub points: usize,
}

/// Steps per period in the search for crossings.
const FINE: f64 = 200.0;
/// Seeds over which noise is averaged.
const SEEDS: u64 = 20;

/// A decay of the plant: the samples, and the reference.
#[derive(Debug, Clone, PartialEq)]
pub struct Decay {
    record: Record,
    truth: Truth,
}

impl Decay {
    /// Locks the plant of a scene, releases it, and records the decay in both ways.
    pub fn of(scene: &Scene) -> Result<Self, ExperimentError> {
        let mut rig = Simulated::new(scene.plant, scene.start).map_err(RigError::from)?;
        let mut controller = BuiltIn::new(&scene.controller_config()).map_err(ControllerError::from)?;
        let plan = Plan::of(scene);
        let held = Plan { decay: 0, ..plan };
        let mut record = experiment::run(&mut rig, &mut controller, &held, |_, _, _| {})?;
        let truth = Truth::of(rig.clone(), scene)?;
        for _ in 0..plan.decay {
            record.samples.push(Sample {
                time: record.samples.len() as f64 * plan.sample_time,
                sensors: rig.sense()?,
                command: Command::default(),
                ground_truth: rig.ground_truth()?,
            });
            rig.advance(Drive::default(), plan.sample_time)?;
        }
        Ok(Self { record, truth })
    }

    /// Errors of the estimator of `scene` with its window. Noise of `snr` dB is averaged over this number of `seeds`.
    pub fn quality(&self, scene: &Scene, snr: Option<f64>, seeds: u64) -> Quality {
        let seeds = if snr.is_some() { seeds } else { 1 };
        let errors: Vec<f64> = (1..=seeds)
            .flat_map(|seed| {
                let record = self.disturbed(snr, seed);
                decay_points(&record, scene).points
            })
            .filter(|point| point.c > COMPARED_ABOVE)
            .filter_map(|point| Some(point.sigma - self.truth.sigma(point.tau)?))
            .collect();
        Quality {
            estimator: scene.record.estimator,
            window: scene.record.window_periods,
            snr,
            rms: mean_square(errors.iter().copied()).sqrt(),
            bias: mean(errors.iter().copied()),
            points: errors.len() / seeds as usize,
        }
    }

    /// The record with noise of constant power, relative to the held response.
    fn disturbed(&self, snr: Option<f64>, seed: u64) -> Record {
        let mut record = self.record.clone();
        if let Some(snr) = snr {
            let held = record.hold();
            let power = mean_square(held.iter().map(|s| s.sensors.response));
            let deviation = power.sqrt() * 10_f64.powf(-snr / 20.0);
            let mut normal = NormalDistribution::new(seed);
            for sample in &mut record.samples[self.record.released..] {
                sample.sensors.response += deviation * normal.next();
            }
        }
        record
    }
}

impl Truth {
    /// The reference for a rig that is released now.
    fn of(mut rig: Simulated, scene: &Scene) -> Result<Self, RigError> {
        let d = scene.dimensionless();
        let step = d.natural_period() / FINE;
        let periods = Plan::of(scene).decay as f64 / scene.controller.samples_per_period;
        let steps = (periods * FINE) as usize;
        let mut crossings = Vec::new();
        let mut before = rig.sense()?.response;
        for n in 0..steps {
            let from = rig.clone();
            rig.advance(Drive::default(), step)?;
            let after = rig.sense()?.response;
            if (before > 0.0) != (after > 0.0) {
                let like_before = |t: f64| -> Result<bool, RigError> {
                    let mut there = from.clone();
                    there.advance(Drive::default(), t)?;
                    Ok((there.sense()?.response > 0.0) == (before > 0.0))
                };
                let (low, high) = try_bisection(0.0, step, 1e-14 * step * FINE, like_before)?;
                crossings.push(n as f64 * step + 0.5 * (low + high));
            }
            before = after;
        }
        let points = crossings.windows(3).map(|three| {
            let omega = std::f64::consts::TAU / (three[2] - three[0]);
            (0.5 * d.omega0 * (three[0] + three[2]), d.sigma(omega))
        });
        Ok(Self { points: points.collect() })
    }

    /// The detuning at `tau`, interpolated linearly between the middles of two periods; `None` outside.
    pub fn sigma(&self, tau: f64) -> Option<f64> {
        let after = self.points.partition_point(|point| point.0 < tau);
        let (from, to) = (self.points.get(after.checked_sub(1)?)?, self.points.get(after)?);
        Some(from.1 + (tau - from.0) / (to.0 - from.0) * (to.1 - from.1))
    }
}

/// Windows of the fit under study, periods.
const WINDOWS: [f64; 7] = [1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 6.0];
/// Noise levels under study, dB.
const NOISE: [Option<f64>; 4] = [None, Some(60.0), Some(50.0), Some(40.0)];

/// Every estimator with every window and noise, on the decay of one scene.
pub fn qualities(scene: &Scene) -> Result<Vec<Quality>, ExperimentError> {
    let decay = Decay::of(scene)?;
    let fits = WINDOWS.map(|window| (Estimator::Fit, window));
    let all = fits.into_iter().chain([(Estimator::Crossings, 1.0)]);
    Ok(all
        .flat_map(|(estimator, window)| {
            let mut scene = scene.clone();
            scene.record.estimator = estimator;
            scene.record.window_periods = window;
            let decay = &decay;
            NOISE.map(|snr| decay.quality(&scene, snr, SEEDS))
        })
        .collect())
}
