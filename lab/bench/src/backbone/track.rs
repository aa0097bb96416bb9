//! The tracking of the backbone.

use std::f64::consts::TAU;

use serde::Serialize;
use vines_model::numerics::Estimate;

use super::level::{Criterion, Found};
use crate::experiment::{self, ExperimentError, Search, Stage};
use crate::identification::{Cycle, Measured, Regime, Tone, classify, foreign_tone, regime_by_response};
use crate::record::Sample;
use crate::rig::{Controller, Move, Rig};
use crate::scene::Scene;

/// One point of the backbone.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Point {
    /// Where it is; frequency and base amplitude are those of phase resonance at this response amplitude.
    #[serde(flatten)]
    pub at: Measured,
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
    /// The regime determined from the response alone, as on a real rig.
    pub regime: Regime,
    /// The regime determined from the impacts, if the rig is a simulation.
    pub regime_by_impacts: Option<Regime>,
    /// A tone in the response that is not part of the motion.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tone: Option<Tone>,
}

/// The tracked backbone.
#[derive(Debug)]
pub struct Tracked {
    /// The points, in the order in which they were taken.
    pub points: Vec<Point>,
    /// Periods from the start to the closed loop.
    pub periods_to_lock: f64,
    /// All periods, from the start to the last point.
    pub periods: f64,
    /// Why tracking ended before the last level; absent if it did not.
    pub ended: Option<ExperimentError>,
}

/// Where the loop holds the rig: response amplitude, m, drive amplitude, m, frequency, rad/s.
type State = [f64; 3];

/// Periods between a move and the first that is measured: the loops and the particle follow late.
const LATE: usize = 8;
/// Periods of the first level more than those, because the start of the loop disturbs the particle, too.
const FIRST: usize = 24;
/// Periods in succession in which the criterion must be met: the halves of a transient can agree by chance.
const CONFIRMED: usize = 3;
/// Share of the drive that a move may need in addition to the drive that holds the response.
const MOVE_SHARE: f64 = 0.8;
/// Duration of a move, periods.
const MOVE: f64 = 4.0;
/// Largest relative difference of the response from its level that counts as reached.
const REACHED: f64 = 0.01;

/// Rig and controller, read period by period.
struct Bench<'a, R: Rig + ?Sized, C: ?Sized> {
    run: experiment::Bench<'a, R, C>,
    scene: &'a Scene,
    stage: Stage,
    /// Phase target, rad.
    target: f64,
    /// Where the loop was closed.
    closed: State,
    /// The points so far.
    states: Vec<State>,
    points: Vec<Point>,
}

/// Tracks the backbone of `scene`.
///
/// # Errors
/// A failure of the rig or of the controller, or no lock in the time allowed.
pub fn track(
    rig: &mut (impl Rig + ?Sized),
    controller: &mut (impl Controller + ?Sized),
    scene: &Scene,
    progress: impl FnMut(usize, usize),
) -> Result<Tracked, ExperimentError> {
    track_into(&mut Vec::new(), rig, controller, scene, progress)
}

/// As [`track`]; if it ends before the first point, what was measured last stays in `samples`.
///
/// # Errors
/// As [`track`].
pub fn track_into(
    samples: &mut Vec<Sample>,
    rig: &mut (impl Rig + ?Sized),
    controller: &mut (impl Controller + ?Sized),
    scene: &Scene,
    progress: impl FnMut(usize, usize),
) -> Result<Tracked, ExperimentError> {
    experiment::holds_a_phase(scene)?;
    let mut bench = Bench {
        run: experiment::Bench::new(rig, controller, scene, samples),
        scene,
        stage: Stage::Locking,
        target: scene.controller.phase_target_radians(),
        closed: [0.0; 3],
        states: Vec::new(),
        points: Vec::new(),
    };
    bench.approach()?;
    let periods_to_lock = bench.run.periods;
    bench.stage = Stage::Tracking;
    let mut ended = bench.follow(progress).err();
    // What was measured is kept.
    if let Some(error) = ended.take_if(|_| bench.points.is_empty()) {
        return Err(error);
    }
    let (points, periods) = (std::mem::take(&mut bench.points), bench.run.periods);
    Ok(Tracked { points, periods_to_lock, periods, ended })
}

