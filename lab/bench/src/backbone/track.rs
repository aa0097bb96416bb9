//! The tracking of the backbone.

use std::f64::consts::TAU;

use vines_model::numerics::Estimate;

use super::level::{Criterion, Found};
use super::peak;
use super::point::{Held, Known, Point, Tracked};
use crate::experiment::{self, ExperimentError, Sample, Search, Stage};
use crate::identification::{Cycle, Regime, classify, foreign_tone, regime_by_response};
use crate::rig::{Controller, Move, Rig};
use crate::scene::{Definition, Resonance, Scene};

/// Periods between a move and the first that is measured: the loops and the particle follow late.
const LATE: usize = 8;
/// Periods of the first level more than those, because the start of the loop disturbs the particle, too.
const FIRST: usize = 24;
/// Periods in succession in which the criterion must be met: the halves of a transient can agree by chance.
const CONFIRMED: usize = 3;
/// Share of the drive that a move may need in addition to the drive that holds the response.
const MOVE_SHARE: f64 = 0.8;
/// Largest relative difference of the response from its level that counts as reached.
const REACHED: f64 = 0.01;

/// Rig and controller, read period by period.
struct Bench<'a, R: Rig + ?Sized, C: ?Sized> {
    run: experiment::Bench<'a, R, C>,
    scene: &'a Scene,
    stage: Stage,
    target: f64,
    /// Where the loop was closed.
    present: Option<Known>,
}

/// What is to be held next.
struct Order<'a> {
    /// Response amplitude, m.
    level: f64,
    /// Phase error, rad.
    phase: f64,
    /// The points before, at this phase.
    known: &'a [Known],
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
    let mut bench = Bench {
        run: experiment::Bench::new(rig, controller, scene, samples),
        scene,
        stage: Stage::Locking,
        target: scene.controller.phase_target_radians(),
        present: None,
    };
    bench.approach()?;
    let periods_to_lock = bench.run.periods;
    bench.stage = Stage::Tracking;
    let phases: &[f64] = if scene.resonance.is_peak() {
        &peak::PHASES
    } else {
        &[0.0]
    };
    let mut scans = vec![Vec::new(); phases.len()];
    let mut ended = bench.follow(phases, &mut scans, progress).err();
    // What was measured is kept.
    if let Some(error) = ended.take_if(|_| scans.iter().all(Vec::is_empty)) {
        return Err(error);
    }
    let held = if scene.resonance.is_peak() {
        peak::peaks(&scans, scene.linear().omega0)
    } else {
        scans.swap_remove(0)
    };
    let (periods, d) = (bench.run.periods, scene.dimensionless());
    let points = held.iter().map(|one| Point::of(one, &d)).collect();
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
        // The levels are held about phase resonance; the phase of the peak is measured.
        let definition = Definition { resonance: Resonance::Phase, ..scene.resonance };
        let at_resonance = Scene { resonance: definition, ..scene.clone() };
        Search::new(&mut self.run, &at_resonance, limit, &mut |_| {}).impacts()?;
        let cycle = self.cycle()?;
        self.present = Some(Known {
            response: cycle.amplitude(),
            drive: cycle.base.norm(),
            omega: cycle.omega,
        });
        Ok(())
    }

    /// Goes through the levels, and holds each at all `phases`: `scans` gets the points of each phase.
    fn follow(
        &mut self,
        phases: &[f64],
        scans: &mut [Vec<Held>],
        mut progress: impl FnMut(usize, usize),
    ) -> Result<(), ExperimentError> {
        let levels = self.scene.levels();
        // The last point, and the phase at which it was held.
        let mut last = self.present.map(|present| (present, 0.0));
        for (n, &level) in levels.iter().enumerate() {
            progress(n, levels.len());
            for k in 0..phases.len() {
                // The next level begins at the phase at which this one ends.
                let scan = if n % 2 == 0 { k } else { phases.len() - 1 - k };
                let known: Vec<Known> = scans[scan].iter().filter_map(Held::known).collect();
                let order = Order { level, phase: phases[scan], known: &known };
                let point = self.hold(&order, last)?;
                last = point.known().map(|known| (known, order.phase)).or(last);
                let held = scans[scan]
                    .last()
                    .filter(|before: &&Held| is_one_to_one(before.regime))
                    .map(|before| before.level);
                scans[scan].push(point);
                if let Some(held) = held.filter(|_| matches!(point.regime, Regime::NoImpacts | Regime::Other)) {
                    let b = self.scene.plant.half_width;
                    return Err(ExperimentError::MotionLost { held, level, b, regime: point.regime });
                }
            }
        }
        Ok(())
    }

    /// Goes to a level and phase, and holds them until the point has settled, or for the longest time allowed.
    fn hold(&mut self, order: &Order, last: Option<(Known, f64)>) -> Result<Held, ExperimentError> {
        let (start, settings) = (self.run.periods, &self.scene.backbone);
        let (to, periods) = self.step(order, last);
        self.run.controller.hold_response(to, self.target + order.phase)?;
        self.run.samples.clear();
        let late = if order.known.is_empty() { FIRST + LATE } else { LATE };
        while self.run.periods - start < periods + late as f64 {
            self.cycle()?;
        }
        let criterion = order.criterion(self.scene);
        let mut cycles: Vec<Cycle> = Vec::new();
        let mut confirmed = 0;
        let found = loop {
            cycles.push(self.cycle()?);
            let found = criterion.best(&cycles);
            let is_met = found.is_some_and(|found| criterion.is_met(&found) && order.is_reached(found.response));
            confirmed = if is_met { confirmed + 1 } else { 0 };
            if cycles.len() >= settings.dwell_max as usize || confirmed >= CONFIRMED {
                break found;
            }
        };
        let said = found.unwrap_or_else(|| Found::means(&cycles[cycles.len() / 2..]));
        Ok(self.point(order, start, &said, &cycles, &criterion))
    }

    /// The move to a level and phase, and its periods: those of the scene, or as many as the drive needs to change the response that much.
    fn step(&self, order: &Order, last: Option<(Known, f64)>) -> (Move, f64) {
        let omega0 = self.scene.linear().omega0;
        let Order { level, phase, known } = *order;
        let slowest = last.map_or(0.0, |(last, _)| {
            (level - last.response).abs() / (MOVE_SHARE * 0.5 * last.drive * TAU)
        });
        // A smooth move is twice as fast in its middle as on average.
        let periods = self.scene.backbone.move_periods.max(2.0 * slowest);
        let change = extrapolated(known, level).zip(last).map(|(expected, (last, held))| {
            let [then, now] = [(expected, phase), (last, held)].map(|(one, phase)| peak::at_phase(&one, phase, omega0));
            [then[0] - now[0], then[1] - now[1]]
        });
        let [amplitude, omega] = change.unwrap_or_default();
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
    fn point(&self, order: &Order, start: f64, said: &Found, cycles: &[Cycle], criterion: &Criterion) -> Held {
        let samples = cycles[cycles.len() - said.periods..].iter().map(|cycle| cycle.samples);
        let averaged = &self.run.samples[self.run.samples.len() - samples.sum::<usize>()..];
        let [base, omega] = said.at;
        let regime = regime_by_response(averaged, self.scene, base.value, self.target, omega.value);
        let reached = order.is_reached(said.response);
        Held {
            periods: self.run.periods - start,
            regime,
            regime_by_impacts: self.run.samples[0]
                .ground_truth
                .map(|_| classify(averaged, self.run.sample_time, omega.value).1),
            tone: foreign_tone(averaged, self.scene, omega.value),
            // An irregular motion can seem steady for a while; an asymmetric one is no point of this backbone.
            settled: reached
                && !matches!(regime, Regime::Other | Regime::Asymmetric)
                && (said.steady || criterion.is_met(said)),
            reached,
            ..Held::new(order.level, said)
        }
    }
}

