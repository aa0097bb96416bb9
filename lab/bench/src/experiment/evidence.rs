//! What the sensors read when the controller switched the drive off, beside the limits of the scene.

use std::f64::consts::TAU;

use phase_lock::Config;

use super::{PhaseError, Sample};
use crate::rig::{Fault, Sensors};
use crate::scene::{Scene, key};

/// The last readings before a fault, and the limits that the scene gives the controller.
#[derive(Debug, Clone, Copy)]
pub struct Evidence {
    last: Sensors,
    /// Largest absolute readings of the last period: response and base, m.
    largest: [f64; 2],
    /// Mean of the phase error over the last period, if it could be measured throughout.
    phase_error: PhaseError,
    config: Config,
}

impl Evidence {
    /// The evidence in the last of these samples; `phase_error` makes an error of radians, or of none.
    pub(super) fn of(samples: &[Sample], scene: &Scene, phase_error: impl Fn(Option<f64>) -> PhaseError) -> Self {
        let config = scene.controller_config();
        let period = (TAU / (config.omega_start * config.sample_time)).round() as usize;
        let samples = &samples[samples.len().saturating_sub(period)..];
        let largest = |reading: fn(&Sensors) -> f64| {
            let readings = samples.iter().map(|sample| reading(&sample.sensors).abs());
            readings.fold(0.0, f64::max)
        };
        let errors: Option<Vec<f64>> = samples.iter().map(|sample| sample.command.phase_error).collect();
        Self {
            last: samples.last().map(|sample| sample.sensors).unwrap_or_default(),
            largest: [
                largest(|sensors| sensors.response),
                largest(|sensors| sensors.reference.unwrap_or_default()),
            ],
            phase_error: phase_error(errors.map(|errors| errors.iter().sum::<f64>() / errors.len() as f64)),
            config,
        }
    }

    /// The values that led to `fault`, what the scene allows, and what to do next.
    pub fn text(&self, fault: Fault) -> String {
        let Self { last, largest, phase_error, config } = self;
        let now = self.readings([last.response, last.reference.unwrap_or_default()]);
        let most = self.readings(*largest);
        match fault {
            Fault::Sensor => format!("the response read {now}. {CHECK}"),
            Fault::ResponseTooLarge => {
                let limit = limit("response_max", config.response_max, " m");
                let read = short(largest[0]);
                format!(
                    "it read {read} m, and {limit}. Lower excitation.G or the levels of [backbone], or raise the limit if the rig bears it"
                )
            }
            Fault::LockLost => {
                let error = match phase_error {
                    PhaseError::Degrees(degrees) => format!("was {} degrees", short(*degrees)),
                    PhaseError::NotMeasured => "could not be measured".into(),
                    PhaseError::NotReported => "was not reported by the controller".into(),
                };
                let tolerance = config.lock.unlock_tolerance.to_degrees();
                let limit = limit("lock.unlock_tolerance", Some(tolerance), " degrees");
                format!("in the last period the phase error {error}, and {limit}; the response read at most {most}")
            }
            Fault::NoSignal => {
                let needed = short(config.lock.response_min * config.amplitude);
                let [amplitude, share] = ["lock.response_min", "lock.coherence_min"].map(key);
                let limit = limit("signal_timeout", config.signal_timeout, " s");
                let power = config.lock.coherence_min;
                format!(
                    "in the last period the response read at most {most}. An amplitude of {needed} m ({amplitude}) with a share of {power} of \
                     the power ({share}) is needed, and {limit} without it. {CHECK}"
                )
            }
            Fault::Implausible => {
                let limit = limit(
                    "residual_max",
                    config.residual_max,
                    " of the amplitude as the difference",
                );
                format!("the response read {now}; in the last period at most {most}; {limit}. {CHECK}")
            }
            Fault::TimedOut => limit("acquire_timeout", config.acquire_timeout, " s"),
        }
    }

    /// Readings of both sensors, or of the only one.
    fn readings(&self, [response, base]: [f64; 2]) -> String {
        let (response, base) = (short(response), short(base));
        match self.last.reference {
            Some(_) => format!("{response} m, the base {base} m"),
            None => format!("{response} m"),
        }
    }
}

/// What to do about sensors.
const CHECK: &str = "`vines check` looks for the cause";

/// What the scene allows for a parameter of the controller.
fn limit(parameter: &str, value: Option<f64>, unit: &str) -> String {
    match value {
        Some(value) => format!("{} allows {}{unit}", key(parameter), short(value)),
        None => format!("{} sets no limit", key(parameter)),
    }
}

/// Five digits, with an exponent if the number is very small or large.
fn short(value: f64) -> String {
    let rounded: f64 = format!("{value:.4e}").parse().unwrap_or(value);
    format!("{rounded:?}").trim_end_matches(".0").into()
}

#[cfg(test)]
#[path = "../../tests/unit/evidence.rs"]
mod tests;
