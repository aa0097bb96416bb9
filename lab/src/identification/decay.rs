//! The backbone along the free decay: a window slides from the release to the loss of synchrony.

use serde::Serialize;

use super::COMPARED_ABOVE;
use super::fit::{harmonic, mean_at_middle};
use super::regime::{end_of_synchrony, impacts};
use crate::experiment::Record;
use crate::scene::Scene;
use crate::theory::{BranchSide, SlowFlow};

/// One point along the decay; dimensionless.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct DecayPoint {
    /// Time since the release, `omega0 t`.
    pub tau: f64,
    /// Amplitude of the fundamental of v.
    #[serde(rename = "C")]
    pub c: f64,
    /// Particle speed; absent where the rig does not tell.
    #[serde(rename = "B")]
    pub b: Option<f64>,
    /// Detuning.
    pub sigma: f64,
    /// Detuning of the backbone at this C, to first order; absent below the fold.
    pub sigma_theory: Option<f64>,
}

/// Points per period along the decay.
const PER_PERIOD: f64 = 8.0;

pub(super) fn points(record: &Record, scene: &Scene, slow_flow: &SlowFlow) -> Vec<DecayPoint> {
    let d = scene.dimensionless();
    let decay = record.decay();
    let dt = record.sample_time;
    let Some(first) = decay.first() else {
        return Vec::new();
    };
    // The command of the last held sample: the frequency to start from.
    let mut omega = record
        .hold()
        .last()
        .map_or(d.omega0, |s| s.command.drive.omega);
    let half_period = std::f64::consts::PI / omega;
    let end = if first.witness.is_some() {
        end_of_synchrony(&impacts(decay), half_period).unwrap_or(first.time)
    } else {
        f64::INFINITY
    };
    let window = (scene.record.window_periods * 2.0 * half_period / dt).round() as usize + 1;
    let step = ((2.0 * half_period / dt / PER_PERIOD).round() as usize).max(1);
    let mut points = Vec::new();
    for samples in decay.windows(window).step_by(step) {
        if samples.last().is_none_or(|last| last.time > end) {
            break;
        }
        let values: Vec<f64> = samples.iter().map(|s| s.sensors.response).collect();
        let Some(v) = harmonic(&values, dt, omega) else {
            break;
        };
        omega = v.omega;
        let speeds: Option<Vec<f64>> = samples
            .iter()
            .map(|s| s.witness.map(|w| w.particle_velocity.abs()))
            .collect();
        let c = v.amplitude / d.b;
        points.push(DecayPoint {
            tau: d.omega0 * (0.5 * (samples[0].time + samples[window - 1].time) - first.time),
            c,
            b: speeds.map(|speeds| mean_at_middle(speeds.into_iter()) / (d.b * d.omega0)),
            sigma: d.sigma(omega),
            sigma_theory: slow_flow.backbone_sigma(c, BranchSide::Right),
        });
    }
    points
}

/// RMS of sigma less theory over the points above [`COMPARED_ABOVE`]; `None` where there is none.
pub(super) fn rms_sigma_error(points: &[DecayPoint]) -> Option<f64> {
    let squares: Vec<f64> = points
        .iter()
        .filter(|point| point.c > COMPARED_ABOVE)
        .filter_map(|point| {
            point
                .sigma_theory
                .map(|theory| (point.sigma - theory).powi(2))
        })
        .collect();
    (!squares.is_empty()).then(|| (squares.iter().sum::<f64>() / squares.len() as f64).sqrt())
}