impl Order<'_> {
    /// The criterion for a settled point.
    fn criterion(&self, scene: &Scene) -> Criterion {
        let before = |back: usize| {
            let Known { response, drive, omega } = *self.known.iter().nth_back(back)?;
            Some([response, drive, omega])
        };
        Criterion {
            linear: scene.linear(),
            precision: scene.backbone.precision,
            largest: scene.levels().into_iter().fold(0.0, f64::max),
            is_peak: scene.resonance.is_peak(),
            fewest: scene.backbone.dwell_min as usize,
            phase: self.phase,
            before: [before(1), before(0)],
        }
    }

    /// Whether a response, m, is at the level.
    fn is_reached(&self, response: Estimate) -> bool {
        let Estimate { value, uncertainty } = response;
        (value - self.level).abs() <= (REACHED * self.level).max(4.0 * uncertainty)
    }
}

fn is_one_to_one(regime: Regime) -> bool {
    matches!(regime, Regime::Symmetric | Regime::Unresolved)
}

/// Drive and frequency at the amplitude `response`, m, on the polynomial through the last points, three at most; `None` without any.
pub(super) fn extrapolated(known: &[Known], response: f64) -> Option<Known> {
    let points = &known[known.len().saturating_sub(3)..];
    let weights = points.iter().enumerate().map(|(i, point)| {
        let others = points.iter().enumerate().filter(|(j, _)| *j != i);
        (
            point,
            others
                .map(|(_, other)| (response - other.response) / (point.response - other.response))
                .product::<f64>(),
        )
    });
    let [drive, omega] = weights.fold([0.0; 2], |[drive, omega], (point, weight)| {
        [drive + weight * point.drive, omega + weight * point.omega]
    });
    let known = Known { response, drive, omega };
    (!points.is_empty() && drive.is_finite() && omega.is_finite()).then_some(known)
}
