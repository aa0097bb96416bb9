//! Detuning along a free decay from zero crossings: without a model, exact on clean data. Estimates are compared with it.

use std::f64::consts::TAU;

use vines_model::numerics::bisection;
use vines_testbench::{record::Record, scene::Scene};

/// Time since the release, times omega0, and sigma in every period between alternate zero crossings.
///
/// A crossing is located on the cubic through four samples; at a hundred samples per period its error is below 1e-7 of a sample.
/// A period spans two crossings, so that an offset and even harmonics have no effect to first order.
pub fn detunings(record: &Record, scene: &Scene) -> Vec<[f64; 2]> {
    let values: Vec<f64> = record.decay().iter().map(|sample| sample.sensors.response).collect();
    let crossings: Vec<f64> = (1..values.len().saturating_sub(2))
        .filter(|&n| (values[n] > 0.0) != (values[n + 1] > 0.0))
        .map(|n| n as f64 + between([values[n - 1], values[n], values[n + 1], values[n + 2]]))
        .collect();
    let d = scene.dimensionless();
    let step = record.sample_time;
    crossings
        .windows(3)
        .map(|span| {
            let omega = TAU / ((span[2] - span[0]) * step);
            [0.5 * (span[0] + span[2]) * step * d.omega0, d.sigma(omega)]
        })
        .collect()
}

/// Sigma at a time, interpolated linearly; `None` outside the points.
pub fn at(points: &[[f64; 2]], tau: f64) -> Option<f64> {
    let after = points.partition_point(|point| point[0] < tau);
    let (from, to) = (points.get(after.checked_sub(1)?)?, points.get(after)?);
    Some(from[1] + (tau - from[0]) / (to[0] - from[0]) * (to[1] - from[1]))
}

/// Where the cubic through values at -1, 0, 1 and 2 is zero, between 0 and 1.
fn between(y: [f64; 4]) -> f64 {
    let cubic = |x: f64| {
        -y[0] * x * (x - 1.0) * (x - 2.0) / 6.0 + y[1] * (x + 1.0) * (x - 1.0) * (x - 2.0) / 2.0
            - y[2] * (x + 1.0) * x * (x - 2.0) / 2.0
            + y[3] * (x + 1.0) * x * (x - 1.0) / 6.0
    };
    let (low, high) = bisection(0.0, 1.0, |x| (cubic(x) > 0.0) == (y[2] > y[1]));
    0.5 * (low + high)
}
