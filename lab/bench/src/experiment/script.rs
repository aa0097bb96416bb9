//! The script of every experiment with the response under control: raise it, lower it, hold it.
//!
//! While the response A is controlled, the drive `E_R(A)` that holds it is single-valued. The setpoint moves in legs, each of which measures `E_R`,
//! the frequency and the regime.
//!
//! 1. The loop closes under the requested drive.
//! 2. The response rises until impacts have begun: drive and frequency are beyond every particle that touches no wall.
//! 3. It falls in small legs until the motion is symmetric 1:1.
//! 4. A backbone holds its levels. A lock goes on in small legs until they pass the requested drive, and holds levels there by the secant method, until
//!    `E_R` is the requested drive. The response stays under control.
//!
//! A motion that is symmetric from the start skips steps 2 and 3. Moves stay within the drive that controller, amplifier and shaker allow.

use std::f64::consts::{PI, TAU};

use num_complex::Complex64;
use vines_model::numerics::{Estimate, SIGNIFICANT, lagrange, mean, range};

use super::{CONFIRMED, ControlLoop, ExperimentError, FOLLOWED, SLOWEST_LOOP, Sample, Stage};
use crate::identification::{
    Criterion, Cycle, LONGEST_SETTLING, LevelEstimate, Regime, SAME, Span, Unsteady, is_another, is_wanted,
    regime_by_response, subharmonic, without_tones,
};
use crate::rig::{Controller, ControllerError, LoopState, Move, OFF, Rig};
use vines_rig::unit::short;
use vines_scene::knowledge::Knowledge;
use vines_scene::linear::{DRAWING, POINT_RESOLUTION};
use vines_scene::scene::Units;
use vines_scene::shaker_path::{BANDWIDTH, ShakerPath};

/// Phase error, rad, below which the control of the response begins: the drive then does 94 % of its largest work.
const CONTROL_PHASE_ERROR: f64 = 0.35;
/// Largest relative change of the response in a leg: the stable orbits above the fold span a few percent.
const LEG_CHANGE: f64 = 0.04;
/// Largest additional drive of a move, as a share of the drive that holds the response: as much less drive must be possible, too.
const MOVE_SHARE: f64 = 0.8;
/// Duration of a rise of the response by the half-width, periods.
const RISE: f64 = 60.0;
/// Largest and smallest response of the script over the half-width: a particle that moves freely has hit the walls, and the fold of r = 0.85 is larger.
const RESPONSES: [f64; 2] = [1.5, 0.05];
/// Largest such steepness that legs follow: with less than half a percent, the loops' own transients would count as a change.
const STEEPEST: f64 = 10.0;
/// Smallest ratio of the setpoint to a response that follows it.
const FOLLOWS: f64 = 0.8;

/// Where the loop holds the rig: response amplitude, m, drive amplitude, m, frequency, rad/s.
pub(crate) type Held = [f64; 3];

/// What a leg measured.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Leg {
    /// Response amplitude, m: mean and last.
    response: f64,
    last: f64,
    /// Drive that holds it, m.
    drive: f64,
    /// Frequency, rad/s.
    omega: f64,
    regime: Regime,
}

/// What was measured at a level.
pub(crate) struct Level {
    /// The point, with all of its periods if no window of them is described by the model.
    pub estimate: LevelEstimate,
    /// All periods at the level.
    pub cycles: Vec<Cycle>,
}

/// The script on rig and controller.
pub(crate) struct Script<'b, 'a, R: Rig + ?Sized, C: ?Sized> {
    pub run: &'b mut ControlLoop<'a, R, C>,
    knowledge: &'a Knowledge,
    pub stage: Stage,
    /// Half-width of the cavity, and requested drive, m.
    b: f64,
    requested: f64,
    /// Setpoint of the response, m.
    setpoint: f64,
    /// Where the last leg was.
    moving: Held,
    /// The levels so far.
    pub levels: Vec<Held>,
    /// Smallest and largest response of the legs, m, and the symmetric leg with the drive nearest to the requested one.
    tried: (f64, f64),
    nearest: Option<Held>,
}

