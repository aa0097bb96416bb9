//! The backbone along the free decay: a window slides from the release to the loss of synchrony.

use std::f64::consts::{PI, TAU};
use std::ops::Range;

use serde::Serialize;

use super::crossings;
use super::fit::harmonic;
use super::regime::impacts;
use crate::experiment::{Record, Sample};
use crate::scene::{Dimensionless, Estimator, Scene};
use vines_model::numerics::{Estimate, mean};
use vines_model::regime::end_of_synchrony;
use vines_model::theory::{BranchSide, SlowFlow, half_period_multipliers};

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
    /// Rate of change of the amplitude, `dC/dtau`.
    pub rate: f64,
    /// Detuning of the steady motion of the same amplitude: sigma less the effect of the drift; absent near the fold and below.
    pub sigma_steady: Option<f64>,
    /// Standard uncertainty of C.
    #[serde(rename = "u_C")]
    pub u_c: f64,
    /// Standard uncertainty of sigma.
    pub u_sigma: f64,
    /// Standard uncertainty of `sigma_steady`; absent as above.
    pub u_sigma_steady: Option<f64>,
}

/// What ended the points of a decay.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub enum DecayEnd {
    /// The impacts are no longer two per period at even intervals.
    #[serde(rename = "loss of synchrony")]
    Synchrony,
    /// The record ended earlier: record.decay_periods is too short to see the loss of synchrony.
    #[serde(rename = "end of the record")]
    Record,
    /// The amplitude fell to the fold of the backbone, on a rig that does not report impacts.
    #[serde(rename = "fold of the backbone")]
    Fold,
}

/// The points along a decay, and what ended them.
#[derive(Debug, Clone, PartialEq)]
pub struct DecayPoints {
    /// The points.
    pub points: Vec<DecayPoint>,
    /// Why there are no further ones.
    pub end: DecayEnd,
}

/// Points per period along the decay.
const PER_PERIOD: f64 = 8.0;

/// The points along the decay of a record, up to the loss of synchrony where the rig reports impacts, otherwise to the fold.
#[must_use]
pub fn decay_points(record: &Record, scene: &Scene) -> DecayPoints {
    let d = scene.dimensionless();
    let decay = record.decay();
    let dt = record.sample_time;
    let (Some(first), Some(last)) = (decay.first(), decay.last()) else {
        return DecayPoints { points: Vec::new(), end: DecayEnd::Record };
    };
    // Initial frequency: the command of the last held sample.
    let omega = record.hold().last().map_or(d.omega0, |s| s.command.drive.omega);
    let half_period = PI / omega;
    let flow = SlowFlow::new(d.lambda, d.r);
    let has_impacts = first.ground_truth.is_some();
    let until = if has_impacts {
        end_of_synchrony(&impacts(decay), half_period).unwrap_or(first.time)
    } else {
        f64::INFINITY
    };
    let lowest = if has_impacts { 0.0 } else { flow.manifold.c_min() * d.b };
    let values: Vec<f64> = decay.iter().map(|s| s.sensors.response).collect();
    let pieces = match scene.record.estimator {
        Estimator::Fit => fitted(&values, dt, omega, scene.record.window_periods),
        Estimator::Crossings => crossed(&values, dt),
    };
    let at_fold = pieces.iter().any(|piece| piece.amplitude < lowest);
    let end = if at_fold {
        DecayEnd::Fold
    } else if has_impacts && until + 2.0 * half_period < last.time {
        DecayEnd::Synchrony
    } else {
        DecayEnd::Record
    };
    let points = pieces
        .into_iter()
        .take_while(|piece| decay[piece.samples.end - 1].time <= until && piece.amplitude >= lowest)
        .map(|piece| piece.point(decay, &d, &flow))
        .collect();
    DecayPoints { points, end }
}

/// An estimate from some samples at a time (s) since the release.
struct Piece {
    samples: Range<usize>,
    time: f64,
    /// m
    amplitude: f64,
    /// rad/s
    omega: f64,
    /// Rate of change of the amplitude, m/s.
    rate: f64,
    /// Standard uncertainties of amplitude and frequency by noise.
    uncertainties: [f64; 2],
}

