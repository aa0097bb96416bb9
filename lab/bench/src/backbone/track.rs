//! The tracking of the backbone.

use serde::Serialize;
use thiserror::Error;

use super::cycle::Cycle;
use super::predictor::{self, Known};
use super::settle::{Criterion, Estimate};
use crate::experiment::Sample;
use crate::identification::{Regime, classify, regime_by_response};
use crate::rig::{Command, Controller, ControllerError, Drive, Fault, LoopState, Move, Rig, RigError};
use crate::scene::Scene;
use vines_model::theory::SlowFlow;

/// One point of the backbone; dimensionless.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Point {
    /// Target level.
    pub level: f64,
    /// Amplitude of the fundamental of v.
    #[serde(rename = "C")]
    pub c: f64,
    /// Detuning.
    pub sigma: f64,
    /// Base amplitude over `b epsilon`.
    #[serde(rename = "G")]
    pub g: f64,
    /// Mean phase error, degrees.
    pub phase_error_deg: f64,
    /// Periods of the move to this level and at this level.
    pub periods: f64,
    /// Periods averaged.
    pub averaged: usize,
    /// The point had settled; otherwise it was taken at the time limit.
    pub settled: bool,
    /// The regime determined from the response alone, as on a real rig.
    pub regime: Regime,
    /// The regime determined from the impacts, if the rig is a simulation.
    pub regime_by_impacts: Option<Regime>,
}

/// The tracked backbone.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Tracked {
    /// The points, in the order in which they were taken.
    pub points: Vec<Point>,
    /// Periods from the start to the closed loop.
    pub periods_to_lock: f64,
    /// All periods, from the start to the last point.
    pub periods: f64,
    /// Why tracking ended before the last level; absent if it did not.
    pub ended: Option<String>,
}

/// Why tracking ended early.
#[derive(Debug, Error)]
pub enum TrackError {
    /// The rig failed.
    #[error(transparent)]
    Rig(#[from] RigError),
    /// The controller failed.
    #[error(transparent)]
    Controller(#[from] ControllerError),
    /// The loop did not come near phase resonance in the time allowed.
    #[error("no lock within {periods:.0} periods of the drive; see record.lock_periods and the [controller] section")]
    NoLock {
        /// Time limit, periods.
        periods: f64,
    },
    /// The controller switched the drive off.
    #[error("the controller switched the drive off after {periods:.1} periods: {fault}")]
    Tripped {
        /// Time since the start, periods of the drive.
        periods: f64,
        /// The reason.
        fault: Fault,
    },
}

/// Phase error, rad, below which the control of the response begins.
const NEAR: f64 = 0.35;
/// Periods for which the phase error must have been that small.
const NEAR_FOR: usize = 3;

/// A bench that reads period by period.
struct Bench<'a, R: ?Sized, C: ?Sized> {
    rig: &'a mut R,
    controller: &'a mut C,
    sample_time: f64,
    target: f64,
    taken: usize,
    /// Phase of the drive, turns.
    turns: f64,
    samples: Vec<Sample>,
    periods: f64,
}

impl<R: Rig + ?Sized, C: Controller + ?Sized> Bench<'_, R, C> {
    fn sample(&mut self) -> Result<Command, TrackError> {
        let sensors = self.rig.sense()?;
        let command = match self.controller.sample(sensors, true) {
            Ok(command) => command,
            Err(error) => {
                // A failed controller must not leave the rig driven.
                let _ = self.rig.advance(Drive::default(), self.sample_time);
                return Err(error.into());
            }
        };
        self.samples.push(Sample {
            time: self.taken as f64 * self.sample_time,
            sensors,
            command,
            ground_truth: self.rig.ground_truth()?,
        });
        self.taken += 1;
        self.rig.advance(command.drive, self.sample_time)?;
        if command.state.is_some_and(LoopState::is_latched) {
            self.rig.advance(Drive::default(), self.sample_time)?;
            return Err(TrackError::Tripped {
                periods: self.periods,
                fault: command.fault.unwrap_or(Fault::LockLost),
            });
        }
        Ok(command)
    }

    /// One period of the drive.
    fn cycle(&mut self) -> Result<Cycle, TrackError> {
        loop {
            let begin = self.samples.len();
            let phase = self.turns * std::f64::consts::TAU;
            loop {
                let command = self.sample()?;
                let step = command.drive.omega * self.sample_time / std::f64::consts::TAU;
                self.turns += step;
                self.periods += step;
                if self.turns >= 1.0 {
                    self.turns -= 1.0;
                    break;
                }
            }
            if let Some(cycle) = Cycle::of(&self.samples[begin..], self.sample_time, phase, self.target) {
                return Ok(cycle);
            }
        }
    }
}

