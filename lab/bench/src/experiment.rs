//! The experiment: lock at phase resonance, hold, release, record the decay.
//!
//! It follows the state of the controller: a controller that switches the drive off ends the experiment at once.

mod bench;
mod evidence;
mod search;

use std::fmt::{self, Display, Formatter};

use thiserror::Error;

use crate::record::{Record, Sample};
use crate::rig::{Controller, ControllerError, Drive, Fault, Rig, RigError};
use crate::scene::{Resonance, Scene};

pub(crate) use bench::Bench;
pub use evidence::Evidence;
pub(crate) use search::Search;

/// Durations of the stages, in samples.
#[derive(Debug, Clone, Copy)]
pub struct Plan<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// Time from sample to sample, s.
    pub sample_time: f64,
    /// Time limit for the lock.
    pub lock: usize,
    /// How long the lock is held and recorded once it has settled.
    pub hold: usize,
    /// Length of the recorded decay.
    pub decay: usize,
}

impl<'a> Plan<'a> {
    /// The plan of a scene.
    pub fn of(scene: &'a Scene) -> Self {
        let sample_time = scene.sample_time();
        let period = scene.dimensionless().natural_period();
        let samples = |periods: f64| (periods * period / sample_time).round() as usize;
        Self {
            scene,
            sample_time,
            lock: samples(scene.lock_periods()),
            hold: samples(scene.record.hold_periods),
            decay: samples(decay_periods(scene)),
        }
    }
}

/// Share of its amplitude to which the response of the linear rig falls in the recorded decay: the range of the 1:1 motion, from
/// symmetry breaking to the fold, is smaller, and impacts make the decay faster.
const DECAYED: f64 = 0.05;
/// Longest recorded decay, natural periods, that is not asked for.
const LONGEST_DECAY: f64 = 5000.0;

/// Length of the recorded decay, natural periods: that of the scene, or as long as the linear rig takes to fall to [`DECAYED`].
fn decay_periods(scene: &Scene) -> f64 {
    let relaxations = -DECAYED.ln();
    let periods = scene.record.decay_periods;
    periods.unwrap_or((relaxations * scene.relaxation_periods()).min(LONGEST_DECAY))
}

/// The stage an experiment is in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stage {
    /// The loop searches for phase resonance.
    Locking,
    /// Phase resonance is held and measured.
    Holding,
    /// The response is held at one level after another.
    Tracking,
    /// The drive is off.
    Decaying,
}

impl Stage {
    /// What the experiment does in it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Locking => "searching for phase resonance",
            Self::Holding => "holding the lock",
            Self::Tracking => "tracking the backbone",
            Self::Decaying => "recording the decay",
        }
    }
}

/// The phase error of a controller, or why there is none.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum PhaseError {
    /// Its size, degrees.
    Degrees(f64),
    /// The signals have no measurable phase.
    NotMeasured,
    /// The controller does not say it.
    NotReported,
}

impl Display for PhaseError {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        match self {
            Self::Degrees(degrees) => write!(f, "the phase error is {degrees:.3} degrees"),
            Self::NotMeasured => write!(f, "the phase cannot be measured"),
            Self::NotReported => write!(
                f,
                "the controller does not report its phase error (an FMU does by the output `phase_error`, which [controller_names] can map)"
            ),
        }
    }
}

