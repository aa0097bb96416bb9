//! The experiment: lock at phase resonance, hold, release, record the decay.
//!
//! It follows the state of the controller: a controller that switches the drive off ends the experiment at once.

mod script;

use std::f64::consts::TAU;

use phase_lock::Config;
use thiserror::Error;
use vines_model::numerics::mean;

use crate::identification::{Cycle, Unsteady, departure};
use crate::record::{Record, Sample};
use crate::rig::{Command, Controller, ControllerError, Drive, Fault, LoopState, Move, Rig, RigError, Scaled, Sensors};
use vines_rig::unit::{Quantity, short};
use vines_scene::knowledge::{Knowledge, Target};
use vines_scene::plan::{DECAYED, Plan};
use vines_scene::scene::{Unit, key};

pub(crate) use script::{Level, Script, is_reached};

/// The stage an experiment is in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stage {
    /// The loop searches for phase resonance.
    Locking,
    /// Phase resonance is held and measured.
    Holding,
    /// The controller ramps the drive down.
    Releasing,
    /// The drive is off.
    Decaying,
    /// The response is held at one level after another.
    Tracking,
}

impl Stage {
    /// Samples of the stage in an experiment, at most: the time limits for the lock and for the release, the hold, or the recorded decay.
    pub fn samples(self, plan: &Plan) -> usize {
        let Plan { lock, hold, ramp, decay, .. } = plan;
        match self {
            Self::Locking => lock
                .acquire_timeout
                .map_or(usize::MAX, |seconds| (seconds / lock.sample_time).round() as usize),
            Self::Holding => *hold,
            Self::Releasing => *ramp,
            Self::Decaying => *decay,
            Self::Tracking => usize::MAX,
        }
    }

    /// What the experiment does in it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Locking => "searching for phase resonance",
            Self::Holding => "holding the lock",
            Self::Tracking => "tracking the backbone",
            Self::Releasing => "releasing the drive",
            Self::Decaying => "recording the decay",
        }
    }
}

/// A phase error in degrees, in words.
fn phase_in_words(error: Option<f64>) -> String {
    error.map_or_else(
        || "the phase cannot be measured, or the controller does not report its phase error".into(),
        |degrees| format!("the phase error is {degrees:.3} degrees"),
    )
}

/// A drive in metres of the oscillator beside the requested amplitude, in the unit of the reference, in words.
fn drive_in_words(drive: Drive, plan: &Plan) -> String {
    let unit = plan.knowledge.target.units.reference;
    let symbol = unit.amplitude();
    let present = if symbol == "F" { "force" } else { "displacement" };
    let (of, metres) = match drive.amplitude {
        0.0 => (format!("{symbol} = 0, but a {present} of"), drive.displacement.abs()),
        amplitude => (format!("{symbol} ="), amplitude),
    };
    let share = short(metres / plan.amplitude);
    format!("{of} {}, {share} times the requested drive", unit.quantity(metres))
}

/// A limit of the response in words: as the scene states it, the displacement at the sensor in m, and of what else a sensor reads, the reading.
fn limit_in_words(limit: f64, target: &Target) -> String {
    let [stated, read] = [target.units.response.quantity(limit), target.quantity(0, limit)];
    match stated.unit == read.unit {
        true => stated.to_string(),
        false => format!("{stated}, a reading of {read}"),
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
        "no lock within {periods:.0} periods of the drive: {} at omega = {omega:.6} rad/s{}",
        phase_in_words(*phase_error), unmet.as_deref().unwrap_or_default()
    )]
    NoLock {
        periods: f64,
        /// Degrees.
        phase_error: Option<f64>,
        omega: f64,
        /// What kept the bench from taking the motion as settled, if the controller does not judge its lock itself.
        unmet: Option<String>,
    },
    #[error("no lock within {periods:.0} periods at the requested drive of {requested}: {found}")]
    NotReached {
        periods: f64,
        requested: Quantity,
        /// What the search has found.
        found: String,
    },
    #[error("no lock: the motion, held at a response of {response:.4e} for {periods} periods, is not steady: {why}")]
    NotSteady {
        periods: usize,
        response: Quantity,
        why: Unsteady,
    },
    #[error("the controller switched the drive off after {periods:.1} periods while {}: {fault}; {evidence}", stage.name())]
    Tripped {
        periods: f64,
        stage: Stage,
        fault: Fault,
        evidence: String,
    },
    #[error("phase or drive are not as asked: {departure}. The run ended with: {error}")]
    OtherThanAsked { departure: String, error: Box<Self> },
    #[error("the scene has no drive, so that nothing can lock")]
    NoDrive,
    #[error("the controller {0}; the drive is off")]
    Refused(String),
    #[error(
        "the response read {response}, and {} allows {limit}, but the controller did not stop; the drive is off",
        key("response_max")
    )]
    ResponseTooLarge { response: Quantity, limit: String },
}