impl<'b, 'a, R: Rig + ?Sized, C: Controller + ?Sized> Script<'b, 'a, R, C> {
    pub fn new(run: &'b mut ControlLoop<'a, R, C>) -> Self {
        Self {
            knowledge: &run.plan.knowledge,
            b: run.plan.knowledge.numbers.b,
            requested: run.plan.requested(run.plan.knowledge.linear.omega0),
            run,
            stage: Stage::Locking,
            setpoint: 0.0,
            moving: [0.0; 3],
            levels: Vec::new(),
            tried: (f64::INFINITY, 0.0),
            nearest: None,
        }
    }

    /// Goes to the lock at the requested drive and holds it. Returns whether the response is under control there: without a loop for it, the controller
    /// waits under the constant drive.
    pub fn lock(&mut self) -> Result<bool, ExperimentError> {
        let is_held = self.knowledge.is_at_phase_resonance() && self.hold_requested()?;
        if !is_held {
            self.wait()?;
        }
        Ok(is_held)
    }

    /// Goes to a symmetric motion with impacts, if there is one, and holds its response.
    pub fn impacts(&mut self) -> Result<Leg, ExperimentError> {
        let leg = self.begin()?;
        self.symmetric(leg, LEG_CHANGE)
    }

    /// The lock with the response under control; false if the controller cannot control it.
    fn hold_requested(&mut self) -> Result<bool, ExperimentError> {
        let leg = match self.begin() {
            Err(ExperimentError::Controller(ControllerError::NoResponseLoop(_))) => return Ok(false),
            leg => leg?,
        };
        if self.takes_no_moves() {
            self.run.hold_drive()?;
            return Ok(false);
        }
        match self.reach(leg) {
            Ok(()) => Ok(true),
            Err(ExperimentError::NoLock { .. }) => Err(self.not_reached(true)),
            Err(error) => Err(error),
        }
    }

    /// Goes to the requested drive: from where the motion is to where a constant drive would hold it, too, as it rises with the response; or else from the
    /// largest symmetric motion downwards, in smaller legs, to any.
    fn reach(&mut self, mut leg: Leg) -> Result<(), ExperimentError> {
        for (step, is_last) in [(LEG_CHANGE, false), (0.5 * LEG_CHANGE, true)] {
            leg = self.symmetric(leg, step)?;
            let mut step = if leg.drive < self.requested { step } else { -step };
            let mut steepness = 1.0;
            while self.is_symmetric(leg.regime) && self.setpoint > RESPONSES[1] * self.b {
                self.note_held([leg.response, leg.drive, leg.omega]);
                let before = leg;
                leg = self.sweep(&leg, step / steepness)?;
                if !self.is_symmetric(leg.regime) {
                    // A change may disturb the symmetry for a while.
                    leg = self.leg(0.0, FOLLOWED, 0.0)?;
                }
                steepness = self.steepness([before, leg]);
                // The drive of the next leg, if it goes on like this.
                let next = 2.0 * leg.drive - before.drive;
                let passes = (before.drive - self.requested) * (next - self.requested) <= 0.0;
                let rises = (leg.drive - before.drive) * (leg.response - before.response) > 0.0;
                if self.is_symmetric(leg.regime) && passes && (rises || is_last) {
                    if self.secant([before, leg], step.abs())? {
                        return Ok(());
                    }
                    leg = self.leg(0.0, FOLLOWED, 0.0)?;
                }
                if !self.is_symmetric(leg.regime) {
                    // Above the symmetric motion is one without symmetry, which may go on far below.
                    step = -step.abs();
                    leg = self.fall(leg, step)?;
                }
            }
        }
        Err(self.not_reached(false))
    }

    /// Whether the controller kept its drive, to the last bit, while it was to control the response: one elsewhere may ignore what it does not know.
    fn takes_no_moves(&self) -> bool {
        let last = self
            .run
            .samples
            .iter()
            .rev()
            .take(self.knowledge.samples(FOLLOWED as f64));
        let mut amplitudes = last.map(|sample| sample.command.drive.amplitude);
        let first = amplitudes.next();
        amplitudes.all(|amplitude| Some(amplitude) == first)
    }