/// Why an experiment ended early.
#[derive(Debug, Error)]
#[expect(missing_docs, reason = "the messages explain the variants")]
pub enum ExperimentError {
    #[error(transparent)]
    Rig(#[from] RigError),
    #[error(transparent)]
    Controller(#[from] ControllerError),
    #[error(
        "no lock within {periods:.0} periods of the drive: {phase_error} at omega = {omega:.6} rad/s; \
         see record.lock_periods and the [controller] section"
    )]
    NoLock {
        periods: f64,
        phase_error: PhaseError,
        omega: f64,
    },
    #[error("the requested drive G = {g:.4} was not reached within {periods:.0} periods: {why}")]
    NotReached { periods: f64, g: f64, why: String },
    #[error("the controller switched the drive off after {periods:.1} periods while {}: {fault}; {}", stage.name(), evidence.text(*fault))]
    Tripped {
        periods: f64,
        stage: Stage,
        fault: Fault,
        evidence: Box<Evidence>,
    },
    #[error(
        "the 1:1 motion, held at {held:.4e} m (C = {:.4}), is {regime} at {level:.4e} m (C = {:.4}): the backbone ends between the two, or the \
         step was too large; set backbone.A_to or C_to nearer to the former, or more backbone.points",
        held / b, level / b
    )]
    MotionLost {
        held: f64,
        level: f64,
        b: f64,
        regime: crate::identification::Regime,
    },
    #[error(
        "resonance.definition = \"peak\" is for theory and exact orbits (`vines theory`, `vines orbit`): the loop holds a phase, and measures the \
         backbone with resonance.definition = \"phase\""
    )]
    Peak,
    #[error("the controller asked for omega = {} rad/s and E = {} m, which is refused; the drive is off", .0.omega, .0.amplitude)]
    NotANumber(Drive),
}

/// Runs the whole experiment. `progress` receives the stage, the samples taken in it, and their largest number.
pub fn run(
    rig: &mut (impl Rig + ?Sized),
    controller: &mut (impl Controller + ?Sized),
    plan: &Plan,
    progress: impl FnMut(Stage, usize, usize),
) -> Result<Record, ExperimentError> {
    run_into(&mut Vec::new(), rig, controller, plan, progress)
}

/// As [`run`]; if the experiment ends early, what was measured stays in `samples`.
pub fn run_into(
    samples: &mut Vec<Sample>,
    rig: &mut (impl Rig + ?Sized),
    controller: &mut (impl Controller + ?Sized),
    plan: &Plan,
    mut progress: impl FnMut(Stage, usize, usize),
) -> Result<Record, ExperimentError> {
    holds_a_phase(plan.scene)?;
    let mut bench = Bench::new(rig, controller, plan.scene, samples);
    let held = if plan.scene.controller.is_at_phase_resonance() {
        let mut searched = |taken| progress(Stage::Locking, taken, plan.lock);
        Search::new(&mut bench, plan.scene, plan.lock, &mut searched).lock()?
    } else {
        None
    };
    if held.is_none() {
        wait(&mut bench, plan, &mut progress)?;
    }
    let (settled, held) = (bench.taken - 1, held == Some(true));
    for n in 0..plan.hold {
        bench.sample(Stage::Holding)?;
        progress(Stage::Holding, n + 1, plan.hold);
    }
    for n in 0..plan.decay {
        bench.sample(Stage::Decaying)?;
        progress(Stage::Decaying, n + 1, plan.decay);
    }
    drop(bench);
    let samples = std::mem::take(samples);
    Ok(Record {
        sample_time: plan.sample_time,
        released: samples.len() - plan.decay,
        samples,
        settled,
        held,
    })
}

/// Refuses a scene whose resonance is no phase that a loop can hold.
pub(crate) fn holds_a_phase(scene: &Scene) -> Result<(), ExperimentError> {
    match scene.resonance.resonance {
        Resonance::Phase => Ok(()),
        Resonance::Peak => Err(ExperimentError::Peak),
    }
}

/// Waits for the lock under the constant drive, for a controller that cannot control the response.
fn wait<R: Rig + ?Sized, C: Controller + ?Sized>(
    bench: &mut Bench<R, C>,
    plan: &Plan,
    progress: &mut impl FnMut(Stage, usize, usize),
) -> Result<(), ExperimentError> {
    loop {
        let command = bench.sample(Stage::Locking)?;
        progress(Stage::Locking, bench.taken, plan.lock);
        if command.settled {
            return Ok(());
        }
        if bench.taken >= plan.lock {
            return Err(bench.no_lock(&command));
        }
    }
}
