//! The regime, from the impacts: how many per period, on which walls, how evenly.

use std::fmt::{self, Display, Formatter};

use serde::Serialize;

use crate::experiment::Sample;

/// One impact.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Impact {
    /// When, s.
    pub time: f64,
    /// Relative velocity just before, m/s; its sign tells the wall.
    pub velocity: f64,
}

/// What the particle does.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub enum Regime {
    /// The particle hits nothing: the linear mode.
    #[serde(rename = "no impacts")]
    Silent,
    /// Two impacts per period, on alternating walls, half a period apart: symmetric 1:1.
    #[serde(rename = "symmetric 1:1")]
    Symmetric,
    /// Two impacts per period, on alternating walls, at uneven intervals.
    #[serde(rename = "asymmetric 1:1")]
    Asymmetric,
    /// Anything else.
    #[serde(rename = "other")]
    Other,
    /// Steady and off the linear mode, with its symmetry lost in noise: what a response alone can leave open.
    #[serde(rename = "steady, symmetry unresolved")]
    Unresolved,
    /// The rig does not tell its impacts.
    #[serde(rename = "unknown")]
    Unknown,
}

impl Display for Regime {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Regime::Silent => "without impacts (the linear mode)",
            Regime::Symmetric => "symmetric 1:1",
            Regime::Asymmetric => "asymmetric 1:1",
            Regime::Other => "irregular",
            Regime::Unresolved => "steady and nonlinear (noise hides its symmetry)",
            Regime::Unknown => "unknown (the rig does not tell its impacts)",
        })
    }
}

/// Deviation of the impacts per period from two that still counts as two.
const COUNT_TOLERANCE: f64 = 0.05;
/// Largest standard deviation of the intervals, relative to their mean, in a symmetric regime.
const SPREAD_TOLERANCE: f64 = 0.01;

/// The impacts that the samples tell of; where several fell between two samples, the last one.
#[must_use]
pub fn impacts(samples: &[Sample]) -> Vec<Impact> {
    let witnesses: Vec<_> = samples.iter().filter_map(|sample| sample.witness).collect();
    witnesses
        .windows(2)
        .filter(|pair| pair[1].impacts > pair[0].impacts)
        .map(|pair| Impact {
            time: pair[1].impact_time,
            velocity: pair[1].impact_velocity,
        })
        .collect()
}

/// Impacts per period of `omega` (rad/s) over the samples, and the regime they make.
pub(crate) fn classify(samples: &[Sample], sample_time: f64, omega: f64) -> (f64, Regime) {
    let mut witnesses = samples.iter().filter_map(|sample| sample.witness);
    let (Some(first), Some(last)) = (witnesses.next(), witnesses.next_back()) else {
        return (f64::NAN, Regime::Unknown);
    };
    let impacts = impacts(samples);
    let Some(span) = impacts
        .last()
        .zip(impacts.first())
        .map(|(b, a)| b.time - a.time)
    else {
        return (0.0, Regime::Silent);
    };
    let period = std::f64::consts::TAU / omega;
    // Counted from impact to impact, so that the ends of the record take no part.
    let count = (last.impacts - first.impacts) as f64;
    let per_period = if span > 0.0 {
        (count - 1.0) * period / span
    } else {
        count * period / (samples.len() as f64 * sample_time)
    };
    if (per_period - 2.0).abs() > COUNT_TOLERANCE || !alternate(&impacts) {
        return (per_period, Regime::Other);
    }
    let regime = if spread(&impacts) <= SPREAD_TOLERANCE {
        Regime::Symmetric
    } else {
        Regime::Asymmetric
    };
    (per_period, regime)
}

fn alternate(impacts: &[Impact]) -> bool {
    impacts
        .windows(2)
        .all(|pair| pair[0].velocity * pair[1].velocity < 0.0)
}

/// Standard deviation of the intervals between impacts, relative to their mean.
fn spread(impacts: &[Impact]) -> f64 {
    let intervals = intervals(impacts);
    let n = intervals.len() as f64;
    let mean = intervals.iter().sum::<f64>() / n;
    let variance = intervals.iter().map(|i| (i - mean).powi(2)).sum::<f64>() / n;
    variance.sqrt() / mean
}

fn intervals(impacts: &[Impact]) -> Vec<f64> {
    impacts
        .windows(2)
        .map(|pair| pair[1].time - pair[0].time)
        .collect()
}

/// Deviation of an interval from half a period at which the impacts have lost synchrony.
const SYNCHRONY_TOLERANCE: f64 = 0.25;

/// Time of the last impact that is still in synchrony with a motion whose half period starts as `half_period` (s) and
/// changes slowly: on the other wall than the one before, about as long after it as that one after its own predecessor.
pub(super) fn end_of_synchrony(impacts: &[Impact], half_period: f64) -> Option<f64> {
    let mut expected = half_period;
    let mut end = impacts.first()?.time;
    for pair in impacts.windows(2) {
        let interval = pair[1].time - pair[0].time;
        let in_step = (interval / expected - 1.0).abs() <= SYNCHRONY_TOLERANCE;
        if !in_step || pair[0].velocity * pair[1].velocity >= 0.0 {
            break;
        }
        expected = interval;
        end = pair[1].time;
    }
    Some(end)
}
