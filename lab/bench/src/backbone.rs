//! Tracking of the backbone with the loop closed: the controller holds the response at one level after another until it has
//! settled, and the drive amplitude and the frequency are measured.
//!
//! Under a constant drive, the response would take dozens of periods to settle at every level. The controller therefore controls
//! the *response*, and the drive follows. The points before predict drive and frequency of the next one,
//! so that the loops have little to correct.

use std::f64::consts::{PI, TAU};
use std::fmt::{self, Display, Formatter};

use serde::Serialize;
use vines_model::numerics::Estimate;
use vines_rig::unit::Quantity;

use crate::experiment::{self, CONFIRMED, ExperimentError, FOLLOWED, SLOWEST_LOOP, Search, Stage};
use crate::identification::{
    Criterion, Cycle, LONGEST_SETTLING, LevelEstimate, Regime, ResonancePoint, Tone, Unsteady, classify,
    drive_harmonics, foreign_tone, is_off_target, mean_command, regime_by_response,
};
use crate::record::Sample;
use crate::rig::{Controller, Move, OFF, Rig};
use vines_scene::knowledge::Knowledge;
use vines_scene::plan::Plan;
use vines_scene::shaker_path::{BANDWIDTH, ShakerPath};

/// One point of the backbone.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct LevelPoint {
    /// The point: frequency and base amplitude of phase resonance at this amplitude of the response.
    #[serde(flatten)]
    pub at: ResonancePoint,
    /// Target level, over b.
    pub level: f64,
    /// Periods of the move to this level and at this level.
    pub periods: f64,
    /// Periods averaged.
    pub averaged: usize,
    /// The motion was steady within these uncertainties, on the level, and neither irregular nor asymmetric; otherwise the point was taken at the
    /// time limit.
    pub settled: bool,
    /// The response reached the level; otherwise the drive was at a limit, or the time too short.
    pub reached: bool,
    /// What in its periods is not noise.
    #[serde(skip)]
    pub unsteady: Option<Unsteady>,
    /// The regime that the response alone shows if the rig contains a particle. In files it is the motion without that assumption.
    #[serde(rename = "motion", serialize_with = "Regime::serialize_motion")]
    pub regime: Regime,
    /// The regime determined from the impacts, if the rig is a simulation.
    pub regime_by_impacts: Option<Regime>,
    /// A tone in the response that is not part of the motion.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tone: Option<Tone>,
    /// Harmonics 2 to 7 of what a shaker drives the structure with, force or displacement of the table, over its first, as measured.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub drive_harmonics: Option<[f64; 6]>,
    /// Share of the samples of the move to this level and at it with the command at the limit of the shaker's amplifier, per cent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub clipped_percent: Option<f64>,
    /// Mean amplitude of the command of a shaker over the averaged periods, V.
    #[serde(rename = "command_V", skip_serializing_if = "Option::is_none")]
    pub command_v: Option<f64>,
}

impl LevelPoint {
    /// Why the point has not settled, on a rig whose motions have mirror images or not; `None` if it has.
    pub fn unsettled(&self, is_symmetric: bool) -> Option<String> {
        let Estimate { value: drive, uncertainty } = self.at.drive();
        Some(match self.regime {
            _ if self.settled => return None,
            _ if !self.reached => "the response does not reach the level".into(),
            _ if is_off_target(self.at.phase_error_deg.to_radians(), self.at.u_phase_deg.to_radians()) => {
                format!(
                    "the phase is {:+.2} degrees off controller.phase_target",
                    self.at.phase_error_deg
                )
            }
            Regime::Other => "the motion is irregular".into(),
            Regime::Asymmetric if is_symmetric => "the motion is asymmetric".into(),
            _ => match self.unsteady {
                Some(unsteady) => format!("the motion is not steady: {unsteady}"),
                None => format!(
                    "{} periods give the drive to {:.2} % only",
                    self.averaged,
                    100.0 * uncertainty / drive
                ),
            },
        })
    }
}

/// The tracked backbone.
#[derive(Debug)]
pub struct Tracked {
    /// What is known of the rig.
    pub knowledge: Knowledge,
    /// The points, in the order in which they were taken.
    pub points: Vec<LevelPoint>,
    /// Periods from the start to the closed loop.
    pub periods_to_lock: f64,
    /// All periods, from the start to the last point.
    pub periods: f64,
    /// Where the curve ended before the last level; absent if it did not.
    pub end: Option<CurveEnd>,
    /// Why tracking failed before the last level; absent if it did not.
    pub ended: Option<ExperimentError>,
}

