//! The locked point.

use serde::Serialize;

use vines_model::numerics::mean;
use vines_model::regime::Regime;

use super::fit::harmonic;
use super::regime::classify;
use super::response::regime_by_response;
use crate::experiment::Record;
use crate::scene::Scene;

/// The locked point as measured over the hold; dimensionless.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Lock {
    /// Base amplitude over `b epsilon`, measured if a sensor reads the base, otherwise commanded.
    #[serde(rename = "G")]
    pub g: f64,
    /// Detuning.
    pub sigma: f64,
    /// Amplitude of the fundamental of v over b.
    #[serde(rename = "C")]
    pub c: f64,
    /// Mean particle speed over `b omega0`; absent if the rig does not report it.
    #[serde(rename = "B")]
    pub b: Option<f64>,
    /// Phase of v relative to the base, minus the target, degrees.
    pub phase_error_deg: f64,
    /// From the start to the settled lock, in periods of the locked motion.
    pub periods_to_lock: f64,
    /// Impacts per period; NaN if the rig does not report them.
    pub impacts_per_period: f64,
    /// The regime: from the impacts, or from the response alone if the rig does not report them.
    pub regime: Regime,
}

impl Lock {
    /// The number of impacts per period, or the note that the regime was determined without it.
    #[must_use]
    pub fn impacts(&self) -> String {
        if self.impacts_per_period.is_nan() {
            "determined from the response alone".into()
        } else {
            format!("{:.3} impacts per period", self.impacts_per_period)
        }
    }
}

pub(super) fn measure(record: &Record, scene: &Scene) -> Lock {
    let d = scene.dimensionless();
    let hold = record.hold();
    let dt = record.sample_time;
    let commanded = mean(hold.iter().map(|s| s.command.drive.omega));
    let response: Vec<f64> = hold.iter().map(|s| s.sensors.response).collect();
    let v = harmonic(&response, dt, commanded);
    let omega = v.map_or(commanded, |v| v.omega);
    let reference: Option<Vec<f64>> = hold.iter().map(|s| s.sensors.reference).collect();
    let base = reference.and_then(|reference| harmonic(&reference, dt, commanded));
    let command = hold[hold.len() / 2].command;
    let phase_error = match (v, base) {
        (Some(v), Some(base)) => {
            let turn = std::f64::consts::TAU;
            let error = v.phase - base.phase - scene.controller.phase_target_radians();
            error - turn * (error / turn).round()
        }
        _ => command.phase_error,
    };
    let speeds: Option<Vec<f64>> = hold
        .iter()
        .map(|s| s.ground_truth.map(|w| w.particle_velocity.abs()))
        .collect();
    let (impacts_per_period, regime) = match classify(hold, dt, omega) {
        (count, Regime::Unknown) => (count, regime_by_response(hold, scene)),
        told => told,
    };
    let amplitude = base.map_or(command.drive.amplitude, |base| base.amplitude);
    Lock {
        g: d.excitation(amplitude),
        sigma: d.sigma(omega),
        c: v.map_or(0.0, |v| v.amplitude) / d.b,
        b: speeds.map(|speeds| d.speed(mean(speeds))),
        phase_error_deg: phase_error.to_degrees(),
        periods_to_lock: record.settled as f64 * dt * omega / std::f64::consts::TAU,
        impacts_per_period,
        regime,
    }
}
