//! The experiment: lock at phase resonance, hold, release, record the decay.
//!
//! It follows the state of the controller: a controller that switches the drive off ends the experiment at once.

mod search;

use std::f64::consts::TAU;
use std::fmt::{self, Display, Formatter};

use phase_lock::Config;
use thiserror::Error;

use crate::record::{Record, Sample};
use crate::rig::{Command, Controller, ControllerError, Drive, Fault, LoopState, Rig, RigError, Sensors};
use crate::scene::{Resonance, Scene, key};

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
    let mut bench = ControlLoop::new(rig, controller, plan.scene, samples);
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
    bench: &mut ControlLoop<R, C>,
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

// Rig and controller, sample by sample. Whatever fails, the rig is left with a drive of zero as far as it still takes one.

/// Rig and controller, and the samples so far.
pub(crate) struct ControlLoop<'a, R: Rig + ?Sized, C: ?Sized> {
    rig: &'a mut R,
    pub controller: &'a mut C,
    scene: &'a Scene,
    /// s
    pub sample_time: f64,
    pub samples: &'a mut Vec<Sample>,
    /// Samples since the start.
    pub taken: usize,
    /// Phase of the drive since the start, turns.
    pub periods: f64,
    /// Whether the rig was left with a drive.
    driven: bool,
}

impl<'a, R: Rig + ?Sized, C: Controller + ?Sized> ControlLoop<'a, R, C> {
    /// Before the first sample.
    pub fn new(rig: &'a mut R, controller: &'a mut C, scene: &'a Scene, samples: &'a mut Vec<Sample>) -> Self {
        Self {
            rig,
            controller,
            scene,
            sample_time: scene.sample_time(),
            samples,
            taken: 0,
            periods: 0.0,
            driven: false,
        }
    }

    /// One sample; in a stage other than the decay, a controller that switches the drive off is an error.
    pub fn sample(&mut self, stage: Stage) -> Result<Command, ExperimentError> {
        let active = stage != Stage::Decaying;
        let sensors = self.rig.sense()?;
        let command = checked(self.controller.sample(sensors, active)?)?;
        self.samples.push(Sample {
            time: self.taken as f64 * self.sample_time,
            sensors,
            command,
            ground_truth: self.rig.ground_truth()?,
        });
        self.taken += 1;
        self.advance(command.drive)?;
        self.periods += command.drive.omega * self.sample_time / TAU;
        if active && command.state.is_some_and(LoopState::is_latched) {
            self.ramp_down(command)?;
            return Err(self.tripped(stage, &command));
        }
        Ok(command)
    }

    fn advance(&mut self, drive: Drive) -> Result<(), ExperimentError> {
        self.driven = true;
        self.rig.advance(drive, self.sample_time)?;
        self.driven = drive.amplitude != 0.0;
        Ok(())
    }

    /// Follows the controller's ramp after a fault until the drive is off.
    fn ramp_down(&mut self, mut command: Command) -> Result<(), ExperimentError> {
        while command.drive.amplitude > 0.0 {
            let asked = self.controller.sample(self.rig.sense()?, true)?;
            // A ramp never rises, whatever the controller says.
            let amplitude = if asked.drive.amplitude < command.drive.amplitude {
                asked.drive.amplitude
            } else {
                0.0
            };
            command = checked(Command { drive: Drive { amplitude, ..asked.drive }, ..asked })?;
            self.advance(command.drive)?;
        }
        Ok(())
    }

    fn tripped(&self, stage: Stage, command: &Command) -> ExperimentError {
        match command.fault {
            Some(Fault::TimedOut) => self.no_lock(command),
            fault => ExperimentError::Tripped {
                periods: self.periods,
                stage,
                fault: fault.unwrap_or(Fault::LockLost),
                evidence: Box::new(Evidence::of(self.samples, self.scene, |error| self.phase_error(error))),
            },
        }
    }

    /// A phase error, rad, or why there is none.
    fn phase_error(&self, error: Option<f64>) -> PhaseError {
        match error {
            Some(radians) => PhaseError::Degrees(radians.to_degrees()),
            None if self.controller.reports_phase_error() => PhaseError::NotMeasured,
            None => PhaseError::NotReported,
        }
    }

    /// The error of a search without a result.
    pub fn no_lock(&self, command: &Command) -> ExperimentError {
        ExperimentError::NoLock {
            periods: self.periods,
            phase_error: self.phase_error(command.phase_error),
            omega: command.drive.omega,
        }
    }
}

