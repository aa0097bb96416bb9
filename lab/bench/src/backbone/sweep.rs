//! Levels that are crossed instead of held: the response changes at a constant rate, and the periods about a level give its point.
//!
//! The drive changes the amplitude of a rig with a small mass ratio slowly: a move takes longer than the measurement at its end. At a
//! constant rate, drive and frequency are as steady as on a hold, and the balances account for the rate. docs/backbone.md shows what is
//! gained.

use std::f64::consts::{PI, TAU};

use super::bench::Bench;
use super::point::Point;
use super::predictor;
use super::settle::{BENT, Found};
use super::track::{Order, Taken, criterion, is_reached, point};
use crate::experiment::ExperimentError;
use crate::rig::{Controller, Move, Rig};
use crate::scene::Scene;

/// Fewest periods of a crossing.
const FEWEST: f64 = 11.0;
/// Most periods: where more are needed, a hold is better.
const MOST: f64 = 24.0;
/// Periods in which the rate is reached, over those of the crossing.
const LEAD: f64 = 0.65;
/// Largest distance of two levels, relative to the level.
const WIDEST: f64 = 0.15;
/// Share of the drive that may change the amplitude.
const SHARE: f64 = 0.62;
/// Relative uncertainty of the effect of a steady drift.
const LATE: f64 = 0.036;
/// Largest parts of the uncertainty of sigma, over `backbone.precision`, by the drift and by noise.
const PARTS: [f64; 2] = [0.645, 0.5];

/// Periods in which the level after `last` can be crossed; `None` where a hold is better: at noise, towards the fold, and for distant levels.
pub fn periods<R: Rig + ?Sized, C: Controller + ?Sized>(
    bench: &Bench<R, C>,
    scene: &Scene,
    order: &Order,
    last: &Point,
) -> Option<f64> {
    let d = scene.dimensionless();
    let width = (order.level - last.level).abs();
    let slopes = predictor::slopes(scene, &order.known, [order.level, order.phase]);
    let precision = scene.backbone.precision * d.omega_change(1.0);
    let bent = BENT * slopes.curvature[1].abs() * (width * d.b).powi(2) / 40.0;
    if !(last.reached && width > 0.0 && width <= WIDEST * order.level && bent <= precision) {
        return None;
    }
    let by_drive = width / (SHARE * d.epsilon * PI * last.g);
    let by_drift = LATE * slopes.drift[1].abs() * width * d.b * d.omega0 / (TAU * PARTS[0] * precision);
    let cycle = bench.last?;
    let noise = cycle.noise[0].sqrt() / cycle.amplitude() * cycle.omega / TAU;
    let by_noise = (12.0 * (noise / (PARTS[1] * precision)).powi(2)).powf(1.0 / 3.0);
    let periods = by_drive.max(by_drift).max(FEWEST).ceil();
    (periods <= MOST && by_noise <= periods).then_some(periods)
}

/// Crosses the level of `order` in `periods`: from half the distance of the levels before it to half of it behind.
///
/// # Errors
/// As those of a hold.
pub fn cross<R: Rig + ?Sized, C: Controller + ?Sized>(
    bench: &mut Bench<R, C>,
    scene: &Scene,
    order: &Order,
    (last, periods): (&Point, f64),
) -> Result<Point, ExperimentError> {
    let d = scene.dimensionless();
    let width = order.level - last.level;
    let (start, target) = (bench.periods, bench.target + order.phase);
    let period = bench.last.map_or(d.natural_period(), |cycle| TAU / cycle.omega);
    bench.samples.clear();
    let predicted = |c: f64| predictor::change(scene.backbone.predictor, &order.known, c, &d);
    let before = order.level - 0.5 * width;
    let crossing = (before, order.level + 0.5 * width, 1.0);
    let legs = [(last.level, before, LEAD), crossing];
    let mut cycles = Vec::new();
    for &(from, to, share) in &legs[usize::from(bench.sweeping)..] {
        let ((g_from, sigma_from), (g, sigma)) = (predicted(from), predicted(to));
        let leg = Move {
            response: to * d.b,
            duration: share * periods * period,
            amplitude: d.amplitude(g - g_from),
            omega: d.omega_change(sigma - sigma_from),
            growth: width * d.b / (periods * period),
        };
        bench.controller.hold_response(leg, target)?;
        cycles.clear();
        for _ in 0..(share * periods).round() as usize {
            cycles.push(bench.cycle()?);
        }
    }
    bench.sweeping = true;
    let mut criterion = criterion(scene, order);
    (criterion.spread, criterion.slopes.late) = (f64::INFINITY, LATE);
    criterion.tolerance = criterion.precision;
    // The rate may change in the first period.
    let said = criterion
        .best_of([&cycles[..], &cycles[1..]])
        .unwrap_or_else(|| Found::unsettled(&cycles));
    let taken = Taken {
        periods: bench.periods - start,
        settled: said.steady || criterion.is_met(&said),
        reached: is_reached(scene, order.level, &said),
    };
    Ok(point(bench, scene, order.level, &said, &cycles, &taken))
}