/// Runs the whole experiment, which leaves what was measured in `samples` if it ends early. `progress` receives the stage and the samples taken in it.
pub fn run(
    samples: &mut Vec<Sample>,
    rig: &mut (impl Rig + ?Sized),
    controller: &mut (impl Controller + ?Sized),
    plan: &Plan,
    mut progress: impl FnMut(Stage, usize),
) -> Result<Record, ExperimentError> {
    let mut bench = ControlLoop::new(rig, controller, plan, &plan.lock, samples, &mut progress)?;
    conduct(&mut bench).map_err(|error| {
        bench.switch_off();
        bench.beside_what_was_asked(error)
    })
}

/// The experiment from the search to the end of the decay.
fn conduct<R: Rig + ?Sized, C: Controller + ?Sized>(
    bench: &mut ControlLoop<'_, R, C>,
) -> Result<Record, ExperimentError> {
    let plan = bench.plan;
    let held = Script::new(bench).lock()?;
    let settled = bench.taken - 1;
    for _ in 0..plan.hold {
        bench.sample(Stage::Holding)?;
    }
    let (hold_end, clipped_percent) = (bench.taken, bench.clipped_percent([0; 2]));
    let mut released = hold_end;
    if plan.decay > 0 {
        released = bench.release()?;
        for _ in 1..plan.decay {
            bench.sample(Stage::Decaying)?;
        }
    }
    Ok(Record {
        sample_time: plan.knowledge.sample_time,
        samples: std::mem::take(bench.samples),
        settled,
        held,
        hold_end,
        released,
        clipped_percent,
    })
}

// Rig and controller, sample by sample. Whatever fails, the rig is left with a drive of zero as far as it still takes one.

/// Slowest time constant of the loops, periods.
pub(crate) const SLOWEST_LOOP: f64 = 5.0;
/// Periods within which the loops and the particle follow a change of their setpoint.
pub(crate) const FOLLOWED: usize = 8;
/// Observations in succession that are not taken for chance: periods, or legs of the search.
pub(crate) const CONFIRMED: u32 = 3;

/// Rig and controller, and the samples so far.
pub(crate) struct ControlLoop<'a, R: Rig + ?Sized, C: ?Sized> {
    rig: Scaled<'a, R>,
    pub controller: &'a mut C,
    pub plan: &'a Plan,
    /// Of the controller; its limits guard the rig whatever controls it.
    pub config: &'a Config,
    /// s
    pub sample_time: f64,
    pub samples: &'a mut Vec<Sample>,
    /// Samples since the start.
    pub taken: usize,
    /// Phase of the drive since the start, turns.
    pub periods: f64,
    /// Latest output of the controller.
    pub last: Command,
    /// Receives the stage and the samples taken in it.
    progress: &'a mut dyn FnMut(Stage, usize),
    /// The present stage, and the samples before it.
    stage: (Stage, usize),
    /// Whether the response is under control, so that the drive is what holds it and not the requested one.
    holds_response: bool,
    /// Whether the rig was left with a drive.
    driven: bool,
}

impl<'a, R: Rig + ?Sized, C: Controller + ?Sized> ControlLoop<'a, R, C> {
    /// Before the first sample.
    pub fn new(
        rig: &'a mut R,
        controller: &'a mut C,
        plan: &'a Plan,
        config: &'a Config,
        samples: &'a mut Vec<Sample>,
        progress: &'a mut dyn FnMut(Stage, usize),
    ) -> Result<Self, ExperimentError> {
        if plan.amplitude == 0.0 {
            return Err(ExperimentError::NoDrive);
        }
        Ok(Self {
            rig: Scaled::controlled(rig, &plan.knowledge, config.delay),
            controller,
            plan,
            config,
            sample_time: plan.knowledge.sample_time,
            samples,
            taken: 0,
            periods: 0.0,
            last: Command::default(),
            progress,
            stage: (Stage::Locking, 0),
            holds_response: false,
            driven: false,
        })
    }