/// An error or a panic must not leave the rig driven.
impl<R: Rig + ?Sized, C: ?Sized> Drop for ControlLoop<'_, R, C> {
    fn drop(&mut self) {
        if self.driven {
            // The run has ended; an error of the rig would not change its result.
            let _ = self.rig.advance(Drive::default(), self.sample_time);
        }
    }
}

/// A command with a drive that a rig can take.
fn checked(command: Command) -> Result<Command, ExperimentError> {
    let Drive { omega, amplitude, displacement } = command.drive;
    if [omega, amplitude, displacement].iter().all(|value| value.is_finite()) {
        Ok(command)
    } else {
        Err(ExperimentError::NotANumber(command.drive))
    }
}

// What the sensors read when the controller switched the drive off, beside the limits of the scene.

/// The last readings before a fault, and the limits that the scene gives the controller.
#[derive(Debug, Clone, Copy)]
pub struct Evidence {
    last: Sensors,
    /// Largest absolute readings of the last period: response and base, m.
    largest: [f64; 2],
    /// Mean of the phase error over the last period, if it could be measured throughout.
    phase_error: PhaseError,
    config: Config,
}

impl Evidence {
    /// The evidence in the last of these samples; `phase_error` makes an error of radians, or of none.
    pub(super) fn of(samples: &[Sample], scene: &Scene, phase_error: impl Fn(Option<f64>) -> PhaseError) -> Self {
        let config = scene.controller_config();
        let period = (TAU / (config.omega_start * config.sample_time)).round() as usize;
        let samples = &samples[samples.len().saturating_sub(period)..];
        let largest = |reading: fn(&Sensors) -> f64| {
            let readings = samples.iter().map(|sample| reading(&sample.sensors).abs());
            readings.fold(0.0, f64::max)
        };
        let errors: Option<Vec<f64>> = samples.iter().map(|sample| sample.command.phase_error).collect();
        Self {
            last: samples.last().map(|sample| sample.sensors).unwrap_or_default(),
            largest: [
                largest(|sensors| sensors.response),
                largest(|sensors| sensors.reference.unwrap_or_default()),
            ],
            phase_error: phase_error(errors.map(|errors| errors.iter().sum::<f64>() / errors.len() as f64)),
            config,
        }
    }

    /// The values that led to `fault`, what the scene allows, and what to do next.
    pub fn text(&self, fault: Fault) -> String {
        let Self { last, largest, phase_error, config } = self;
        let now = self.readings([last.response, last.reference.unwrap_or_default()]);
        let most = self.readings(*largest);
        match fault {
            Fault::Sensor => format!("the response read {now}. {CHECK}"),
            Fault::ResponseTooLarge => {
                let limit = limit("response_max", config.response_max, " m");
                let read = short(largest[0]);
                format!(
                    "it read {read} m, and {limit}. Lower excitation.G or the levels of [backbone], or raise the limit if the rig bears it"
                )
            }
            Fault::LockLost => {
                let error = match phase_error {
                    PhaseError::Degrees(degrees) => format!("was {} degrees", short(*degrees)),
                    PhaseError::NotMeasured => "could not be measured".into(),
                    PhaseError::NotReported => "was not reported by the controller".into(),
                };
                let tolerance = config.lock.unlock_tolerance.to_degrees();
                let limit = limit("lock.unlock_tolerance", Some(tolerance), " degrees");
                format!("in the last period the phase error {error}, and {limit}; the response read at most {most}")
            }
            Fault::NoSignal => {
                let needed = short(config.lock.response_min * config.amplitude);
                let [amplitude, share] = ["lock.response_min", "lock.coherence_min"].map(key);
                let limit = limit("signal_timeout", config.signal_timeout, " s");
                let power = config.lock.coherence_min;
                format!(
                    "in the last period the response read at most {most}. An amplitude of {needed} m ({amplitude}) with a share of {power} of \
                     the power ({share}) is needed, and {limit} without it. {CHECK}"
                )
            }
            Fault::Implausible => {
                let limit = limit(
                    "residual_max",
                    config.residual_max,
                    " of the amplitude as the difference",
                );
                format!("the response read {now}; in the last period at most {most}; {limit}. {CHECK}")
            }
            Fault::TimedOut => limit("acquire_timeout", config.acquire_timeout, " s"),
        }
    }