impl<R: Rig + ?Sized, C: Controller + ?Sized> Bench<'_, R, C> {
    /// One period of the drive.
    fn cycle(&mut self) -> Result<Cycle, ExperimentError> {
        loop {
            let begin = self.run.samples.len();
            let first = self.run.periods;
            while self.run.periods < first.floor() + 1.0 {
                self.run.sample(self.stage)?;
            }
            let samples = &self.run.samples[begin..];
            if let Some(cycle) = Cycle::of(samples, self.run.sample_time, first * TAU, self.target) {
                return Ok(cycle);
            }
        }
    }

    /// Goes to a symmetric motion with impacts, if there is one.
    fn approach(&mut self) -> Result<(), ExperimentError> {
        let scene = self.scene;
        let limit = (scene.lock_periods() * scene.controller.samples_per_period) as usize;
        Search::new(&mut self.run, scene, limit, &mut |_| {}).impacts()?;
        let cycle = self.cycle()?;
        self.closed = [cycle.amplitude(), cycle.base.norm(), cycle.omega];
        Ok(())
    }

    /// Goes through the levels.
    fn follow(&mut self, mut progress: impl FnMut(usize, usize)) -> Result<(), ExperimentError> {
        let levels = self.scene.levels();
        for (n, &level) in levels.iter().enumerate() {
            progress(n, levels.len());
            let before = n
                .checked_sub(1)
                .map(|before| (levels[before], self.points[before].regime));
            let point = self.hold(level)?;
            self.points.push(point);
            if let Some((held, Regime::Symmetric | Regime::Unresolved)) = before
                && matches!(point.regime, Regime::NoImpacts | Regime::Other)
            {
                let b = self.scene.plant.half_width;
                return Err(ExperimentError::MotionLost { held, level, b, regime: point.regime });
            }
        }
        Ok(())
    }

    /// Goes to a level, m, and holds it until the point has settled, or for the longest time allowed.
    fn hold(&mut self, level: f64) -> Result<Point, ExperimentError> {
        let (start, settings) = (self.run.periods, &self.scene.backbone);
        let (to, periods) = self.step(level);
        self.run.controller.hold_response(to, self.target)?;
        self.run.samples.clear();
        let late = if self.states.is_empty() { FIRST + LATE } else { LATE };
        while self.run.periods - start < periods + late as f64 {
            self.cycle()?;
        }
        let criterion = self.criterion();
        let mut cycles: Vec<Cycle> = Vec::new();
        let mut confirmed = 0;
        let found = loop {
            cycles.push(self.cycle()?);
            let found = criterion.best(&cycles);
            let is_met = found.is_some_and(|found| criterion.is_met(&found) && is_reached(found.response, level));
            confirmed = if is_met { confirmed + 1 } else { 0 };
            if cycles.len() >= settings.dwell_max as usize || confirmed >= CONFIRMED {
                break found;
            }
        };
        let found = found.unwrap_or_else(|| Found::means(&cycles[cycles.len() / 2..]));
        let [drive, omega] = found.at.map(|one| one.value);
        if drive.is_finite() && omega.is_finite() {
            self.states.push([found.response.value, drive, omega]);
        }
        Ok(self.point(level, start, &found, &cycles, &criterion))
    }

    /// The move to a level, m, and its periods: those of the scene, or as many as the drive needs to change the response that much.
    fn step(&self, level: f64) -> (Move, f64) {
        let omega0 = self.scene.linear().omega0;
        let [response, drive, omega] = *self.states.last().unwrap_or(&self.closed);
        let slowest = (level - response).abs() / (MOVE_SHARE * 0.5 * drive * TAU);
        // A smooth move is twice as fast in its middle as on average.
        let periods = MOVE.max(2.0 * slowest);
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
    fn point(&self, level: f64, start: f64, found: &Found, cycles: &[Cycle], criterion: &Criterion) -> Point {
        let d = self.scene.dimensionless();
        let samples = cycles[cycles.len() - found.periods..].iter().map(|cycle| cycle.samples);
        let averaged = &self.run.samples[self.run.samples.len() - samples.sum::<usize>()..];
        let [base, omega] = found.at;
        let regime = regime_by_response(averaged, self.scene, base.value, self.target, omega.value);
        let reached = is_reached(found.response, level);
        Point {
            at: Measured::new([found.response, base, omega, found.phase_error], &d),
            // The level as a person would write it.
            level: (1e9 * level / d.b).round() / 1e9,
            periods: self.run.periods - start,
            averaged: found.periods,
            // An irregular motion can seem steady for a while; an asymmetric one is no point of this backbone.
            settled: reached
                && !matches!(regime, Regime::Other | Regime::Asymmetric)
                && (found.steady || criterion.is_met(found)),
            reached,
            regime,
            regime_by_impacts: self.run.samples[0]
                .ground_truth
                .map(|_| classify(averaged, self.run.sample_time, omega.value).1),
            tone: foreign_tone(averaged, self.scene, omega.value),
        }
    }

    /// The criterion for a settled point.
    fn criterion(&self) -> Criterion {
        let before = |back: usize| self.states.iter().nth_back(back).copied();
        Criterion {
            linear: self.scene.linear(),
            precision: self.scene.backbone.precision,
            largest: self.scene.levels().into_iter().fold(0.0, f64::max),
            before: [before(1), before(0)],
        }
    }
}

/// Whether a response, m, is at the level, m.
fn is_reached(Estimate { value, uncertainty }: Estimate, level: f64) -> bool {
    (value - level).abs() <= (REACHED * level).max(4.0 * uncertainty)
}

/// Drive, m, and frequency, rad/s, at the amplitude `response`, m, on the polynomial through the last points, three at most; `None` without any.
fn extrapolated(states: &[State], response: f64) -> Option<[f64; 2]> {
    let points = &states[states.len().saturating_sub(3)..];
    let weights = points.iter().enumerate().map(|(i, point)| {
        let others = points.iter().enumerate().filter(|(j, _)| *j != i);
        others
            .map(|(_, other)| (response - other[0]) / (point[0] - other[0]))
            .product::<f64>()
    });
    let expected = points.iter().zip(weights).fold([0.0; 2], |sum, (point, weight)| {
        [sum[0] + weight * point[1], sum[1] + weight * point[2]]
    });
    (!points.is_empty() && expected.iter().all(|one| one.is_finite())).then_some(expected)
}
