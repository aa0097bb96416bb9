//! Levels that are crossed instead of held: the response changes at a constant rate, and the periods about a level give its point.
//!
//! The drive changes the amplitude of a rig with a small mass ratio slowly: a move takes longer than the measurement at its end. At a
//! constant rate, drive and frequency are as steady as on a hold, and the balances account for the rate. docs/backbone.md shows what is
//! gained.

use std::f64::consts::{PI, TAU};

use super::bench::{Bench, Order};
use super::point::Point;
use super::predictor;
use super::settle::{BENT, Criterion, Found};
use crate::experiment::ExperimentError;
use crate::identification::{Cycle, PARABOLA, Regime};
use crate::rig::{Controller, Move, Rig};
use crate::scene::Scene;
use vines_model::Dimensionless;
use vines_model::numerics::{Estimate, mean};
use vines_model::theory::SlowFlow;

/// Fewest periods of a crossing.
const FEWEST: f64 = 10.0;
/// Most periods: where more are needed, a hold is better.
const MOST: f64 = 24.0;
/// Periods in which the rate is reached, over those of the crossing; and the fewest, because the loops must be steady again by then.
const LEAD: f64 = 0.65;
const SHORTEST: f64 = 15.0;
/// Largest distance of two levels, relative to the level.
const WIDEST: f64 = 0.15;
/// Largest distance of two levels, relative to that from the fold, if noise makes a crossing slower: nearer to it, a hold takes no longer.
const FOLD: f64 = 0.5;
/// Share of the drive that may change the amplitude.
const SHARE: f64 = 0.76;
/// Share of the effect of a steady drift that remains after its correction, `0.01 + 5 epsilon`. It counts in the uncertainty.
/// The map of the impacts confirms the correction within 0.01 (tests of `SlowFlow::drift`); theory lacks the next order in epsilon.
const LATE: [f64; 2] = [0.01, 5.0];
/// Largest parts of the uncertainty of sigma, over `backbone.precision`, by the drift and by noise.
const PARTS: [f64; 2] = [0.6, 0.55];
/// Largest part of it by the curvature, where periods of the neighbours are used.
const STRAIGHT: f64 = 0.15;
/// Most periods of a crossing that noise makes slower.
const MOST_BY_NOISE: u32 = 45;

/// The levels crossed at constant rates without a pause.
#[derive(Default)]
pub(super) struct Sweep {
    /// Their periods.
    cycles: Vec<Cycle>,
    /// What was crossed, in how many periods.
    crossed: Vec<(Order, usize)>,
}

impl Sweep {
    /// Periods in which the level after the point `last` can be crossed, if `after` is the one that follows; `None` where a hold is better:
    /// towards the fold, for distant levels, and at much noise. `cycle` is the last period.
    pub fn periods(
        &self,
        scene: &Scene,
        cycle: &Cycle,
        order: &Order,
        last: &Point,
        after: Option<f64>,
    ) -> Option<f64> {
        let precision = precision(scene);
        let crossable = |order: &Order, before: f64| slowest(scene, order, before).filter(|[slow, _]| *slow <= MOST);
        let [slow, bent] = crossable(order, last.level).filter(|_| last.reached)?;
        let next = |level: f64| Order { level, ..order.clone() };
        let follows = after.is_some_and(|after| crossable(&next(after), order.level).is_some());
        let by_noise =
            (1..=MOST_BY_NOISE).find(|n| predicted(scene, order, cycle, f64::from(*n)) <= PARTS[1] * precision)?;
        // Two neighbours lend the half of their periods, where the backbone is straight enough for twice the distance.
        let lent = follows && !self.crossed.is_empty() && 4.0 * bent <= STRAIGHT * precision;
        let d = scene.dimensionless();
        let from_fold = order.level - SlowFlow::new(d.lambda, d.r).manifold.c_min();
        if f64::from(by_noise) > slow && (order.level - last.level).abs() > FOLD * from_fold {
            return None;
        }
        Some(slow.max(if lent { 0.5 } else { 1.0 } * f64::from(by_noise)).ceil())
    }

