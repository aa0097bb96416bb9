//! Tracking of the backbone with the loop closed: the controller holds the response at one level after another until it has
//! settled, and the drive amplitude and the frequency are measured.
//!
//! Under a constant drive, the response would take dozens of periods to settle at every level. The controller therefore controls
//! the *response*, and the drive follows. The points before predict drive and frequency of the next one,
//! so that the loops have little to correct.

use serde::Serialize;

use crate::experiment::{ControlLoop, ExperimentError, Level, Script, Stage, is_reached};
use crate::identification::{
    Criterion, Regime, ResonancePoint, Tone, Unsteady, classify, drive_harmonics, foreign_tone, is_off_target,
    mean_command,
};
use crate::record::Sample;
use crate::rig::{Controller, Rig};
use vines_scene::knowledge::Knowledge;
use vines_scene::plan::Plan;

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
    /// The motion was steady within these uncertainties, at its phase target and on the level, neither irregular nor asymmetric, and its readings within
    /// their ranges; otherwise [`LevelPoint::unsettled`] says why.
    pub settled: bool,
    /// The response reached the level; otherwise the drive was at a limit, or the time too short.
    pub reached: bool,
    /// The key of the range whose end its readings reach, where a converter saturates.
    #[serde(skip)]
    pub saturated: Option<&'static str>,
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
        if let Some(range) = self.saturated {
            return Some(format!("readings are at the end of {range}"));
        }
        Some(match self.regime {
            _ if !self.reached => "the response does not reach the level".into(),
            _ if is_off_target(self.at.phase_error_deg.to_radians(), self.at.u_phase_deg.to_radians()) => {
                format!(
                    "the phase is {:+.2} degrees off controller.phase_target",
                    self.at.phase_error_deg
                )
            }
            // An irregular motion can seem steady for a while; where motions have mirror images, an asymmetric one is no point of this backbone.
            Regime::Other => "the motion is irregular".into(),
            Regime::Asymmetric if is_symmetric => "the motion is asymmetric".into(),
            _ => format!("the motion is not steady: {}", self.unsteady?),
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
    /// Where the curve ended before the last level, at its fold or where the motion changes otherwise, in words; absent if it did not.
    pub end: Option<String>,
    /// Why tracking failed before the last level; absent if it did not.
    pub ended: Option<ExperimentError>,
}

/// Largest ratio of successive levels. The points before predict drive and frequency of the next one; where it is farther away, the error of the
/// prediction moves the response past a fold. Levels between are held, but no points.
const LARGEST_STEP: f64 = 1.5;

/// The script, and the points so far.
struct Tracker<'b, 'a, R: Rig + ?Sized, C: ?Sized> {
    script: Script<'b, 'a, R, C>,
    plan: &'a Plan,
    points: Vec<LevelPoint>,
    /// Where the motion of the curve ended, in words.
    end: Option<String>,
}

/// Tracks the backbone, and leaves what was measured last in `samples` if it ends before the first point. `progress` receives the number of levels done.
///
/// # Errors
/// A failure of the rig or of the controller, or no lock in the time allowed.
pub fn track(
    samples: &mut Vec<Sample>,
    rig: &mut (impl Rig + ?Sized),
    controller: &mut (impl Controller + ?Sized),
    plan: &Plan,
    progress: impl FnMut(usize),
) -> Result<Tracked, ExperimentError> {
    let mut quiet = |_, _| {};
    let mut run = ControlLoop::new(rig, controller, plan, &plan.tracking, samples, &mut quiet)?;
    let mut tracker = Tracker {
        script: Script::new(&mut run),
        plan,
        points: Vec::new(),
        end: None,
    };
    tracker.script.impacts()?;
    let periods_to_lock = tracker.script.run.periods;
    tracker.script.stage = Stage::Tracking;
    let followed = tracker.follow(progress);
    let Tracker { points, end, .. } = tracker;
    let (end, ended) = match (followed, end) {
        // What was measured is kept.
        (Err(error), _) if points.is_empty() => return Err(error),
        // Without the motion of the curve, response or drive may be too small for the controller.
        (Err(error @ ExperimentError::Tripped { .. }), Some(end)) => {
            (Some(format!("{end}. After that, {error}")), None)
        }
        (Err(error), _) => (None, Some(error)),
        (Ok(has_ended), end) => (end.filter(|_| has_ended), None),
    };
    Ok(Tracked {
        knowledge: plan.knowledge,
        points,
        periods_to_lock,
        periods: run.periods,
        end,
        ended,
    })
}

impl<R: Rig + ?Sized, C: Controller + ?Sized> Tracker<'_, '_, R, C> {
    /// Goes through the levels. Returns whether the curve has ended.
    fn follow(&mut self, mut progress: impl FnMut(usize)) -> Result<bool, ExperimentError> {
        let levels = &self.plan.levels;
        for (n, &level) in levels.iter().enumerate() {
            progress(n);
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
            let is_silent = point.regime_by_impacts.is_none();
            match (before, point.regime) {
                (_, Regime::Symmetric | Regime::Unresolved | Regime::Asymmetric) => self.end = None,
                (Some((held, Regime::Symmetric | Regime::Unresolved)), regime) => {
                    let Knowledge { target, numbers, .. } = &self.plan.knowledge;
                    let [from, to] = [held, level].map(|metres| target.units.response.quantity(metres));
                    let [c, beyond] = [held, level].map(|metres| metres / numbers.b);
                    // Nothing is said of a particle on a rig that does not report impacts.
                    self.end = Some(match is_silent {
                        true => format!(
                            "The backbone ends between responses of {from:.4e} and {to:.4e}: the motion there is {}",
                            regime.motion()
                        ),
                        false => format!(
                            "The backbone ends between {from:.4e} (C = {c:.4}) and {to:.4e} (C = {beyond:.4}): the motion there is {regime}"
                        ),
                    });
                }
                _ => {}
            }
            // Only where impacts are reported does a motion without them mean that they have ended: a spring fades into the linear response.
            let has_ended = point.regime == Regime::Other || point.regime == Regime::NoImpacts && !is_silent;
            if has_ended && self.end.is_some() {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// Goes to a level, m, and holds it until the point has settled, or for the longest time allowed.
    fn hold(&mut self, level: f64) -> Result<LevelPoint, ExperimentError> {
        let run = &mut self.script.run;
        let (start, clipped) = (run.periods, run.clipped());
        // A fault behind a shaker is named from the last two periods.
        let kept = self
            .plan
            .knowledge
            .shaker
            .map_or(0, |_| self.plan.knowledge.samples(2.5));
        run.samples.drain(..run.samples.len().saturating_sub(kept));
        let criterion = self.criterion();
        let Level { estimate, cycles } = self.script.hold(level, &criterion)?;
        let (run, knowledge) = (&self.script.run, &self.plan.knowledge);
        let averaged = self.script.averaged(&estimate, &cycles);
        let omega = estimate.at[2].value;
        let mut point = LevelPoint {
            at: ResonancePoint::new(estimate.at, estimate.phase_error, knowledge),
            // The level as a person would write it.
            level: (1e9 * level / knowledge.numbers.b).round() / 1e9,
            periods: run.periods - start,
            averaged: estimate.periods,
            settled: false,
            reached: is_reached(estimate.at[0], level),
            saturated: knowledge.target.saturated(averaged.iter().map(|sample| sample.sensors)),
            unsteady: estimate.unsteady,
            regime: self.script.regime(&estimate, &cycles),
            regime_by_impacts: averaged[0]
                .ground_truth
                .map(|_| classify(averaged, knowledge.sample_time, omega).1),
            tone: foreign_tone(averaged, knowledge, omega),
            drive_harmonics: knowledge
                .shaker
                .and_then(|_| drive_harmonics(averaged, knowledge, omega)),
            clipped_percent: run.clipped_percent(clipped),
            command_v: mean_command(averaged, knowledge),
        };
        point.settled = point.unsettled(knowledge.is_symmetric).is_none();
        Ok(point)
    }

    /// The criterion for a settled point.
    fn criterion(&self) -> Criterion {
        let before = |back: usize| self.script.levels.iter().nth_back(back).copied();
        Criterion {
            largest: self.plan.levels.iter().copied().fold(0.0, f64::max),
            before: [before(1), before(0)],
            ..self.script.criterion()
        }
    }
}

/// Levels, m, between two that are more than [`LARGEST_STEP`] apart, at equal ratios.
fn between(from: f64, to: f64) -> impl Iterator<Item = f64> {
    let ratio = (to / from).ln();
    let steps = (ratio.abs() / LARGEST_STEP.ln()).ceil();
    (1..steps as usize).map(move |n| from * (ratio * n as f64 / steps).exp())
}
