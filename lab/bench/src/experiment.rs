//! The experiment: lock at phase resonance, hold, release, record the decay.

use thiserror::Error;

use crate::rig::{Command, Controller, ControllerError, Drive, GroundTruth, Rig, RigError, Sensors};
use crate::scene::Scene;
use vines_model::theory::{B_SYMMETRY_BREAKING, BackbonePoint, SlowFlow};

/// Durations of the stages, in samples.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Plan {
    /// Time from sample to sample, s.
    pub sample_time: f64,
    /// Time limit for the lock.
    pub lock: usize,
    /// How long the lock is held and recorded once it has settled.
    pub hold: usize,
    /// Length of the recorded decay.
    pub decay: usize,
}

impl Plan {
    /// The plan of a scene.
    #[must_use]
    pub fn of(scene: &Scene) -> Self {
        let sample_time = scene.sample_time();
        let period = scene.dimensionless().natural_period();
        let samples = |periods: f64| (periods * period / sample_time).round() as usize;
        Self {
            sample_time,
            lock: samples(scene.record.lock_periods),
            hold: samples(scene.record.hold_periods),
            decay: samples(decay_periods(scene)),
        }
    }
}

/// Length of the recorded decay over the one that theory expects.
const DECAY_MARGIN: f64 = 1.25;
/// Longest recorded decay, natural periods, that is not asked for.
const LONGEST_DECAY: f64 = 5000.0;
/// Periods more than that, for the loss of synchrony to show.
const DECAY_EXTRA: f64 = 10.0;

/// Length of the recorded decay, natural periods: that of the scene, or as long as first-order theory expects synchrony to last
/// from symmetry breaking on, with a margin.
fn decay_periods(scene: &Scene) -> f64 {
    if scene.record.decay_periods > 0.0 {
        return scene.record.decay_periods;
    }
    let d = scene.dimensionless();
    let flow = SlowFlow::new(d.lambda, d.r);
    let stable = flow.phase_resonant(d.g).into_iter().filter(BackbonePoint::stable);
    let from = stable.map(|point| point.b).fold(f64::NAN, f64::max);
    let from = if from.is_nan() { B_SYMMETRY_BREAKING } else { from };
    let duration = flow.decay(from).map_or(0.0, |decay| decay.duration()) / (d.epsilon * std::f64::consts::TAU);
    (DECAY_MARGIN * duration + DECAY_EXTRA).min(LONGEST_DECAY)
}

/// The stage an experiment is in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stage {
    /// The loop searches for phase resonance.
    Locking,
    /// Phase resonance is held and measured.
    Holding,
    /// The drive is off.
    Decaying,
}

/// One sample of the record.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample {
    /// Time, s.
    pub time: f64,
    /// What the sensors read.
    pub sensors: Sensors,
    /// Output of the controller: the drive from this sample to the next.
    pub command: Command,
    /// The ground truth of a simulated rig.
    pub ground_truth: Option<GroundTruth>,
}

/// Phases of the drive at the samples, rad, from `start` at the first.
#[must_use]
pub fn drive_phases(samples: &[Sample], sample_time: f64, start: f64) -> Vec<f64> {
    let advance = |phase: &mut f64, sample: &Sample| {
        let now = *phase;
        *phase += sample.command.drive.omega * sample_time;
        Some(now)
    };
    samples.iter().scan(start, advance).collect()
}

/// Everything that was measured.
#[derive(Debug, Clone, PartialEq)]
pub struct Record {
    /// Time from sample to sample, s.
    pub sample_time: f64,
    /// The samples, from the start on.
    pub samples: Vec<Sample>,
    /// Index of the sample at which the lock had settled.
    pub settled: usize,
    /// Index of the first sample with the drive off.
    pub released: usize,
}

impl Record {
    /// The samples between the settled lock and the release.
    #[must_use]
    pub fn hold(&self) -> &[Sample] {
        &self.samples[self.settled..self.released]
    }

    /// The samples from the release on.
    #[must_use]
    pub fn decay(&self) -> &[Sample] {
        &self.samples[self.released..]
    }
}

/// Why an experiment ended early.
#[derive(Debug, Error)]
pub enum ExperimentError {
    /// The rig failed.
    #[error(transparent)]
    Rig(#[from] RigError),
    /// The controller failed.
    #[error(transparent)]
    Controller(#[from] ControllerError),
    /// The loop found no stationary phase resonance in the time allowed.
    #[error(
        "no lock within {periods:.0} periods of the drive: the phase error is {phase_error:.3} degrees at omega = {omega:.6} rad/s; \
         see record.lock_periods and the [controller] section"
    )]
    NoLock {
        /// Time limit, natural periods.
        periods: f64,
        /// Last phase error, degrees.
        phase_error: f64,
        /// Last frequency, rad/s.
        omega: f64,
    },
}

/// Runs the whole experiment. `progress` receives the stage, the samples taken in it, and their largest number.
///
/// # Errors
/// A failure of the rig or of the controller, or no lock in the time allowed.
pub fn run(
    rig: &mut (impl Rig + ?Sized),
    controller: &mut (impl Controller + ?Sized),
    plan: &Plan,
    mut progress: impl FnMut(Stage, usize, usize),
) -> Result<Record, ExperimentError> {
    let mut samples = Vec::new();
    let mut step = |active| -> Result<Command, ExperimentError> {
        let sensors = rig.sense()?;
        let command = match controller.sample(sensors, active) {
            Ok(command) => command,
            Err(error) => {
                // A failed controller must not leave the rig driven. An error of the rig would not change the result.
                let _ = rig.advance(Drive::default(), plan.sample_time);
                return Err(error.into());
            }
        };
        samples.push(Sample {
            time: samples.len() as f64 * plan.sample_time,
            sensors,
            command,
            ground_truth: rig.ground_truth()?,
        });
        rig.advance(command.drive, plan.sample_time)?;
        Ok(command)
    };

    let mut settled = 0;
    loop {
        let command = step(true)?;
        progress(Stage::Locking, settled, plan.lock);
        if command.settled {
            break;
        }
        settled += 1;
        if settled >= plan.lock {
            return Err(ExperimentError::NoLock {
                periods: plan.lock as f64 * plan.sample_time * command.drive.omega / std::f64::consts::TAU,
                phase_error: command.phase_error.to_degrees(),
                omega: command.drive.omega,
            });
        }
    }
    for n in 0..plan.hold {
        step(true)?;
        progress(Stage::Holding, n + 1, plan.hold);
    }
    for n in 0..plan.decay {
        step(false)?;
        progress(Stage::Decaying, n + 1, plan.decay);
    }
    Ok(Record {
        sample_time: plan.sample_time,
        released: samples.len() - plan.decay,
        samples,
        settled,
    })
}