    /// Waits under the constant drive until the controller says that the lock has settled. The bench measures it where the controller does not say it,
    /// and behind a filter, as controllers take noise for white.
    fn wait(&mut self) -> Result<(), ExperimentError> {
        let (mut cycles, mut confirmed) = (Vec::new(), 0);
        while confirmed < CONFIRMED {
            let cycle = self.cycle();
            if self.run.last.settled == Some(true) {
                return Ok(());
            }
            let is_judged = self.run.last.settled.is_none() || self.knowledge.target.filter.is_some();
            let cycle = cycle.map_err(|error| match error {
                ExperimentError::NoLock { periods, phase_error, omega, .. } if is_judged => {
                    let unmet = self.criterion().best(&cycles).map(|one| self.unmet(&one));
                    ExperimentError::NoLock { periods, phase_error, omega, unmet }
                }
                error => error,
            })?;
            cycles.push(cycle);
            cycles.drain(..cycles.len().saturating_sub(LONGEST_SETTLING));
            let criterion = self.criterion();
            let estimate = criterion.best(&cycles).filter(|one| is_judged && criterion.is_met(one));
            // At rest, the drive that holds the response is the one that is measured.
            let is_settled = estimate.is_some_and(|one| {
                let last = &cycles[cycles.len() - one.periods..];
                let drive = mean(last.iter().map(|cycle| cycle.base.norm()));
                self.is_near(&one, drive) && self.is_in_phase(&one)
            });
            confirmed = if is_settled { confirmed + 1 } else { 0 };
        }
        Ok(())
    }

    /// What keeps the bench from taking a motion under the constant drive as settled, in words.
    fn unmet(&self, estimate: &LevelEstimate) -> String {
        let unmet = match estimate.unsteady {
            Some(unsteady) => unsteady.to_string(),
            None => {
                let Estimate { value, uncertainty } = estimate.at[1].scaled(1.0 / self.requested);
                format!("the drive that holds the response is {value:.4} ± {uncertainty:.1e} times the requested one")
            }
        };
        format!("; the bench measures the lock, as the controller does not: {unmet}")
    }

    /// Closes the loop and begins to control the response.
    fn begin(&mut self) -> Result<Leg, ExperimentError> {
        let mut near = 0;
        while near < CONFIRMED {
            let cycle = self.run.cycle(self.stage)?;
            let state = self.run.last.state;
            let closed = state.is_none_or(|state| matches!(state, LoopState::Acquiring | LoopState::Locked));
            let is_near = cycle.is_some_and(|cycle| {
                self.setpoint = cycle.amplitude();
                cycle.phase_error.abs() < CONTROL_PHASE_ERROR
            });
            near = if closed && is_near { near + 1 } else { 0 };
        }
        self.leg(0.0, FOLLOWED, 0.0)
    }

    /// Whether a motion is the one that is wanted, as far as noise shows it: where motions have no mirror images, it is asymmetric.
    fn is_symmetric(&self, regime: Regime) -> bool {
        is_wanted(regime, self.knowledge.is_symmetric)
    }

    /// Whether the motion is of this kind also at rest, at its setpoint. It takes twice as long as a leg to come to rest.
    fn rests(&mut self, leg: &mut Leg, is_kind: impl Fn(&Self, Regime) -> bool) -> Result<bool, ExperimentError> {
        if is_kind(self, leg.regime) {
            *leg = self.leg(0.0, FOLLOWED, 0.0)?;
        }
        if is_kind(self, leg.regime) {
            *leg = self.measure(FOLLOWED, Span::AtRest)?;
        }
        let is_there = (leg.last / self.setpoint - 1.0).abs() < LEG_CHANGE;
        Ok(is_there && is_kind(self, leg.regime))
    }

    /// Goes to a symmetric motion with impacts: raises the response until they have begun, and lowers it until the motion is symmetric.
    fn symmetric(&mut self, mut leg: Leg, step: f64) -> Result<Leg, ExperimentError> {
        while !(has_impacts(leg.regime) && leg.response > (1.0 - DRAWING) * self.b) {
            // A rise may resemble impacts; at rest the setpoint tells them apart.
            if self.rests(&mut leg, Self::is_symmetric)? {
                return Ok(leg);
            }
            let spare = self.largest(leg.response) - leg.drive;
            if leg.response > RESPONSES[0] * self.b || spare < DRAWING * leg.drive {
                break;
            }
            let change = (self.b / RISE).min(0.5 * MOVE_SHARE * PI * spare) * FOLLOWED as f64;
            leg = self.leg(leg.last + change - self.setpoint, FOLLOWED, change / FOLLOWED as f64)?;
        }
        self.fall(leg, -step)
    }