    /// Readings of both sensors, or of the only one.
    fn readings(&self, [response, base]: [f64; 2]) -> String {
        let (response, base) = (short(response), short(base));
        match self.last.reference {
            Some(_) => format!("{response} m, the base {base} m"),
            None => format!("{response} m"),
        }
    }
}

/// What to do about sensors.
const CHECK: &str = "`vines check` looks for the cause";

/// What the scene allows for a parameter of the controller.
fn limit(parameter: &str, value: Option<f64>, unit: &str) -> String {
    match value {
        Some(value) => format!("{} allows {}{unit}", key(parameter), short(value)),
        None => format!("{} sets no limit", key(parameter)),
    }
}

/// Five digits, with an exponent if the number is very small or large.
fn short(value: f64) -> String {
    let rounded: f64 = format!("{value:.4e}").parse().unwrap_or(value);
    format!("{rounded:?}").trim_end_matches(".0").into()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rig::Command;

    /// A period of readings of both sensors, m, and of phase errors, rad, in the dimensionless default scene.
    fn evidence(settings: &[&str], reading: impl Fn(usize) -> (f64, Option<f64>, Option<f64>)) -> Evidence {
        let settings: Vec<_> = settings.iter().map(|setting| setting.parse().unwrap()).collect();
        let text = include_str!("../../../scenes/dimensionless.toml");
        let scene = Scene::parse("dimensionless.toml", text, &settings).unwrap();
        let sample = |n: usize| {
            let (response, reference, phase_error) = reading(n);
            Sample {
                time: n as f64 * scene.sample_time(),
                sensors: Sensors { response, reference },
                command: Command { phase_error, ..Command::default() },
                ground_truth: None,
            }
        };
        let phase_error =
            |error: Option<f64>| error.map_or(PhaseError::NotMeasured, |error| PhaseError::Degrees(error.to_degrees()));
        Evidence::of(&(0..150).map(sample).collect::<Vec<_>>(), &scene, phase_error)
    }

    #[test]
    fn a_response_above_its_limit_is_stated_beside_the_limit() {
        // The largest reading of the last period, also if the controller switched the drive off a few samples later.
        let found = evidence(&["controller.C_max=0.3"], |n| {
            (if n == 140 { -0.301_234_9 } else { 0.2 }, Some(0.01), None)
        });
        let text = found.text(Fault::ResponseTooLarge);
        assert!(
            text.starts_with("it read 0.30123 m, and controller.C_max allows 0.3 m. Lower"),
            "{text}"
        );
        let without = evidence(&["controller.C_max='none'"], |_| (0.2, None, None));
        let text = without.text(Fault::ResponseTooLarge);
        assert!(text.contains("controller.C_max sets no limit"), "{text}");
    }

    #[test]
    fn a_lost_lock_is_stated_with_its_mean_phase_error_in_degrees() {
        let found = evidence(&[], |n| (0.4, Some(0.01), Some(if n < 50 { 9.0 } else { 0.25 })));
        let text = found.text(Fault::LockLost);
        let expected = "phase error was 14.324 degrees, and phase_lock.lock.unlock_tolerance allows 11.459 degrees; the response read at most 0.4 m, \
                        the base 0.01 m";
        assert!(text.contains(expected), "{text}");
        let text = evidence(&[], |_| (0.4, None, None)).text(Fault::LockLost);
        assert!(text.contains("phase error could not be measured"), "{text}");
    }

    #[test]
    fn a_signal_that_is_missing_is_stated_with_what_a_signal_needs() {
        let found = evidence(&["excitation.G=1"], |_| (1e-7, Some(0.0), None));
        let text = found.text(Fault::NoSignal);
        for part in [
            "read at most 1e-7 m, the base 0 m",
            "0.00084 m (phase_lock.lock.response_min) with a share of 0.5",
            "phase_lock.signal_timeout allows 125.66 s without it",
            "`vines check`",
        ] {
            assert!(text.contains(part), "{part} is not in: {text}");
        }
    }

    #[test]
    fn readings_that_are_refused_are_stated() {
        let found = evidence(&["phase_lock.residual_max=0.2"], |n| {
            (if n == 149 { f64::NAN } else { 0.4 }, None, None)
        });
        let text = found.text(Fault::Sensor);
        assert!(text.starts_with("the response read NaN m. "), "{text}");
        let text = found.text(Fault::Implausible);
        let expected = "read NaN m; in the last period at most 0.4 m; phase_lock.residual_max allows 0.2 of the amplitude as the difference";
        assert!(text.contains(expected), "{text}");
    }
}
