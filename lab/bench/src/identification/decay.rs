//! The backbone along the free decay: a window slides from the release to the loss of synchrony.

use std::f64::consts::TAU;
use std::ops::Range;

use serde::Serialize;

use super::crossings;
use super::fit::harmonic;
use super::regime::impacts;
use crate::experiment::Record;
use crate::scene::{Estimator, Scene};
use vines_model::numerics::mean;
use vines_model::regime::end_of_synchrony;

/// One point along the decay; dimensionless.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct DecayPoint {
    /// Time since the release, `omega0 t`.
    pub tau: f64,
    /// Amplitude of the fundamental of v.
    #[serde(rename = "C")]
    pub c: f64,
    /// Particle speed; absent if the rig does not report it.
    #[serde(rename = "B")]
    pub b: Option<f64>,
    /// Detuning.
    pub sigma: f64,
}

/// Points per period along the decay.
const PER_PERIOD: f64 = 8.0;

/// The points along the decay of a record, up to the loss of synchrony where the rig reports impacts.
#[must_use]
pub fn decay_points(record: &Record, scene: &Scene) -> Vec<DecayPoint> {
    let d = scene.dimensionless();
    let decay = record.decay();
    let dt = record.sample_time;
    let Some(first) = decay.first() else {
        return Vec::new();
    };
    // Initial frequency: the command of the last held sample.
    let omega = record.hold().last().map_or(d.omega0, |s| s.command.drive.omega);
    let half_period = std::f64::consts::PI / omega;
    let end = if first.ground_truth.is_some() {
        end_of_synchrony(&impacts(decay), half_period).unwrap_or(first.time)
    } else {
        f64::INFINITY
    };
    let values: Vec<f64> = decay.iter().map(|s| s.sensors.response).collect();
    let pieces = match scene.record.estimator {
        Estimator::Fit => fitted(&values, dt, omega, scene.record.window_periods),
        Estimator::Crossings => crossings::periods(&values, dt)
            .into_iter()
            .map(|period| Piece {
                time: period.middle * dt,
                amplitude: period.amplitude,
                omega: period.omega,
                samples: period.samples,
            })
            .collect(),
    };
    pieces
        .into_iter()
        .take_while(|piece| decay[piece.samples.end - 1].time <= end)
        .map(|piece| {
            let speeds: Option<Vec<f64>> = decay[piece.samples]
                .iter()
                .map(|s| s.ground_truth.map(|w| w.particle_velocity.abs()))
                .collect();
            DecayPoint {
                tau: d.omega0 * piece.time,
                c: piece.amplitude / d.b,
                // The mean is the value at the middle of the straight line that fits best.
                b: speeds.map(|speeds| d.speed(mean(speeds))),
                sigma: d.sigma(piece.omega),
            }
        })
        .collect()
}

/// An estimate from some samples: amplitude (m) and frequency (rad/s) at a time (s) since the release.
struct Piece {
    samples: Range<usize>,
    time: f64,
    amplitude: f64,
    omega: f64,
}

/// Fits in a sliding window of `periods`. Each fit starts from the frequency of the one before, the first from `omega`.
fn fitted(values: &[f64], dt: f64, mut omega: f64, periods: f64) -> Vec<Piece> {
    let period = TAU / omega / dt;
    let window = (periods * period).round() as usize + 1;
    let step = ((period / PER_PERIOD).round() as usize).max(1);
    let mut pieces = Vec::new();
    for (n, values) in values.windows(window).enumerate().step_by(step) {
        let Some(v) = harmonic(values, dt, omega) else {
            break;
        };
        omega = v.omega;
        pieces.push(Piece {
            samples: n..n + window,
            time: (n as f64 + 0.5 * (window - 1) as f64) * dt,
            amplitude: v.amplitude,
            omega,
        });
    }
    pieces
}