    /// One sample. Before the release, a controller that switches the drive off is an error; after it, one that drives.
    pub fn sample(&mut self, stage: Stage) -> Result<(), ExperimentError> {
        if self.stage.0 != stage {
            self.stage = (stage, self.taken);
        }
        let active = !matches!(stage, Stage::Releasing | Stage::Decaying);
        let sensors = self.rig.sense()?;
        let command = self.controller.sample(sensors, active)?;
        let ground_truth = self.rig.ground_truth()?;
        let time = self.taken as f64 * self.sample_time;
        let target = &self.plan.knowledge.target;
        let command = checked(command, target.units.reference)?;
        self.samples
            .push(Sample { time, sensors, command, ground_truth, ..Sample::default() });
        let (is_off, is_latched) = (command.drive.is_off(), command.state.is_some_and(LoopState::is_latched));
        if stage == Stage::Decaying && !is_off {
            return Err(ExperimentError::Refused(format!(
                "drives again: {:.1} periods after it released the drive, it commands {}",
                self.natural_periods(self.taken - self.stage.1 + 1),
                drive_in_words(command.drive, self.plan)
            )));
        }
        if (active || !is_off) && !is_latched {
            guard(self.config, target, sensors.response, command.drive)?;
        }
        self.driven = true;
        self.rig.advance(command.drive, self.sample_time)?;
        if let Some((last, command)) = self.samples.last_mut().zip(self.rig.shaker_command()) {
            last.shaker_command = command;
        }
        self.driven = !is_off;
        self.taken += 1;
        self.last = command;
        self.periods += command.drive.omega * self.sample_time / TAU;
        if active && is_latched {
            self.ramp_down(command)?;
            return Err(self.tripped(stage, &command));
        }
        (self.progress)(stage, self.taken - self.stage.1);
        if stage == Stage::Locking && self.taken >= stage.samples(self.plan) {
            return Err(self.no_lock(&command));
        }
        Ok(())
    }

    /// These samples, in natural periods.
    fn natural_periods(&self, samples: usize) -> f64 {
        samples as f64 * self.sample_time * self.plan.knowledge.linear.omega0 / TAU
    }

    /// Asks the controller to release the drive, and waits for the end of its ramp. Returns the index of the first sample without a drive.
    fn release(&mut self) -> Result<usize, ExperimentError> {
        let ramp = self.plan.ramp;
        for _ in 0..ramp.max(1) {
            self.sample(Stage::Releasing)?;
            if self.last.drive.is_off() {
                return Ok(self.taken - 1);
            }
        }
        Err(ExperimentError::Refused(format!(
            "does not release the drive: {:.1} periods after `active` became false, it commands {}. A ramp may take no longer, because a free \
             response falls to {} % in this time",
            self.natural_periods(ramp),
            drive_in_words(self.last.drive, self.plan),
            100.0 * DECAYED
        )))
    }

    /// Samples so far, and of these the ones with the command of a shaker at the limit of its amplifier.
    pub fn clipped(&self) -> [usize; 2] {
        [self.taken, self.rig.clipped().unwrap_or(0)]
    }

    /// Share of the samples with the command at this limit, per cent, since [`Self::clipped`] has returned `before`; `None` without a shaker.
    pub fn clipped_percent(&self, before: [usize; 2]) -> Option<f64> {
        let clipped = self.rig.clipped()? - before[1];
        Some(100.0 * clipped as f64 / (self.taken - before[0]).max(1) as f64)
    }

    /// Samples to the end of the present period of the drive.
    pub fn period(&mut self, stage: Stage) -> Result<(), ExperimentError> {
        let end = self.periods.floor() + 1.0;
        while self.periods < end {
            self.sample(stage)?;
        }
        Ok(())
    }

    /// The fit of these samples; `None` without a motion.
    pub fn cycle(&mut self, stage: Stage) -> Result<Option<Cycle>, ExperimentError> {
        let (begin, phase) = (self.samples.len(), self.periods * TAU);
        self.period(stage)?;
        Ok(Cycle::of(&self.samples[begin..], phase, &self.plan.knowledge))
    }

    /// Controls the amplitude of the response; the move is one of its displacement.
    pub fn hold_response(&mut self, to: Move) -> Result<(), ControllerError> {
        let target = self.plan.knowledge.target;
        let omega = self.last.drive.omega + to.omega;
        let to = Move {
            response: target.reading(to.response, omega),
            growth: target.reading(to.growth, omega),
            ..to
        };
        self.controller.hold_response(to, target.phase_of_readings())?;
        self.holds_response = true;
        Ok(())
    }

