//! The tracking of the backbone.

use super::bench::Bench;
use super::peak;
use super::point::{Point, Tracked};
use super::predictor::{self, FIRST, Known, LAST, PHASE};
use super::settle::{Criterion, Found};
use super::sweep::{self, Sweep};
use crate::experiment::{self, ExperimentError, Sample, Stage};
use crate::identification::{Cycle, Regime, Slopes, classify, regime_by_response};
use crate::rig::{Controller, LoopState, Move, Rig};
use crate::scene::Scene;
use vines_model::numerics::Estimate;

/// Phase error, rad, below which the control of the response begins.
const NEAR: f64 = 0.35;
/// Periods for which the phase error must have been that small.
const NEAR_FOR: usize = 3;

/// Tracks the backbone of `scene`.
///
/// # Errors
/// A failure of the rig or of the controller, or no lock in the time allowed.
pub fn track(
    rig: &mut (impl Rig + ?Sized),
    controller: &mut (impl Controller + ?Sized),
    scene: &Scene,
    mut progress: impl FnMut(usize, usize),
) -> Result<Tracked, ExperimentError> {
    let settings = scene.backbone;
    let levels = settings.levels();
    let mut samples = Vec::new();
    let mut bench = Bench {
        bench: experiment::Bench::new(rig, controller, scene.sample_time(), &mut samples),
        stage: Stage::Locking,
        target: scene.controller.phase_target_radians(),
        last: None,
        sweep: Sweep::default(),
    };
    approach(&mut bench, scene.lock_periods())?;
    let periods_to_lock = bench.periods;
    bench.stage = Stage::Tracking;
    let phases: &[f64] = if scene.resonance.is_peak() {
        &peak::PHASES
    } else {
        &[0.0]
    };
    let mut scans: Vec<Vec<Point>> = vec![Vec::new(); phases.len()];
    // The last point, and the phase at which it was held.
    let (mut last, mut ended) = (None::<(Point, f64)>, None);
    'levels: for (n, &level) in levels.iter().enumerate() {
        progress(n, levels.len());
        for k in 0..phases.len() {
            // The next level begins at the phase at which this one ends.
            let scan = if n % 2 == 0 { k } else { phases.len() - 1 - k };
            let order = Order { level, phase: phases[scan], known: known(&scans[scan], last) };
            // The last level is held: a crossing would go beyond it.
            let crossed = last.filter(|_| phases.len() == 1 && n + 1 < levels.len());
            let after = levels.get(n + 1).filter(|_| n + 2 < levels.len());
            let crossing = crossed
                .and_then(|(last, _)| Some((last, sweep::periods(&bench, scene, &order, (&last, after.copied()))?)));
            let next = match crossing {
                Some((last, periods)) => sweep::cross(&mut bench, scene, &order, (&last, periods)),
                None => go(&mut bench, scene, &order, last),
            };
            match next {
                Ok(point) => {
                    last = Some((point, order.phase));
                    if let Some(before) = scans[scan].last_mut() {
                        bench.sweep.refine(scene, before);
                    }
                    scans[scan].push(point);
                }
                // What was measured is kept.
                Err(error) if last.is_some() => {
                    ended = Some(error);
                    break 'levels;
                }
                Err(error) => return Err(error),
            }
        }
    }
    let points = if scene.resonance.is_peak() {
        peak::peaks(&scans, &scene.dimensionless())
    } else {
        scans.swap_remove(0)
    };
    let periods = bench.periods;
    Ok(Tracked { points, periods_to_lock, periods, ended })
}

/// What is to be held next.
#[derive(Clone)]
pub(super) struct Order {
    /// Response amplitude over b.
    pub level: f64,
    /// Phase error, rad.
    pub phase: f64,
    /// The points before.
    pub known: Vec<Known>,
}