    /// Lowers the response as long as it follows, until the motion is symmetric, but not on after impacts have ended. A large response can hide them:
    /// beside a carried particle, their evidence grows as the response falls.
    fn fall(&mut self, mut leg: Leg, step: f64) -> Result<Leg, ExperimentError> {
        let mut seen = has_impacts(leg.regime);
        let has_none = |_: &Self, regime| regime == Regime::NoImpacts;
        while !(self.rests(&mut leg, Self::is_symmetric)? || seen && self.rests(&mut leg, has_none)?)
            && self.setpoint > (RESPONSES[1] * self.b).max(FOLLOWS * leg.last)
        {
            leg = self.sweep(&leg, step)?;
            seen |= has_impacts(leg.regime);
        }
        Ok(leg)
    }

    /// Change of the drive, or of the frequency over the half-power bandwidth E/A, over that of the response between two legs, relative; at least 1. Near the
    /// fold both change much faster than the response.
    fn steepness(&self, [before, leg]: [Leg; 2]) -> f64 {
        let turned = (leg.omega - before.omega) / self.knowledge.linear.omega0 * leg.response;
        let changed = (leg.drive - before.drive).abs().max(turned.abs()) / leg.drive;
        (changed / (leg.response / before.response - 1.0))
            .abs()
            .clamp(1.0, STEEPEST)
    }

    /// Holds levels by the secant method, in steps of this share of the response at most, until the requested drive holds the response at the phase
    /// target. Returns false if the motion is lost.
    fn secant(&mut self, [before, leg]: [Leg; 2], step: f64) -> Result<bool, ExperimentError> {
        let mut slope = (leg.drive - before.drive) / (leg.response - before.response);
        // A leg, and then levels.
        let (mut at, mut is_level) = ([leg.response, leg.drive], false);
        loop {
            let largest = step * at[0];
            let to = at[0] + ((self.requested - at[1]) / slope).clamp(-largest, largest);
            let criterion = self.criterion();
            let Level { estimate, cycles } = self.hold(to, &criterion)?;
            // As a leg at rest: over the longest time, a beat would be irregular, too.
            let last = self.last(&cycles[cycles.len().saturating_sub(FOLLOWED)..]);
            let regime = regime_by_response(last, self.knowledge, estimate.at, Span::AtRest);
            // A level need not show impacts: the legs have.
            if !(self.is_symmetric(regime) || regime == Regime::NotEstablished) {
                return Ok(false);
            }
            let [response, drive, omega] = estimate.at.map(|one| one.value);
            self.note_held([response, drive, omega]);
            let (next, u_drive) = ([response, drive], estimate.at[1].uncertainty);
            let is_within = !is_another(drive - self.requested, u_drive, self.requested);
            // No nearer than half of the distance before: noise is what is left.
            let is_stuck = is_level && (next[1] - self.requested).abs() > 0.5 * (at[1] - self.requested).abs();
            let not_steady = estimate.unsteady.filter(|_| !criterion.is_met(&estimate));
            let not_steady = not_steady.filter(|why| matches!(why, Unsteady::Scatter(_)));
            if self.is_in_phase(&estimate) && (is_within && is_stuck || self.is_near(&estimate, self.requested)) {
                match not_steady {
                    None => return Ok(true),
                    Some(why) if is_stuck => return Err(self.not_steady(why, &estimate, &cycles)),
                    // What disturbs a motion may still decay.
                    Some(_) => {}
                }
            }
            // Noise hides what changes between near levels, but not that the slope predicts another change.
            let [far, changed] = [next[0] - at[0], next[1] - at[1]];
            if is_level && (changed - slope * far).abs() > SIGNIFICANT * u_drive {
                slope = changed / far;
            }
            (at, is_level) = (next, true);
        }
    }