/// Where a backbone ends: at its fold, or where the motion changes otherwise.
#[derive(Debug, Clone, Copy)]
pub struct CurveEnd {
    /// The last response with the 1:1 motion, and the level without it.
    pub between: [Quantity; 2],
    /// Both over the half-width.
    pub c: [f64; 2],
    /// The motion at the level.
    pub regime: Regime,
    /// The rig does not report impacts: nothing is then said of a particle.
    pub is_silent: bool,
}

impl Display for CurveEnd {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let ([held, level], [c, beyond]) = (self.between, self.c);
        match self.is_silent {
            true => write!(
                f,
                "The backbone ends between responses of {held:.4e} and {level:.4e}: the motion there is {}",
                self.regime.motion()
            ),
            false => write!(
                f,
                "The backbone ends between {held:.4e} (C = {c:.4}) and {level:.4e} (C = {beyond:.4}): the motion there is {}",
                self.regime
            ),
        }
    }
}

/// Where the loop holds the rig: response amplitude, m, drive amplitude, m, frequency, rad/s.
type Held = [f64; 3];

/// Additional periods before the first level is measured, because the start of the loop disturbs the particle, too.
const FIRST_PERIODS: usize = 24;
/// Largest additional drive of a move, as a share of the drive that holds the response.
const MOVE_SHARE: f64 = 0.8;
/// Shortest duration of a move, periods.
const SHORTEST_MOVE: f64 = 4.0;
/// Largest ratio of successive levels. The points before predict drive and frequency of the next one; where it is farther away, the error of the
/// prediction moves the response past a fold. Levels between are held, but no points.
const LARGEST_STEP: f64 = 1.5;
/// Largest relative difference of the response from its level that counts as reached.
const REACHED: f64 = 0.01;

/// Rig and controller, read period by period.
struct Tracker<'a, R: Rig + ?Sized, C: ?Sized> {
    run: experiment::ControlLoop<'a, R, C>,
    plan: &'a Plan,
    stage: Stage,
    /// Where the loop was closed.
    closed: Held,
    /// The points so far.
    states: Vec<Held>,
    points: Vec<LevelPoint>,
}

/// Tracks the backbone.
///
/// # Errors
/// A failure of the rig or of the controller, or no lock in the time allowed.
pub fn track(
    rig: &mut (impl Rig + ?Sized),
    controller: &mut (impl Controller + ?Sized),
    plan: &Plan,
    progress: impl FnMut(usize, usize),
) -> Result<Tracked, ExperimentError> {
    track_into(&mut Vec::new(), rig, controller, plan, progress)
}

/// [`track`], which leaves what was measured last in `samples` if it ends before the first point.
pub fn track_into(
    samples: &mut Vec<Sample>,
    rig: &mut (impl Rig + ?Sized),
    controller: &mut (impl Controller + ?Sized),
    plan: &Plan,
    progress: impl FnMut(usize, usize),
) -> Result<Tracked, ExperimentError> {
    let mut quiet = |_, _| {};
    let mut tracker = Tracker {
        run: experiment::ControlLoop::new(rig, controller, plan, &plan.tracking, samples, &mut quiet)?,
        plan,
        stage: Stage::Locking,
        closed: [0.0; 3],
        states: Vec::new(),
        points: Vec::new(),
    };
    tracker.approach()?;
    let periods_to_lock = tracker.run.periods;
    tracker.stage = Stage::Tracking;
    let (end, ended) = match tracker.follow(progress) {
        // What was measured is kept.
        Err(error) if tracker.points.is_empty() => return Err(error),
        Err(error) => (None, Some(error)),
        Ok(end) => (end, None),
    };
    let (points, periods) = (std::mem::take(&mut tracker.points), tracker.run.periods);
    Ok(Tracked {
        knowledge: plan.knowledge,
        points,
        periods_to_lock,
        periods,
        end,
        ended,
    })
}