    /// Controls the drive again.
    pub fn hold_drive(&mut self) -> Result<(), ControllerError> {
        self.holds_response = false;
        self.controller.hold_drive()
    }

    /// Follows the controller's ramp after a fault until the drive is off.
    fn ramp_down(&mut self, mut command: Command) -> Result<(), ExperimentError> {
        while command.drive.amplitude > 0.0 {
            let asked = self.controller.sample(self.rig.sense()?, true)?;
            // A ramp never rises, whatever the controller says.
            let falls = |amplitude: &f64| *amplitude < command.drive.amplitude;
            let falling = Some(asked.drive).filter(|drive| falls(&drive.amplitude));
            let reference = self.plan.knowledge.target.units.reference;
            command = checked(Command { drive: falling.unwrap_or_default(), ..asked }, reference)?;
            self.rig.advance(command.drive, self.sample_time)?;
            self.driven = !command.drive.is_off();
        }
        Ok(())
    }

    fn tripped(&self, stage: Stage, command: &Command) -> ExperimentError {
        let fault = command.fault.unwrap_or(Fault::LockLost);
        if fault == Fault::TimedOut {
            return self.no_lock(command);
        }
        let Knowledge { target, shaker, .. } = &self.plan.knowledge;
        let contradicts = shaker.and_then(|path| contradicts(self.samples, self.sample_time, path.drop_out()));
        let evidence = evidence(self.samples, self.config, target, fault, contradicts);
        ExperimentError::Tripped { periods: self.periods, stage, fault, evidence }
    }

    /// The error at the end of a run, after what the controller does otherwise than asked: that another phase or drive has another motion is no fault of
    /// the motion. While the response is under control, the drive follows from it.
    fn beside_what_was_asked(&self, error: ExperimentError) -> ExperimentError {
        let is_of_motion = matches!(
            error,
            ExperimentError::NoLock { .. } | ExperimentError::ResponseTooLarge { .. } | ExperimentError::Tripped { .. }
        );
        let last = &self.samples[self.samples.len().saturating_sub(self.plan.hold)..];
        let departure = departure(last, self.plan).filter(|_| is_of_motion && !self.holds_response);
        match departure {
            Some(departure) => ExperimentError::OtherThanAsked { departure, error: error.into() },
            None => error,
        }
    }

    /// The error of a search without a result.
    fn no_lock(&self, command: &Command) -> ExperimentError {
        ExperimentError::NoLock {
            periods: self.periods,
            phase_error: command.phase_error.map(f64::to_degrees),
            omega: command.drive.omega,
            unmet: None,
        }
    }
}

impl<R: Rig + ?Sized, C: ?Sized> ControlLoop<'_, R, C> {
    fn switch_off(&mut self) {
        if self.driven {
            self.driven = false;
            // The run has ended; an error of the rig would not change its result.
            let _ = self.rig.advance(Drive::default(), self.sample_time);
        }
    }
}

/// An error or a panic must not leave the rig driven.
impl<R: Rig + ?Sized, C: ?Sized> Drop for ControlLoop<'_, R, C> {
    fn drop(&mut self) {
        self.switch_off();
    }
}

/// Refuses a drive or a response beyond the limits of the scene, before the rig gets the drive.
fn guard(config: &Config, target: &Target, response: f64, drive: Drive) -> Result<(), ExperimentError> {
    let Config { amplitude_max, response_max, omega_min, omega_max, .. } = *config;
    let Drive { omega, amplitude, .. } = drive;
    // A controller may compute in single precision.
    let beyond = |value: f64, limit: Option<f64>| limit.filter(|limit| value > limit * (1.0 + 1e-6));
    if let Some(limit) = beyond(amplitude, amplitude_max) {
        let [amplitude, limit, per_metre] =
            [amplitude, limit, 1.0].map(|metres| target.units.reference.quantity(metres));
        let output = match per_metre.unit {
            "N" => format!("the force over {per_metre}/m, in m"),
            _ => "the amplitude of the base in metres".into(),
        };
        return Err(ExperimentError::Refused(format!(
            "asked for {amplitude}, and {} allows {limit}. Its output E is {output}",
            key("amplitude_max")
        )));
    }
    if let Some(limit) = beyond(response.abs(), response_max) {
        let (response, limit) = (target.quantity(0, response), limit_in_words(limit, target));
        return Err(ExperimentError::ResponseTooLarge { response, limit });
    }
    let is_allowed = |omega: f64| (omega_min..=omega_max).contains(&omega);
    if amplitude > 0.0 && !is_allowed(omega) && (is_allowed(omega * TAU) || is_allowed(omega / TAU)) {
        let [asked, least, most] = [omega, omega_min, omega_max].map(short);
        return Err(ExperimentError::Refused(format!(
            "asked for omega = {asked} rad/s; the scene allows {least} to {most} rad/s ({}, {}), and a factor of 2 pi lies between. omega is an \
             angular frequency in rad/s, not in Hz",
            key("omega_min"),
            key("omega_max")
        )));
    }
    Ok(())
}

