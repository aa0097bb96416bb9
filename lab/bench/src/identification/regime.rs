//! The regime, from the impacts that a simulated rig reports.

use std::f64::consts::TAU;

use vines_model::numerics::mean;
use vines_model::regime::{Impact, MEASURED, Regime, one_to_one};

use crate::record::Sample;

/// The impacts in the samples; of several between two samples, the last one.
#[must_use]
pub fn impacts(samples: &[Sample]) -> Vec<Impact> {
    let truths: Vec<_> = samples.iter().filter_map(|sample| sample.ground_truth).collect();
    truths
        .windows(2)
        .filter(|pair| pair[1].impacts > pair[0].impacts)
        .map(|pair| Impact { time: pair[1].impact_time, velocity: pair[1].impact_velocity })
        .collect()
}

/// The wall, -1 or 1, after which the longer flights begin, on average; `None` without impacts.
pub(super) fn longer_after(samples: &[Sample]) -> Option<i8> {
    let impacts = impacts(samples);
    let after = |wall: f64| {
        let flights = impacts.windows(2).filter(move |pair| pair[0].velocity * wall > 0.0);
        mean(flights.map(|pair| pair[1].time - pair[0].time))
    };
    let difference = after(1.0) - after(-1.0);
    (!difference.is_nan()).then_some(if difference > 0.0 { 1 } else { -1 })
}

/// Impacts per period of `omega` (rad/s) over the samples, and the regime they make.
#[must_use]
pub fn classify(samples: &[Sample], sample_time: f64, omega: f64) -> (f64, Regime) {
    let mut truths = samples.iter().filter_map(|sample| sample.ground_truth);
    let (Some(first), Some(last)) = (truths.next(), truths.next_back()) else {
        return (f64::NAN, Regime::Unknown);
    };
    let impacts = impacts(samples);
    let (Some(from), Some(to)) = (impacts.first(), impacts.last()) else {
        return (0.0, Regime::NoImpacts);
    };
    let (span, period) = (to.time - from.time, TAU / omega);
    // Counted from impact to impact, so that the ends of the record have no influence.
    let count = (last.impacts - first.impacts) as f64;
    let per_period = if span > 0.0 {
        (count - 1.0) * period / span
    } else {
        count * period / (samples.len() as f64 * sample_time)
    };
    (per_period, one_to_one(&impacts, per_period, MEASURED))
}
