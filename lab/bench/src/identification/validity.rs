//! What makes a record useless: a phase off its target while the lock was held, and a sensor that fails after the release.

use super::{IdentificationError, Lock};
use crate::record::Record;
use crate::scene::Scene;
use vines_model::numerics::{SIGNIFICANT, standard_deviation};

/// Share of a free response that impacts leave in two periods at least. They take the share pi epsilon G_imp/C in each, with
/// G_imp = (4/pi) R B^2/C: 0.14 at epsilon = 0.05, r = 0.65, C = 0.5.
const LEFT: f64 = 0.1;
/// Steps of a converter below which the scatter of a response says nothing.
const STEPS: f64 = 8.0;

/// Refuses a lock whose phase is farther from its target than the tolerance of the lock.
pub(super) fn on_target(lock: &Lock, scene: &Scene) -> Result<(), IdentificationError> {
    let (error, tolerance) = (lock.at.phase_error_deg, scene.controller.phase_tolerance);
    if error.abs() <= tolerance + SIGNIFICANT * lock.at.u_phase_deg {
        return Ok(());
    }
    Err(IdentificationError::OffTarget { error, uncertainty: lock.at.u_phase_deg, tolerance })
}

/// Refuses a decay in which a sensor reads no number, or in which the response is lost within two periods.
pub(super) fn sensors_after_release(record: &Record, scene: &Scene) -> Result<(), IdentificationError> {
    let decay = record.decay();
    let failed = |n: usize, what| {
        let seconds = n as f64 * record.sample_time;
        Err(IdentificationError::SensorAfterRelease { seconds, what })
    };
    let is_number = |value: f64| value.is_finite();
    let all_numbers =
        |n: &usize| is_number(decay[*n].sensors.response) && decay[*n].sensors.reference.is_none_or(is_number);
    if let Some(n) = (0..decay.len()).find(|n| !all_numbers(n)) {
        return failed(n, "reads no number");
    }
    let period = scene.controller.samples_per_period.round() as usize;
    let response: Vec<f64> = decay.iter().map(|sample| sample.sensors.response).collect();
    let changes = response.windows(2).map(|pair| (pair[1] - pair[0]).abs());
    let step = changes.filter(|change| *change > 0.0).fold(f64::INFINITY, f64::min);
    let scatters: Vec<f64> = response.chunks_exact(period).map(standard_deviation).collect();
    let linear = scene.linear();
    let left = LEFT * (-2.0 * std::f64::consts::TAU * linear.damping_rate / linear.omega0).exp();
    let is_lost = |n: &usize| scatters[*n] > STEPS * step && scatters[n + 2] < left * scatters[*n];
    match (0..scatters.len().saturating_sub(2)).find(is_lost) {
        Some(n) => failed((n + 1) * period, "stops reading the response"),
        None => Ok(()),
    }
}
