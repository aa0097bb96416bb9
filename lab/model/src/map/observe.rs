//! One point of the map: a plant is driven until its regime is decided.

use lovines::InvalidValue;

use super::run::{Point, Run};
use crate::Dimensionless;
use crate::regime::Regime;

/// Periods after which the motion is examined for the first time; from then on whenever their number has grown by a quarter.
const FIRST: usize = 16;

/// Drives the dimensionless plant of `scene` at the detuning `sigma` from `start` = (q1, q1', q2, q2') until its regime is decided, for
/// at most `limit` periods. A motion that settles on a periodic one, or cannot reach a wall, is decided earlier.
///
/// # Errors
/// Invalid parameters or an invalid start.
pub fn observe(scene: &Dimensionless, sigma: f64, start: [f64; 4], limit: usize) -> Result<Point, InvalidValue> {
    Run::new(scene, sigma, start)?.decided(0, limit)
}

/// Difference of the starts of motions that must agree, and periods from which on a transient may be chaos that ends at random.
const APART: f64 = 1e-9;
const LATE: f64 = 500.0;

/// As [`observe`], with the regime of a motion from another start, 1e-9 and more apart, that differs. `others` such motions are followed
/// where chance decides when chaos ends: the regime is irregular, or it began late.
///
/// # Errors
/// As [`observe`].
pub fn observe_confirmed(
    scene: &Dimensionless,
    sigma: f64,
    start: [f64; 4],
    limit: usize,
    others: usize,
) -> Result<(Point, Option<Regime>), InvalidValue> {
    let point = observe(scene, sigma, start, limit)?;
    let irregular = point.impacts == 0 && ![Regime::NoImpacts, Regime::Undecided].contains(&point.regime);
    let count = if irregular || point.transient > LATE { others } else { 0 };
    for n in 1..=count {
        let [q1, dq1, q2, dq2] = start;
        let regime = observe(scene, sigma, [q1, dq1 + n as f64 * APART, q2, dq2], limit)?.regime;
        if regime != point.regime {
            return Ok((point, Some(regime)));
        }
    }
    Ok((point, None))
}

impl Run {
    /// Follows the motion until its regime is decided, for at most `limit` periods; it is not examined before `first` periods.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn decided(&mut self, first: usize, limit: usize) -> Result<Point, InvalidValue> {
        let mut periods = first.max(FIRST).min(limit);
        loop {
            self.follow(periods)?;
            if let Some(point) = self.lasting() {
                return Ok(point);
            }
            if periods >= limit {
                return Ok(self.irregular());
            }
            periods = (periods + periods / 4).min(limit);
        }
    }
}