impl<R: Rig + ?Sized, C: Controller + ?Sized> Tracker<'_, R, C> {
    /// One period of the drive.
    fn cycle(&mut self) -> Result<Cycle, ExperimentError> {
        loop {
            let period = self.run.period(self.stage)?;
            if let Some(cycle) = self.run.cycle(period, self.plan.knowledge.target) {
                return Ok(cycle);
            }
        }
    }

    /// Goes to a symmetric motion with impacts, if there is one.
    fn approach(&mut self) -> Result<(), ExperimentError> {
        Search::new(&mut self.run).impacts()?;
        let cycle = self.cycle()?;
        self.closed = [cycle.amplitude(), cycle.base.norm(), cycle.omega];
        Ok(())
    }

    /// Goes through the levels. Returns where the curve ended before the last one.
    fn follow(&mut self, mut progress: impl FnMut(usize, usize)) -> Result<Option<CurveEnd>, ExperimentError> {
        let levels = &self.plan.levels;
        for (n, &level) in levels.iter().enumerate() {
            progress(n, levels.len());
            let mut before = n
                .checked_sub(1)
                .map(|before| (levels[before], self.points[before].regime));
            if let Some((from, _)) = before {
                for between in between(from, level) {
                    before = Some((between, self.hold(between)?.regime));
                }
            }
            let point = self.hold(level)?;
            self.points.push(point);
            let Some((held, Regime::Symmetric | Regime::Unresolved)) = before else {
                continue;
            };
            // Only where impacts are reported does a motion without them mean that they have ended.
            let is_silent = point.regime_by_impacts.is_none();
            if point.regime == Regime::Other || point.regime == Regime::NoImpacts && !is_silent {
                let Knowledge { target, numbers, .. } = &self.plan.knowledge;
                return Ok(Some(CurveEnd {
                    between: [held, level].map(|metres| target.units.response.quantity(metres)),
                    c: [held, level].map(|metres| metres / numbers.b),
                    regime: point.regime,
                    is_silent,
                }));
            }
        }
        Ok(None)
    }

    /// Goes to a level, m, and holds it until the point has settled, or for the longest time allowed.
    fn hold(&mut self, level: f64) -> Result<LevelPoint, ExperimentError> {
        let (start, clipped) = (self.run.periods, self.run.clipped());
        let (to, periods) = self.step(level);
        self.run.hold_response(to)?;
        if self.plan.knowledge.shaker.is_some() {
            // A fault is named from the last two periods.
            let kept = self.plan.knowledge.samples(2.5);
            self.run.samples.drain(..self.run.samples.len().saturating_sub(kept));
        } else {
            self.run.samples.clear();
        }
        let late = self.followed(level) + FIRST_PERIODS * usize::from(self.states.is_empty());
        while self.run.periods - start < periods + late as f64 {
            self.cycle()?;
        }
        let criterion = self.criterion();
        let mut cycles: Vec<Cycle> = Vec::new();
        let mut confirmed = 0;
        let estimate = loop {
            cycles.push(self.cycle()?);
            let estimate = criterion.best(&cycles);
            let is_met =
                estimate.is_some_and(|estimate| criterion.is_met(&estimate) && is_reached(estimate.response, level));
            // The halves of a transient can agree by chance.
            confirmed = if is_met { confirmed + 1 } else { 0 };
            if cycles.len() >= LONGEST_SETTLING || confirmed >= CONFIRMED {
                break estimate;
            }
        };
        let estimate = estimate.unwrap_or_else(|| LevelEstimate::means(&cycles[cycles.len() / 2..]));
        let [drive, omega] = estimate.at.map(|quantity| quantity.value);
        if drive.is_finite() && omega.is_finite() {
            let response = estimate.response.value;
            // Of points at one level, as at a limit of the drive, only the last one predicts the next.
            self.states
                .retain(|state| (state[0] - response).abs() > REACHED * level);
            self.states.push([response, drive, omega]);
        }
        let clipped_percent = self.run.clipped_percent(clipped);
        Ok(LevelPoint {
            clipped_percent,
            ..self.point(level, start, &estimate, &cycles, &criterion)
        })
    }

    /// Periods within which the loops, the control of a shaker and what rings beside the driven mode follow a move to this level, m.
    ///
    /// The move changes what rings by its own share at most, of which less than the precision is left.
    fn followed(&self, level: f64) -> usize {
        let Knowledge { shaker, ringing, .. } = self.plan.knowledge;
        // Both roots of the control of a shaker are at half of its bandwidth.
        let of_control = |path: ShakerPath| FOLLOWED as f64 / SLOWEST_LOOP / (PI * BANDWIDTH * path.speed);
        let of_control = shaker.map_or(0.0, of_control).min(LONGEST_SETTLING as f64).ceil();
        let [from, ..] = self.states.last().unwrap_or(&self.closed);
        let share = (level / from - 1.0).abs() / self.plan.precision;
        let rung_down = (ringing * share.ln()).clamp(0.0, LONGEST_SETTLING as f64).ceil();
        FOLLOWED.max(of_control as usize).max(rung_down as usize)
    }

    /// The move to a level, m, and its periods: [`SHORTEST_MOVE`], or as many as the drive needs for this change of the response; and behind a shaker, before and
    /// after the middle, as many as the control of the force needs to correct an error.
    fn step(&self, level: f64) -> (Move, f64) {
        let omega0 = self.plan.knowledge.linear.omega0;
        let [response, drive, omega] = *self.states.last().unwrap_or(&self.closed);
        let slowest = (level - response).abs() / (MOVE_SHARE * 0.5 * drive * TAU);
        // A smooth move is twice as fast in its middle as on average.
        let late = self
            .plan
            .knowledge
            .shaker
            .map_or(0.0, |path| 2.0 * OFF / (TAU * path.speed));
        let periods = SHORTEST_MOVE.max(2.0 * slowest) + late;
        let expected = extrapolated(&self.states, level);
        let [amplitude, omega] = expected.map_or([0.0; 2], |there| [there[0] - drive, there[1] - omega]);
        let to = Move {
            response: level,
            duration: periods * TAU / omega0,
            amplitude,
            omega,
            growth: 0.0,
        };
        (to, periods)
    }

    /// The point of an estimate from the last of some periods, for a move that began at `start`, in periods.
    fn point(
        &self,
        level: f64,
        start: f64,
        estimate: &LevelEstimate,
        cycles: &[Cycle],
        criterion: &Criterion,
    ) -> LevelPoint {
        let knowledge = &self.plan.knowledge;
        let d = knowledge.numbers;
        let samples = cycles[cycles.len() - estimate.periods..]
            .iter()
            .map(|cycle| cycle.samples);
        let averaged = &self.run.samples[self.run.samples.len() - samples.sum::<usize>()..];
        let [base, omega] = estimate.at;
        let regime = regime_by_response(averaged, knowledge, base, omega);
        let reached = is_reached(estimate.response, level);
        LevelPoint {
            at: ResonancePoint::new([estimate.response, base, omega, estimate.phase_error], knowledge),
            // The level as a person would write it.
            level: (1e9 * level / d.b).round() / 1e9,
            periods: self.run.periods - start,
            averaged: estimate.periods,
            // An irregular motion can seem steady for a while; where motions have mirror images, an asymmetric one is no point of this
            // backbone.
            settled: reached
                && regime != Regime::Other
                && (regime != Regime::Asymmetric || !knowledge.is_symmetric)
                && (estimate.unsteady.is_none() || criterion.is_met(estimate)),
            reached,
            unsteady: estimate.unsteady,
            regime,
            regime_by_impacts: self.run.samples[0]
                .ground_truth
                .map(|_| classify(averaged, self.run.sample_time, omega.value).1),
            tone: foreign_tone(averaged, knowledge, omega.value),
            drive_harmonics: knowledge
                .shaker
                .and_then(|_| drive_harmonics(averaged, knowledge, omega.value)),
            clipped_percent: None,
            command_v: mean_command(averaged, knowledge),
        }
    }

    /// The criterion for a settled point.
    fn criterion(&self) -> Criterion {
        let before = |back: usize| self.states.iter().nth_back(back).copied();
        Criterion {
            knowledge: self.plan.knowledge,
            precision: self.plan.precision,
            largest: self.plan.levels.iter().copied().fold(0.0, f64::max),
            before: [before(1), before(0)],
        }
    }
}