/// A command with values that a rig and an identification can take; `reference`: the unit of its drive in messages.
fn checked(command: Command, reference: Unit) -> Result<Command, ExperimentError> {
    let Drive { omega, amplitude, displacement, .. } = command.drive;
    let angular = |value, unit| Quantity { value, unit };
    for (name, value, is_signed) in [
        ("omega", angular(omega, "rad/s"), false),
        (reference.amplitude(), reference.quantity(amplitude), false),
        ("drive", reference.quantity(displacement), true),
        ("phase_error", angular(command.phase_error.unwrap_or(0.0), "rad"), true),
    ] {
        if !(value.value.is_finite() && (is_signed || value.value >= 0.0)) {
            let least = if is_signed { "" } else { ", 0 or above" };
            return Err(ExperimentError::Refused(format!(
                "answered {name} = {value}; it must be a finite number{least}"
            )));
        }
    }
    Ok(command)
}

/// What the sensors read in the last period before a fault, and the limit of the scene that was exceeded, in words. `contradicts`: which channel behind a
/// shaker contradicts its past.
fn evidence(
    samples: &[Sample],
    config: &Config,
    target: &Target,
    fault: Fault,
    contradicts: Option<&'static str>,
) -> String {
    let period = (TAU / (config.omega_start * config.sample_time)).round() as usize;
    let driven = samples.len() as f64 * config.sample_time;
    let samples = &samples[samples.len().saturating_sub(period)..];
    let largest = samples
        .iter()
        .map(|sample| sample.sensors.response.abs())
        .fold(0.0, f64::max);
    let last = samples.last().map(|sample| sample.sensors).unwrap_or_default();
    let mut text = String::new();
    if fault == Fault::LockLost {
        let errors: Option<Vec<f64>> = samples.iter().map(|sample| sample.command.phase_error).collect();
        let error = errors.map(|errors| mean(errors).to_degrees());
        text += &format!("over the last period {}; ", phase_in_words(error));
    }
    let reference = last.reference.map(|value| target.quantity(1, value));
    let name = match reference {
        Some(Quantity { unit: "N", .. }) => "force",
        _ => "base",
    };
    if let Some(channel) = contradicts {
        let channel = if channel == "reference" { name } else { channel };
        text += &format!("the {channel} contradicts its past; ");
    }
    text += &format!("the response read {}", target.quantity(0, last.response));
    if let Some(reference) = reference {
        text += &format!(", and the {name} {reference}");
    }
    text += &format!("; in the last period at most {}", target.quantity(0, largest));
    let stated = |limit: Option<f64>, unit| limit.map(|value| Quantity { value, unit }.to_string());
    let (name, limit) = match fault {
        Fault::ResponseTooLarge => {
            let limit = config.response_max.map(|limit| limit_in_words(limit, target));
            ("response_max", limit)
        }
        Fault::LockLost => (
            "lock.unlock_tolerance",
            stated(Some(config.lock.unlock_tolerance), "rad"),
        ),
        // The first periods contradict their drive.
        Fault::NoSignal if config.signal_timeout.is_some_and(|limit| driven < limit) => return text,
        Fault::NoSignal => ("signal_timeout", stated(config.signal_timeout, "s")),
        Fault::Implausible => ("residual_max", stated(config.residual_max, "of the amplitude")),
        Fault::Sensor | Fault::TimedOut => return text,
    };
    text + &format!("; {} is {}", key(name), limit.unwrap_or_else(|| "none".into()))
}

