//! The tracking of the backbone.

use super::bench::{Bench, Order};
use super::peak;
use super::point::{Point, Tracked};
use super::predictor::{self, FIRST, Known, LAST, PHASE};
use super::settle::Found;
use super::sweep::Sweep;
use crate::experiment::{self, ExperimentError, Sample, Search, Stage};
use crate::identification::Cycle;
use crate::rig::{Controller, Move, Rig};
use crate::scene::Scene;

/// Periods in succession in which the criterion must be met: the halves of a transient can agree by chance.
const CONFIRMED: usize = 3;

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
        last: None,
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
    let points = if scene.resonance.is_peak() {
        peak::peaks(&scans, &scene.dimensionless())
    } else {
        scans.swap_remove(0)
    };
    let periods = bench.run.periods;
    Ok(Tracked { points, periods_to_lock, periods, ended })
}

/// The points of a scan; before its first, the last one of another.
fn known(scan: &[Point], last: Option<(Point, f64)>) -> Vec<Known> {
    let finite = |known: &Known| known.g.is_finite() && known.sigma.is_finite();
    let own: Vec<Known> = scan.iter().map(Point::known).filter(finite).collect();
    match own.is_empty() {
        true => last.iter().map(|(point, _)| point.known()).filter(finite).collect(),
        false => own,
    }
}

impl<R: Rig + ?Sized, C: Controller + ?Sized> Bench<'_, R, C> {
    /// Goes to a symmetric motion with impacts, if there is one.
    fn approach(&mut self) -> Result<(), ExperimentError> {
        let limit = (self.scene.lock_periods() * self.scene.controller.samples_per_period) as usize;
        Search::new(&mut self.run, self.scene, limit, &mut |_| {}).impacts()
    }

    /// Goes through the levels, and holds each at all `phases`: `scans` gets the points of each phase.
    fn follow(
        &mut self,
        phases: &[f64],
        scans: &mut [Vec<Point>],
        mut progress: impl FnMut(usize, usize),
    ) -> Result<(), ExperimentError> {
        let levels = self.scene.backbone.levels();
        // The last point, and the phase at which it was held.
        let mut last = None::<(Point, f64)>;
        let mut sweep = Sweep::default();
        for (n, &level) in levels.iter().enumerate() {
            progress(n, levels.len());
            for k in 0..phases.len() {
                // The next level begins at the phase at which this one ends.
                let scan = if n % 2 == 0 { k } else { phases.len() - 1 - k };
                let order = Order { level, phase: phases[scan], known: known(&scans[scan], last) };
                // The last level is held: a crossing would go beyond it.
                let crossed = last.filter(|_| phases.len() == 1 && n + 1 < levels.len());
                let after = levels.get(n + 1).filter(|_| n + 2 < levels.len()).copied();
                let periods = |(last, _)| Some((last, sweep.periods(self.scene, &self.last?, &order, &last, after)?));
                let point = if let Some((last, periods)) = crossed.and_then(periods) {
                    sweep.cross(self, &order, (&last, periods))?
                } else {
                    sweep = Sweep::default();
                    self.go(&order, last)?
                };
                last = Some((point, order.phase));
                if let Some(before) = scans[scan].last_mut() {
                    sweep.refine(self.scene, before);
                }
                scans[scan].push(point);
            }
        }
        Ok(())
    }

    /// Goes to the next level or phase and holds it.
    fn go(&mut self, order: &Order, last: Option<(Point, f64)>) -> Result<Point, ExperimentError> {
        let d = self.scene.dimensionless();
        let Order { level, phase, ref known } = *order;
        let (g, sigma) = predictor::change(self.scene.backbone.predictor, known, level, &d);
        let expected = known
            .last()
            .map(|one| Known { c: level, g: one.g + g, sigma: one.sigma + sigma });
        let present = last.map(|(point, phase)| peak::at_phase(&point.known(), phase, d.epsilon));
        let change = expected.zip(present).map(|(expected, present)| {
            let then = peak::at_phase(&expected, phase, d.epsilon);
            [then[0] - present[0], then[1] - present[1]]
        });
        let [g, sigma] = change
            .filter(|change| change.iter().all(|one| one.is_finite()))
            .unwrap_or([0.0; 2]);
        let from = last.map(|(point, _)| point.known());
        let periods = predictor::move_periods(self.scene, from.as_ref(), level);
        let to = Move {
            response: level * d.b,
            duration: periods * d.natural_period(),
            amplitude: d.amplitude(g),
            omega: d.omega_change(sigma),
            growth: 0.0,
        };
        self.run.controller.hold_response(to, self.target + phase)?;
        let changed = last.map_or(FIRST, |(_, held)| {
            if held == phase {
                predictor::late(&d, level) - LAST
            } else {
                PHASE
            }
        });
        self.hold(order, periods + changed)
    }

    /// Waits for the end of a move and holds the level until the point has settled.
    fn hold(&mut self, order: &Order, move_periods: f64) -> Result<Point, ExperimentError> {
        let start = self.run.periods;
        self.run.samples.clear();
        while self.run.periods - start < move_periods {
            self.cycle()?;
        }
        let criterion = order.criterion(self.scene);
        let mut cycles: Vec<Cycle> = Vec::new();
        let most = self.scene.backbone.dwell_max as usize;
        let mut confirmed = 0;
        let found = loop {
            cycles.push(self.cycle()?);
            let found = criterion.best(&cycles);
            let is_met =
                found.is_some_and(|found| criterion.is_met(&found) && order.is_reached(self.scene, found.response));
            confirmed = if is_met { confirmed + 1 } else { 0 };
            if cycles.len() >= most || confirmed >= CONFIRMED {
                break found;
            }
        };
        let said = found.unwrap_or_else(|| Found::unsettled(&cycles[cycles.len() / 2..]));
        Ok(self.point(order, start, &said, &cycles, &criterion))
    }
}