    /// Crosses the level of `order` in `periods`: from half the distance of the levels before it to half of it behind.
    ///
    /// # Errors
    /// As those of a hold.
    pub fn cross<R: Rig + ?Sized, C: Controller + ?Sized>(
        &mut self,
        bench: &mut Bench<R, C>,
        order: &Order,
        (last, periods): (&Point, f64),
    ) -> Result<Point, ExperimentError> {
        let (scene, d) = (bench.scene, bench.scene.dimensionless());
        let width = order.level - last.level;
        let (start, target) = (bench.run.periods, bench.target + order.phase);
        let period = bench.last.map_or(d.natural_period(), |cycle| TAU / cycle.omega);
        bench.run.samples.clear();
        let predicted = |c: f64| predictor::change(scene.backbone.predictor, &order.known, c, &d);
        let before = order.level - 0.5 * width;
        let crossing = (before, order.level + 0.5 * width, periods);
        let legs = [(last.level, before, (LEAD * periods).max(SHORTEST)), crossing];
        let mut cycles = Vec::new();
        for &(from, to, taken) in &legs[usize::from(!self.cycles.is_empty())..] {
            let ((g_from, sigma_from), (g, sigma)) = (predicted(from), predicted(to));
            let leg = Move {
                response: to * d.b,
                duration: taken * period,
                amplitude: d.amplitude(g - g_from),
                omega: d.omega_change(sigma - sigma_from),
                growth: width * d.b / (periods * period),
            };
            bench.run.controller.hold_response(leg, target)?;
            cycles.clear();
            for _ in 0..taken.round() as usize {
                cycles.push(bench.cycle()?);
            }
        }
        self.cycles.extend(&cycles);
        self.crossed.push((order.clone(), cycles.len()));
        let criterion = of_crossing(scene, order);
        // The rate may change in the first period.
        let said = criterion
            .best_of([&cycles[..], &cycles[1..]])
            .unwrap_or_else(|| Found::unsettled(&cycles));
        // All periods lie evenly about the level.
        let response = Estimate {
            value: mean(cycles.iter().map(Cycle::amplitude)),
            ..said.response
        };
        Ok(Point {
            reached: order.is_reached(scene, response),
            ..bench.point(order, start, &said, &cycles, &criterion)
        })
    }

    /// Estimates the last level but one again, from its own periods and from half of those of both neighbours: the uncertainty of a
    /// slope falls with the duration to the power of 3/2.
    pub fn refine(&self, scene: &Scene, point: &mut Point) {
        let [.., (_, before), (order, own), (_, after)] = &self.crossed[..] else {
            return;
        };
        let (begin, end) = (self.cycles.len() - after - own, self.cycles.len() - after);
        let criterion = of_crossing(scene, order);
        let shared = before.min(after) / 2;
        let windows = [&self.cycles[begin..end], &self.cycles[begin - shared..end + shared]];
        let is_noise = predicted(scene, order, &self.cycles[begin], *own as f64) > 0.5 * precision(scene);
        let Some(found) = criterion.best_of(windows).filter(|_| is_noise) else {
            return;
        };
        *point = Point {
            periods: point.periods,
            settled: point.regime != Regime::Other && (found.steady || criterion.is_met(&found)),
            reached: point.reached,
            regime: point.regime,
            regime_by_impacts: point.regime_by_impacts,
            ..Point::new(order.level, &found, &scene.dimensionless())
        };
    }
}

/// Largest standard uncertainty of the frequency, rad/s, that the scene allows.
fn precision(scene: &Scene) -> f64 {
    scene.backbone.precision * scene.dimensionless().omega_change(1.0)
}

/// Standard uncertainty of the frequency, rad/s, or of the drive in terms of it, by the noise of `n` such periods.
fn predicted(scene: &Scene, order: &Order, cycle: &Cycle, n: f64) -> f64 {
    let slopes = order.slopes(scene);
    let [noise, base] = [
        cycle.noise[0].sqrt() / cycle.amplitude(),
        cycle.noise[1].sqrt() / cycle.base.norm(),
    ];
    // A slope in time; and the amplitude that it belongs to.
    let slope = (12.0 / n.powi(3)).sqrt() * noise.hypot(base) * cycle.omega / TAU;
    let level = (PARABOLA / n).sqrt() * noise * cycle.amplitude() * slopes.omega[0].abs();
    (slope * (2.0 * order.level).max(1.0)).hypot(level)
}

/// Relative uncertainty of the correction for a steady drift.
fn late(d: &Dimensionless) -> f64 {
    LATE[0] + LATE[1] * d.epsilon
}

/// Periods in which the drive and the drift allow to cross the level of `order` from the one `before`, and the uncertainty of the frequency,
/// rad/s, by the curvature of the backbone; `None` where that is too large, or the level too far away.
fn slowest(scene: &Scene, order: &Order, before: f64) -> Option<[f64; 2]> {
    let d = scene.dimensionless();
    let width = (order.level - before).abs();
    let slopes = order.slopes(scene);
    let bent = BENT * slopes.curvature[1].abs() * (width * d.b).powi(2) / 40.0;
    if !(width > 0.0 && width <= WIDEST * order.level && bent <= precision(scene)) {
        return None;
    }
    let by_drive = width / (SHARE * d.epsilon * PI * order.known.last()?.g);
    let by_drift = late(&d) * slopes.drift[1].abs() * width * d.b * d.omega0 / (TAU * PARTS[0] * precision(scene));
    Some([by_drive.max(by_drift).max(FEWEST), bent])
}

/// The criterion for a level that is crossed.
fn of_crossing(scene: &Scene, order: &Order) -> Criterion {
    let mut criterion = order.criterion(scene);
    (criterion.spread, criterion.slopes.late) = (f64::INFINITY, late(&scene.dimensionless()));
    criterion.tolerance = criterion.precision;
    criterion
}