/// Which channel behind a shaker contradicts its past: the one that differs more from what it read a period before, the response over its amplitude,
/// and the force over what the command makes of a structure that does not move, its amplitude over the drop-out: the bench answers an error of the
/// response by as large a share of this.
fn contradicts(samples: &[Sample], sample_time: f64, drop_out: f64) -> Option<&'static str> {
    // The loop may have changed the frequency since the fault.
    let mut left = TAU;
    let is_in_period = |sample: &&Sample| {
        let turn = sample.command.drive.omega * sample_time;
        left -= turn;
        left > 0.5 * turn
    };
    let period = 1 + samples.iter().rev().take_while(is_in_period).count();
    let (before, now) = samples[samples.len().checked_sub(2 * period)?..].split_at(period);
    let change = |of: fn(Sensors) -> f64| {
        let pairs = now.iter().zip(before);
        let changes = pairs.map(|(now, before)| (of(now.sensors) - of(before.sensors)).abs());
        let readings = before.iter().map(|sample| of(sample.sensors).abs());
        // A reading that is no number differs more than any.
        changes.max_by(f64::total_cmp).unwrap_or(0.0) / readings.fold(0.0, f64::max)
    };
    let force = drop_out * change(|sensors| sensors.reference.unwrap_or(0.0));
    let is_force = force.total_cmp(&change(|sensors| sensors.response)).is_gt();
    Some(if is_force { "reference" } else { "response" })
}

#[cfg(test)]
mod tests {
    use super::*;
    use vines_scene::scene::Scene;

    #[test]
    fn a_fault_is_stated_with_the_readings_and_the_limit_of_the_scene() {
        let scene = Scene::load(None, &["phase_lock.response_max=0.3".parse().unwrap()]).unwrap();
        let mut samples = vec![Sample::default(); 150];
        for (n, sample) in samples.iter_mut().enumerate() {
            sample.sensors = Sensors { response: 0.2, reference: Some(0.01) };
            sample.command.phase_error = Some(if n < 50 { 9.0 } else { 0.25 });
        }
        samples[140].sensors.response = -0.301_234_9;
        // The largest reading of the last period, also if the controller switched the drive off a few samples later.
        let read = "the response read 0.2 m, and the base 0.01 m; in the last period at most 0.30123 m";
        for (fault, limit) in [
            (Fault::ResponseTooLarge, "phase_lock.response_max is 0.3 m"),
            (Fault::LockLost, "phase_lock.lock.unlock_tolerance is 0.2 rad"),
            (Fault::LockLost, "the phase error is 14.324 degrees"),
        ] {
            let target = scene.knowledge().target;
            let text = evidence(&samples, &scene.plan().lock, &target, fault, None);
            assert!(text.contains(read) && text.contains(limit), "{text}");
        }
        // Under a force, 0.01 m of the driven mode's base are newtons, and its response is read at the sensor.
        let text = include_str!("../../../scenes/frame.toml");
        let force = Scene::parse("frame.toml", text, &[]).unwrap();
        let target = force.knowledge().target;
        let [newtons, metres] = [
            target.units.reference.of_metres(0.01),
            target.units.response.of_metres(0.2),
        ]
        .map(short);
        let text = evidence(&samples, &force.plan().lock, &target, Fault::Sensor, None);
        assert!(
            text.contains(&format!("the response read {metres} m, and the force {newtons} N")),
            "{text}"
        );
    }

    #[test]
    fn the_channel_that_contradicts_its_past_is_named_whatever_the_bench_makes_of_it() {
        // Readings of response and force, which begin as sines of 100 samples per period.
        let named = |drop_out: f64, read: fn(usize, f64) -> [f64; 2]| {
            let mut samples = vec![Sample::default(); 200];
            for (n, sample) in samples.iter_mut().enumerate() {
                let [response, force] = read(n, (TAU * n as f64 / 100.0).sin());
                sample.sensors = Sensors { response, reference: Some(force) };
                sample.command.drive.omega = TAU;
            }
            contradicts(&samples, 0.01, drop_out).unwrap()
        };
        let reversed = named(0.5, |n, sine| [if n < 130 { sine } else { -sine }, 0.1 * sine]);
        let weak = named(0.5, |n, sine| [sine, if n < 130 { sine } else { 0.3 * sine }]);
        let dead = named(0.02, |n, sine| [sine, if n < 180 { sine } else { 0.0 }]);
        let not_a_number = named(0.5, |n, sine| [if n < 180 { sine } else { f64::NAN }, sine]);
        // The bench has already answered, by much more than the force that was left.
        let answered = named(0.02, |n, sine| {
            [
                sine * if n < 130 { 1.0 } else { 3.0 },
                sine * if n < 150 { 1.0 } else { -20.0 },
            ]
        });
        let names = [reversed, weak, dead, not_a_number, answered];
        assert_eq!(names, ["response", "reference", "reference", "response", "response"]);
    }
}