impl Order {
    /// What theory knows of the backbone there.
    pub fn slopes(&self, scene: &Scene) -> Slopes {
        Slopes::by_theory(&scene.dimensionless(), self.level, self.phase)
    }
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

/// Goes to the next level or phase and holds it.
fn go<R: Rig + ?Sized, C: Controller + ?Sized>(
    bench: &mut Bench<R, C>,
    scene: &Scene,
    order: &Order,
    last: Option<(Point, f64)>,
) -> Result<Point, ExperimentError> {
    let d = scene.dimensionless();
    let Order { level, phase, ref known } = *order;
    let (g, sigma) = predictor::change(scene.backbone.predictor, known, level, &d);
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
    let periods = predictor::move_periods(scene, from.as_ref(), level);
    let to = Move {
        response: level * d.b,
        duration: periods * d.natural_period(),
        amplitude: d.amplitude(g),
        omega: d.omega_change(sigma),
        growth: 0.0,
    };
    let target = bench.target + phase;
    bench.sweep = Sweep::default();
    bench.controller.hold_response(to, target)?;
    let changed = last.map_or(FIRST, |(_, held)| {
        if held == phase {
            predictor::late(&d, level) - LAST
        } else {
            PHASE
        }
    });
    hold(bench, scene, order, periods + changed)
}

/// Largest relative deviation of a held amplitude within the periods, unless it is noise.
const SPREAD: f64 = 0.01;
/// Periods in succession in which the criterion must be met: the halves of a transient can agree by chance.
const CONFIRMED: usize = 3;
/// Largest relative difference of the response from its level that counts as reached.
const REACHED: f64 = 0.01;
/// Runs the loop until it is near phase resonance, with the initial drive amplitude.
fn approach<R: Rig + ?Sized, C: Controller + ?Sized>(
    bench: &mut Bench<R, C>,
    most: f64,
) -> Result<(), ExperimentError> {
    let mut near = 0;
    while near < NEAR_FOR {
        bench.samples.clear();
        let cycle = bench.cycle()?;
        let Some(Sample { command, .. }) = bench.samples.last().copied() else {
            continue;
        };
        if bench.periods >= most {
            return Err(bench.no_lock(&command));
        }
        // A motion that is being captured is not to be held yet.
        let captured = command.state != Some(LoopState::Capturing);
        let driven = cycle.base.norm() > 0.0 && captured;
        near = if driven && cycle.phase_error.abs() < NEAR {
            near + 1
        } else {
            0
        };
    }
    Ok(())
}

/// The criterion for a settled point.
pub(super) fn criterion(scene: &Scene, order: &Order) -> Criterion {
    let (settings, d) = (&scene.backbone, scene.dimensionless());
    let share = if scene.resonance.is_peak() {
        peak::share_of_drive(order.level)
    } else {
        1.0
    };
    let pair = |size: f64| [d.amplitude(size), d.omega_change(size)];
    let [base, omega] = pair(settings.tolerance);
    Criterion {
        omega0: d.omega0,
        precision: pair(settings.precision),
        tolerance: [share * base, omega],
        // Evenly distributed within the tolerance.
        least: [share * base, omega].map(|most| most / 3f64.sqrt()),
        spread: SPREAD,
        fewest: settings.dwell_min as usize,
        slopes: order.slopes(scene),
        phase: order.phase,
    }
}

/// Moves to the level and holds it until the point has settled.
fn hold<R: Rig + ?Sized, C: Controller + ?Sized>(
    bench: &mut Bench<R, C>,
    scene: &Scene,
    order: &Order,
    move_periods: f64,
) -> Result<Point, ExperimentError> {
    let level = order.level;
    let settings = &scene.backbone;
    let start = bench.periods;
    bench.samples.clear();
    while bench.periods - start < move_periods {
        bench.cycle()?;
    }
    let criterion = criterion(scene, order);
    let mut cycles: Vec<Cycle> = Vec::new();
    let most = settings.dwell_max as usize;
    let mut confirmed = 0;
    let found = loop {
        cycles.push(bench.cycle()?);
        let found = criterion.best(&cycles);
        let is_met = found.is_some_and(|found| criterion.is_met(&found) && is_reached(scene, level, &found));
        confirmed = if is_met { confirmed + 1 } else { 0 };
        if cycles.len() >= most || confirmed >= CONFIRMED {
            break found;
        }
    };
    let said = found.unwrap_or_else(|| Found::unsettled(&cycles[cycles.len() / 2..]));
    let taken = Taken {
        periods: bench.periods - start,
        settled: said.steady || criterion.is_met(&said),
        reached: is_reached(scene, level, &said),
    };
    Ok(point(bench, scene, level, &said, &cycles, &taken))
}

/// Whether the response is at its level.
pub(super) fn is_reached(scene: &Scene, level: f64, found: &Found) -> bool {
    let Estimate { value, uncertainty } = found.response.scaled(1.0 / scene.dimensionless().b);
    (value - level).abs() <= (REACHED * level).max(4.0 * uncertainty)
}

/// How a point was taken: periods of the move and at the level, and whether the motion was steady and at its level.
pub(super) struct Taken {
    pub periods: f64,
    pub settled: bool,
    pub reached: bool,
}

/// The point of an estimate from the last of some periods.
pub(super) fn point<R: Rig + ?Sized, C: Controller + ?Sized>(
    bench: &Bench<R, C>,
    scene: &Scene,
    level: f64,
    said: &Found,
    cycles: &[Cycle],
    taken: &Taken,
) -> Point {
    let d = scene.dimensionless();
    let samples: usize = cycles[cycles.len() - said.periods..]
        .iter()
        .map(|cycle| cycle.samples)
        .sum();
    let averaged = &bench.samples[bench.samples.len() - samples..];
    let [base, omega] = said.at;
    let regime = regime_by_response(averaged, scene, base.value, omega.value);
    Point {
        periods: taken.periods,
        regime,
        regime_by_impacts: bench.samples[0]
            .ground_truth
            .map(|_| classify(averaged, bench.sample_time, omega.value).1),
        // An irregular motion can seem steady for a while.
        settled: regime != Regime::Other && taken.settled,
        reached: taken.reached,
        ..Point::new(level, said, &d)
    }
}