    /// The motion at a level is not steady after the longest time.
    fn not_steady(&self, why: Unsteady, estimate: &LevelEstimate, cycles: &[Cycle]) -> ExperimentError {
        let samples = self.averaged(estimate, cycles);
        let repeats = subharmonic(samples, self.knowledge, estimate.at[2].value).map(Unsteady::Repeats);
        ExperimentError::NotSteady {
            periods: cycles.len(),
            response: self.knowledge.target.units.response.quantity(estimate.at[0].value),
            why: repeats.unwrap_or(why),
        }
    }

    /// Whether the drive that holds the response is `drive`, m, as far as its uncertainty and the resolution of a point show.
    fn is_near(&self, estimate: &LevelEstimate, drive: f64) -> bool {
        let Estimate { value, uncertainty } = estimate.at[1];
        (value - drive).abs() < (SIGNIFICANT * uncertainty).max(POINT_RESOLUTION * drive)
    }

    /// Whether the phase is as near to its target as a lock must be.
    fn is_in_phase(&self, estimate: &LevelEstimate) -> bool {
        let Estimate { value, uncertainty } = estimate.phase_error;
        value.abs() <= self.run.plan.lock.lock.phase_tolerance.max(SIGNIFICANT * uncertainty)
    }

    /// What is asked of a level on its own.
    pub fn criterion(&self) -> Criterion {
        Criterion {
            knowledge: *self.knowledge,
            precision: self.run.plan.precision,
            largest: self.setpoint,
            before: [None; 2],
        }
    }

    /// One period of the drive.
    pub fn cycle(&mut self) -> Result<Cycle, ExperimentError> {
        loop {
            if let Some(cycle) = self.run.cycle(self.stage)? {
                return Ok(cycle);
            }
        }
    }

    /// Goes to a level, m, and holds it until the point has settled, or for the longest time allowed.
    pub fn hold(&mut self, level: f64, criterion: &Criterion) -> Result<Level, ExperimentError> {
        let start = self.run.periods;
        let (to, periods) = self.step(level);
        self.setpoint = level;
        self.run.hold_response(to)?;
        // The legs disturb the particle.
        let late = (self.followed(level) + 3 * FOLLOWED * usize::from(self.levels.is_empty())) as f64;
        while self.run.periods - start < periods + late {
            self.cycle()?;
        }
        let (mut cycles, mut confirmed) = (Vec::new(), 0);
        let estimate = loop {
            cycles.push(self.cycle()?);
            let estimate = criterion.best(&cycles);
            let is_met =
                estimate.is_some_and(|estimate| criterion.is_met(&estimate) && is_reached(estimate.at[0], level));
            // The halves of a transient can agree by chance.
            confirmed = if is_met { confirmed + 1 } else { 0 };
            if cycles.len() >= LONGEST_SETTLING || confirmed >= CONFIRMED {
                break estimate;
            }
        };
        let estimate = estimate.unwrap_or_else(|| LevelEstimate::means(&cycles[cycles.len() / 2..]));
        let held = estimate.at.map(|quantity| quantity.value);
        if held.iter().all(|value| value.is_finite()) {
            // Of points at one level, as at a limit of the drive, only the last one predicts the next.
            self.levels.retain(|before| (before[0] - held[0]).abs() > SAME * level);
            self.levels.push(held);
        }
        Ok(Level { estimate, cycles })
    }

    /// The regime of the periods of a level that its estimate is from.
    pub fn regime(&self, estimate: &LevelEstimate, cycles: &[Cycle]) -> Regime {
        regime_by_response(self.averaged(estimate, cycles), self.knowledge, estimate.at, Span::Held)
    }

    /// The samples of these periods, the last that were taken.
    pub fn averaged(&self, estimate: &LevelEstimate, cycles: &[Cycle]) -> &[Sample] {
        self.last(&cycles[cycles.len() - estimate.periods..])
    }

    /// The samples of the last cycles.
    fn last(&self, cycles: &[Cycle]) -> &[Sample] {
        let count = cycles.iter().map(|cycle| cycle.samples).sum::<usize>();
        &self.run.samples[self.run.samples.len() - count..]
    }