/// Levels, m, between two that are more than [`LARGEST_STEP`] apart, at equal ratios.
fn between(from: f64, to: f64) -> impl Iterator<Item = f64> {
    let ratio = (to / from).ln();
    let steps = (ratio.abs() / LARGEST_STEP.ln()).ceil();
    (1..steps as usize).map(move |n| from * (ratio * n as f64 / steps).exp())
}

/// Whether a response, m, is at the level, m.
fn is_reached(Estimate { value, uncertainty }: Estimate, level: f64) -> bool {
    (value - level).abs() <= (REACHED * level).max(4.0 * uncertainty)
}

/// Drive, m, and frequency, rad/s, at the amplitude `response`, m, on the polynomial through the last points, three at most; `None` without any.
fn extrapolated(states: &[Held], response: f64) -> Option<[f64; 2]> {
    let points = &states[states.len().saturating_sub(3)..];
    let weights = points.iter().enumerate().map(|(i, point)| {
        let others = points.iter().enumerate().filter(|(j, _)| *j != i);
        others
            .map(|(_, previous)| (response - previous[0]) / (point[0] - previous[0]))
            .product::<f64>()
    });
    let expected = points.iter().zip(weights).fold([0.0; 2], |sum, (point, weight)| {
        [sum[0] + weight * point[1], sum[1] + weight * point[2]]
    });
    (!points.is_empty() && expected.iter().all(|value| value.is_finite())).then_some(expected)
}