impl Piece {
    fn point(&self, decay: &[Sample], d: &Dimensionless, flow: &SlowFlow) -> DecayPoint {
        let speeds: Option<Vec<f64>> = decay[self.samples.clone()]
            .iter()
            .map(|s| s.ground_truth.map(|w| w.particle_velocity.abs()))
            .collect();
        let (c, rate, sigma) = (self.amplitude / d.b, self.rate / (d.b * d.omega0), d.sigma(self.omega));
        let span = (self.samples.end - self.samples.start) as f64 / decay.len() as f64
            * (decay[decay.len() - 1].time - decay[0].time);
        let window = rate * d.omega0 * span;
        let backbone = |c: f64| flow.backbone_sigma(c, BranchSide::Right);
        // The fit weighs the frequencies of its window by a parabola: curvature changes their mean by a fortieth.
        let bent = match (backbone(c - 0.5 * window), backbone(c), backbone(c + 0.5 * window)) {
            (Some(before), Some(middle), Some(after)) => 0.1 * (before - 2.0 * middle + after),
            _ => 0.0,
        };
        let noise = self.uncertainties[1] / d.omega_change(1.0);
        let [u_c, u_sigma] = [
            self.uncertainties[0] / d.b,
            Estimate::new(sigma, &[noise, bent]).uncertainty,
        ];
        let correction = correction(flow, d, [c, rate], d.omega0 * self.time);
        let slope = backbone(c + u_c).zip(backbone(c)).map_or(0.0, |(after, at)| after - at);
        DecayPoint {
            tau: d.omega0 * self.time,
            c,
            // The mean is the value at the middle of the straight line that fits best.
            b: speeds.map(|speeds| d.speed(mean(speeds))),
            sigma,
            rate,
            sigma_steady: correction.map(|by_drift| sigma - by_drift.value),
            u_c,
            u_sigma,
            u_sigma_steady: correction
                .map(|by_drift| Estimate::new(sigma, &[u_sigma, slope, by_drift.uncertainty]).uncertainty),
        }
    }
}

/// Effect of the drift `[C, dC/dtau]` on sigma, at `tau` since the release.
///
/// The particle follows a change with the multipliers of its map. The effect is therefore late by their delay, and is not complete soon
/// after the release, where the drift begins. Both are parts of the uncertainty. `None` where the first is as large as the effect
/// (towards the fold), because the series in the rate of the drift fails there.
fn correction(flow: &SlowFlow, d: &Dimensionless, [c, rate]: [f64; 2], tau: f64) -> Option<Estimate> {
    let by_drift = |c: f64, rate: f64| Some(flow.drift(c)?.sigma * rate);
    let b = flow.manifold.b(c, BranchSide::Right)?;
    let multipliers = half_period_multipliers(d.r, b);
    let delay = multipliers
        .map(|one| PI / (1.0 - one).norm())
        .into_iter()
        .fold(0.0, f64::max);
    let slowest = multipliers.map(nalgebra::Complex::norm).into_iter().fold(0.0, f64::max);
    // Along the decay, by first-order theory.
    let effect = |c: f64| {
        let b = flow.manifold.b(c, BranchSide::Right)?;
        by_drift(c, -0.5 * d.epsilon * flow.backbone_at(b).g)
    };
    let step = 1e-3 * c;
    let late = rate * delay * (effect(c + step)? - effect(c - step)?) / (2.0 * step);
    let value = by_drift(c, rate)?;
    let incomplete = value * slowest.min(1.0).powf(tau / PI);
    (late.abs() < value.abs()).then(|| Estimate::new(value, &[late, incomplete]))
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
            rate: v.rate,
            uncertainties: v.uncertainties,
        });
    }
    pieces
}

/// One estimate per period between zero crossings; the differences of its neighbours give rate and scatter.
fn crossed(values: &[f64], dt: f64) -> Vec<Piece> {
    let periods = crossings::periods(values, dt);
    let last = periods.len().saturating_sub(1);
    let piece = |n: usize| {
        let (from, here, to) = (&periods[n.saturating_sub(1)], &periods[n], &periods[(n + 1).min(last)]);
        let scatter = |value: fn(&crossings::Period) -> f64| {
            // White noise of variance 1 gives second differences the variance 6.
            (value(from) - 2.0 * value(here) + value(to)).abs() / 6f64.sqrt()
        };
        Piece {
            samples: here.samples.clone(),
            time: here.middle * dt,
            amplitude: here.amplitude,
            omega: here.omega,
            rate: (to.amplitude - from.amplitude) / ((to.middle - from.middle) * dt),
            uncertainties: [scatter(|period| period.amplitude), scatter(|period| period.omega)],
        }
    };
    (0..periods.len()).map(piece).collect()
}