    /// Periods within which the loops, the control of a shaker and what rings beside the driven mode follow a move to this level, m.
    ///
    /// The move changes what rings by its own share at most, of which less than the precision is left.
    fn followed(&self, level: f64) -> usize {
        let Knowledge { shaker, rings, target, .. } = self.knowledge;
        // Both roots of the control of a shaker are at half of its bandwidth.
        let of_control = |path: ShakerPath| FOLLOWED as f64 / SLOWEST_LOOP / (PI * BANDWIDTH * path.speed);
        let of_control = shaker.map_or(0.0, of_control).min(LONGEST_SETTLING as f64).ceil();
        let share = (level / self.here()[0] - 1.0).abs() / self.run.plan.precision;
        // In these periods the pole that rings longest falls by a factor of e.
        let ringing = rings[0].map_or(0.0, |pole| target.omega0 / (TAU * -pole.re));
        let rung_down = (ringing * share.ln()).clamp(0.0, LONGEST_SETTLING as f64).ceil();
        FOLLOWED.max(of_control as usize).max(rung_down as usize)
    }

    /// The move to a level, m, and its periods: half of what the loops follow in, or as many as the drive needs for this change of the response; and behind a shaker, before and
    /// after the middle, as many as the control of the force needs to correct an error.
    fn step(&self, level: f64) -> (Move, f64) {
        let [response, drive, omega] = self.here();
        // A smooth move is twice as fast in its middle as on average.
        let late = self.knowledge.shaker.map_or(0.0, |path| 2.0 * OFF / (TAU * path.speed));
        let periods = f64::max(0.5 * FOLLOWED as f64, self.periods(level - response, level, drive)) + late;
        let expected = extrapolated(&self.levels, level);
        let [amplitude, omega] = expected.map_or([0.0; 2], |there| [there[0] - drive, there[1] - omega]);
        let to = Move {
            response: level,
            duration: periods * self.knowledge.numbers.natural_period(),
            amplitude,
            omega,
            growth: 0.0,
        };
        (to, periods)
    }

    /// Where the loop holds the rig: at the last level, or in the last leg.
    fn here(&self) -> Held {
        *self.levels.last().unwrap_or(&self.moving)
    }

    /// Periods for a change of the response to `level`, m, from where `drive`, m, holds it. The additional drive makes it grow by pi times as much per
    /// period.
    fn periods(&self, change: f64, level: f64, drive: f64) -> f64 {
        let spare = if change > 0.0 {
            self.largest(level) - drive
        } else {
            f64::INFINITY
        };
        let additional = spare.min(MOVE_SHARE * drive);
        let periods = change.abs() / (0.5 * PI * additional);
        if (0.0..LONGEST_SETTLING as f64).contains(&periods) {
            periods
        } else {
            LONGEST_SETTLING as f64
        }
    }

    /// Largest drive, m, that controller, amplifier and shaker allow at this response, m. Behind a shaker, the command for a drive F and the response z is
    /// `(F + (r - d) z/g)/K` ([`ShakerPath`]), whatever else acts on the structure.
    fn largest(&self, response: f64) -> f64 {
        let of_controller = self.run.config.amplitude_max.unwrap_or(f64::INFINITY);
        let of_shaker = self
            .knowledge
            .shaker
            .filter(|path| path.largest.is_finite())
            .map(|path| {
                let response = Complex64::from_polar(response, self.knowledge.target.phase);
                let taken = (path.pole - path.damping_rate) / self.knowledge.linear.gain * response;
                let square = (path.gain.norm() * path.largest).powi(2) - taken.im.powi(2);
                square.max(0.0).sqrt() - taken.re
            });
        of_shaker.unwrap_or(f64::INFINITY).min(of_controller)
    }

    /// A leg by a share of the response, which lets the change go on at its rate.
    fn sweep(&mut self, leg: &Leg, share: f64) -> Result<Leg, ExperimentError> {
        let change = share * leg.last;
        let periods = FOLLOWED.max(self.periods(change, leg.last + change, leg.drive).ceil() as usize);
        self.leg(change, periods, change / periods as f64)
    }

