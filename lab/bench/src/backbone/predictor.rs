//! Prediction of the drive and the frequency at the next level.

use crate::scene::{Predictor, Scene};
use vines_model::Dimensionless;
use vines_model::theory::{BranchSide, SlowFlow, backbone_at_level, half_period_multipliers};

/// A working point: response amplitude, drive amplitude, detuning; dimensionless.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Known {
    pub c: f64,
    pub g: f64,
    pub sigma: f64,
}

/// Change of `(G, sigma)` from the last known point to the level `c`; zeros where nothing is known.
pub fn change(feed: Predictor, known: &[Known], c: f64, scene: &Dimensionless) -> (f64, f64) {
    match (feed, known) {
        (Predictor::None, _) | (_, []) => (0.0, 0.0),
        (Predictor::Theory, [.., last]) => by_theory(scene, last.c, c).unwrap_or((0.0, 0.0)),
        (Predictor::Previous, _) => extrapolate(&known[known.len().saturating_sub(3)..], c),
    }
}

fn by_theory(scene: &Dimensionless, from: f64, to: f64) -> Option<(f64, f64)> {
    let (from, to) = (backbone_at_level(scene, from)?, backbone_at_level(scene, to)?);
    Some((to.g - from.g, to.sigma - from.sigma))
}

/// The polynomial through up to three points, minus its value at the last.
fn extrapolate(points: &[Known], c: f64) -> (f64, f64) {
    let (mut g, mut sigma) = (0.0, 0.0);
    for (i, point) in points.iter().enumerate() {
        let others = points.iter().enumerate().filter(|(j, _)| *j != i);
        let weight: f64 = others.map(|(_, other)| (c - other.c) / (point.c - other.c)).product();
        g += weight * point.g;
        sigma += weight * point.sigma;
    }
    let last = points[points.len() - 1];
    (g - last.g, sigma - last.sigma)
}

/// Periods of the first level more than those of the move: the start of the loop disturbs the particle, too.
pub const FIRST: f64 = 32.0;
/// Last periods of a move, in which the response is within 1 % of its level.
pub const LAST: f64 = 1.0;
/// Delays of the particle behind the amplitude after which a move is over.
const DELAYS: f64 = 3.0;
/// Most periods of that.
const MOST_LATE: f64 = 8.0;
/// Periods of a change of the phase more than those of the move, for the same reason.
pub const PHASE: f64 = 8.0;
/// Share of the drive that a move may need in addition to the drive that holds the response.
const MOVE_SHARE: f64 = 0.8;

/// Periods of the move to a level: those of the scene, or as many as the drive needs to change the response that much.
pub fn move_periods(scene: &Scene, from: Option<&Known>, level: f64) -> f64 {
    let slowest = from.map_or(0.0, |from| {
        2.0 * (level - from.c).abs() / (MOVE_SHARE * scene.dimensionless().epsilon * from.g * std::f64::consts::TAU)
    });
    scene.backbone.move_periods.max(slowest)
}

/// Periods after a move to the level `c` in which the particle still follows: many near the fold, where a multiplier of its map tends to 1.
pub fn late(d: &Dimensionless, c: f64) -> f64 {
    let manifold = SlowFlow::new(d.lambda, d.r).manifold;
    let slowest = |b: f64| half_period_multipliers(d.r, b).map(|one| 0.5 / (1.0 - one).norm());
    let delay = manifold
        .b(c, BranchSide::Right)
        .map_or(0.0, |b| slowest(b).into_iter().fold(0.0, f64::max));
    (DELAYS * delay).min(MOST_LATE)
}

#[cfg(test)]
#[path = "../../tests/unit/predictor.rs"]
mod tests;