/// Tracks the backbone of `scene`.
///
/// # Errors
/// A failure of the rig or of the controller, or no lock in the time allowed.
pub fn track(
    rig: &mut (impl Rig + ?Sized),
    controller: &mut (impl Controller + ?Sized),
    scene: &Scene,
    mut progress: impl FnMut(usize, usize),
) -> Result<Tracked, TrackError> {
    let settings = scene.backbone;
    let levels = settings.levels();
    let mut bench = Bench {
        rig,
        controller,
        sample_time: scene.sample_time(),
        target: scene.controller.phase_target_radians(),
        taken: 0,
        turns: 0.0,
        samples: Vec::new(),
        periods: 0.0,
    };
    approach(&mut bench, scene.lock_periods())?;
    let periods_to_lock = bench.periods;
    let d = scene.dimensionless();
    let slow_flow = SlowFlow::new(d.lambda, d.r);
    let mut points: Vec<Point> = Vec::new();
    let mut ended = None;
    for (n, &level) in levels.iter().enumerate() {
        progress(n, levels.len());
        let known: Vec<Known> = points
            .iter()
            .map(|point| Known { c: point.level, g: point.g, sigma: point.sigma })
            .collect();
        let (g, sigma) = predictor::change(settings.predictor, &known, level, &slow_flow);
        bench.controller.hold_response(Move {
            response: level * d.b,
            duration: settings.move_periods * d.natural_period(),
            amplitude: d.amplitude(g),
            omega: d.omega_change(sigma),
        })?;
        match hold(&mut bench, scene, level) {
            Ok(point) => points.push(point),
            // What was measured is kept.
            Err(error) if !points.is_empty() => {
                ended = Some(error.to_string());
                break;
            }
            Err(error) => return Err(error),
        }
    }
    Ok(Tracked { points, periods_to_lock, periods: bench.periods, ended })
}

/// Runs the loop until it is near phase resonance, with the initial drive amplitude.
fn approach<R: Rig + ?Sized, C: Controller + ?Sized>(bench: &mut Bench<R, C>, most: f64) -> Result<(), TrackError> {
    let mut near = 0;
    while near < NEAR_FOR {
        if bench.periods >= most {
            return Err(TrackError::NoLock { periods: most });
        }
        bench.samples.clear();
        let cycle = bench.cycle()?;
        // A motion that is being captured is not to be held yet.
        let captured = bench.samples.last().and_then(|sample| sample.command.state) != Some(LoopState::Capturing);
        let driven = cycle.base.norm() > 0.0 && captured;
        near = if driven && cycle.phase_error.abs() < NEAR {
            near + 1
        } else {
            0
        };
    }
    Ok(())
}

/// Moves to the level and holds it until the point has settled.
fn hold<R: Rig + ?Sized, C: Controller + ?Sized>(
    bench: &mut Bench<R, C>,
    scene: &Scene,
    level: f64,
) -> Result<Point, TrackError> {
    let (settings, d) = (&scene.backbone, scene.dimensionless());
    let start = bench.periods;
    bench.samples.clear();
    while bench.periods - start < settings.move_periods {
        bench.cycle()?;
    }
    let criterion = Criterion {
        tolerance: settings.tolerance,
        precision: settings.precision,
        fewest: settings.dwell_min as usize,
    };
    let mut cycles: Vec<Cycle> = Vec::new();
    let most = settings.dwell_max as usize;
    let found = loop {
        cycles.push(bench.cycle()?);
        let found = criterion.judge(&cycles);
        if found.is_some() || cycles.len() >= most {
            break found;
        }
    };
    let said = found.unwrap_or_else(|| Estimate::of(&cycles[cycles.len() / 2..]));
    let samples = said.periods as f64 * std::f64::consts::TAU / (said.omega * bench.sample_time);
    let averaged = &bench.samples[bench.samples.len().saturating_sub(samples as usize)..];
    Ok(Point {
        level,
        c: said.response / d.b,
        sigma: d.sigma(said.omega),
        g: d.excitation(said.base),
        phase_error_deg: said.phase_error.to_degrees(),
        periods: bench.periods - start,
        regime: regime_by_response(averaged, scene),
        regime_by_impacts: bench.samples[0]
            .ground_truth
            .map(|_| classify(averaged, bench.sample_time, said.omega).1),
        averaged: said.periods,
        settled: found.is_some(),
    })
}
