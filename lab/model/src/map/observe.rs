//! One point of the map: a plant is driven until its regime is decided.

use lovines::InvalidValue;

use super::decide::REPEATED;
use super::run::{Point, Run};
use crate::Dimensionless;
use crate::regime::Regime;

/// Periods after which the motion is compared with the symmetric orbit for the first time; from then on whenever their number has grown
/// by [`LATER`].
const FIRST: usize = 14;
const LATER: f64 = 1.25;
/// Periods over which the exponent of a repeating motion is measured.
const EXPONENT: usize = 256;

/// Periods to which an undecided cell is continued. The whole motion is in memory: about 250 bytes per period.
fn continued(limit: usize) -> usize {
    (16 * limit).min((4 * limit).max(100_000))
}

/// Drives the dimensionless plant of `scene` at the detuning `sigma` from `start` = (q1, q1', q2, q2') until its regime is decided, for
/// at most `limit` periods. Only a motion that settles on a periodic one, or cannot reach a wall, is decided earlier, and only an
/// undecided one is continued.
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

/// Number of periods at the next examination.
fn later(periods: usize, last: usize) -> usize {
    ((periods as f64 * LATER).ceil() as usize).min(last)
}

impl Run {
    /// Follows the motion until its regime is decided, for at most `limit` periods; it is not examined before `first` periods.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn decided(&mut self, first: usize, limit: usize) -> Result<Point, InvalidValue> {
        let mut next = FIRST.min(limit);
        let mut repelled = false;
        loop {
            self.follow(next)?;
            if next < first.min(limit) {
                next = later(next, limit);
                continue;
            }
            let early = next < limit;
            if early && let Some(point) = self.approaching(limit) {
                return Ok(point);
            }
            if next < (REPEATED / 2).min(limit) {
                next = later(next, limit);
                continue;
            }
            if let Some(point) = self.without_impacts() {
                return Ok(point);
            }
            // A motion leaves the neighbourhood of an unstable one before it can settle, and a slow approach is seen at the limit.
            repelled &= early && self.approached().is_some();
            if !repelled {
                if let Some(point) = self.settled(early)? {
                    return Ok(point);
                }
                repelled = self.lingers();
            }
            if next >= limit {
                let point = self.irregular();
                if point.regime != Regime::Undecided || next >= continued(limit) {
                    return Ok(point);
                }
            }
            next = later(next, if early { limit } else { continued(limit) });
        }
    }

    /// The motion repeats itself, or will soon.
    fn settled(&mut self, early: bool) -> Result<Option<Point>, InvalidValue> {
        let settling = self.settling(early);
        if settling.is_some() || self.repeating(early).is_none() {
            return Ok(settling);
        }
        // Near an unstable motion, recurrence lasts a while: it must last longer, and disturbances must shrink.
        let settled = self.periods;
        self.follow(settled + EXPONENT)?;
        let (exponent, error) = self.exponent(settled);
        let point = self.repeating(early).filter(|_| exponent < 0.0);
        Ok(point.map(|point| Point {
            exponent: Some(exponent),
            exponent_error: Some(error),
            ..point
        }))
    }
}