    /// Moves the setpoint by `change`, m, within `periods` and measures meanwhile. The setpoint ends, and goes on, with the growth `onward`, m per period.
    fn leg(&mut self, change: f64, periods: usize, onward: f64) -> Result<Leg, ExperimentError> {
        let period = self.knowledge.numbers.natural_period();
        let to = Move {
            response: (self.setpoint + change).max(RESPONSES[1] * self.b),
            duration: periods as f64 * period,
            growth: onward / period,
            ..Move::default()
        };
        self.run.hold_response(to)?;
        self.setpoint = to.response;
        self.measure(periods, Span::Moving)
    }

    /// Measures over `periods`, without foreign tones, which disturb so few periods.
    fn measure(&mut self, periods: usize, span: Span) -> Result<Leg, ExperimentError> {
        let (begin, turns) = (self.run.samples.len(), self.run.periods);
        for _ in 0..periods.max(LevelEstimate::FEWEST) {
            self.run.period(self.stage)?;
        }
        let raw = &self.run.samples[begin..];
        let omega = mean(raw.iter().map(|sample| sample.command.drive.omega));
        let cleaned = without_tones(raw, self.knowledge, omega);
        let samples = cleaned.as_deref().unwrap_or(raw);
        let cycles = Cycle::all(samples, turns, self.knowledge);
        let Some(fit) = LevelEstimate::of(&cycles, self.knowledge, None, false) else {
            return self.measure(periods, span);
        };
        let [response, drive, omega] = fit.at.map(|one| one.value);
        let leg = Leg {
            response,
            last: cycles[cycles.len() - 1].amplitude(),
            drive,
            omega,
            regime: regime_by_response(samples, self.knowledge, fit.at, span),
        };
        self.moving = [response, drive, omega];
        self.levels.clear();
        self.tried = range(self.tried, [response]);
        Ok(leg)
    }

    /// Notes where the motion is the one that is wanted.
    fn note_held(&mut self, held: Held) {
        let distance = |held: &Held| (held[1] - self.requested).abs();
        if self.nearest.is_none_or(|nearest| distance(&held) < distance(&nearest)) {
            self.nearest = Some(held);
        }
    }

    /// The requested drive was not reached; `late`: because the time is over. Responses are displacements at the sensor.
    fn not_reached(&self, late: bool) -> ExperimentError {
        let Units { response, reference, .. } = self.knowledge.target.units;
        let [low, high] = [self.tried.0, self.tried.1].map(|metres| response.quantity(metres));
        let found = match self.nearest {
            None => "none was symmetric and nonlinear".into(),
            Some([at, drive, _]) => format!(
                "that of {} had the nearest drive, {}, {} times the requested one",
                response.quantity(at),
                reference.quantity(drive),
                short(drive / self.requested)
            ),
        };
        let why = match (late, self.nearest) {
            (true, _) => "; the time was over (phase_lock.acquire_timeout)",
            (_, None) => {
                ". A particle at rest needs a velocity (start.dq2) or a larger drive (phase_lock.amplitude_max, chain.base_range)"
            }
            (_, Some(_)) => "; beyond it the motion was lost. `vines backbone` tracks the drives that hold one",
        };
        ExperimentError::NotReached {
            periods: self.run.periods,
            requested: reference.quantity(self.requested),
            found: format!("of responses from {low} to {high} {found}{why}"),
        }
    }
}

/// Whether a motion has impacts, as far as noise shows it.
fn has_impacts(regime: Regime) -> bool {
    !matches!(regime, Regime::NoImpacts | Regime::NotEstablished | Regime::Unknown)
}

/// Whether a response, m, is at the level, m.
pub(crate) fn is_reached(Estimate { value, uncertainty }: Estimate, level: f64) -> bool {
    (value - level).abs() <= (SAME * level).max(4.0 * uncertainty)
}

/// Drive, m, and frequency, rad/s, at the amplitude `response`, m, on the polynomial through the last points, three at most; `None` without any.
fn extrapolated(points: &[Held], response: f64) -> Option<[f64; 2]> {
    let points = &points[points.len().saturating_sub(3)..];
    let responses: Vec<f64> = points.iter().map(|point| point[0]).collect();
    let weighted = points.iter().zip(lagrange(&responses, response));
    let expected = weighted.fold([0.0; 2], |sum, (point, weight)| {
        [sum[0] + weight * point[1], sum[1] + weight * point[2]]
    });
    (!points.is_empty() && expected.iter().all(|value| value.is_finite())).then_some(expected)
}
