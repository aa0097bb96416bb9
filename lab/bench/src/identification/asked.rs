//! What a controller was asked for, phase and drive, beside what it does.

use vines_model::numerics::{Estimate, SIGNIFICANT, mean, range};

use super::{Cycle, LevelEstimate};
use crate::record::Sample;
use vines_scene::plan::Plan;
use vines_scene::scene::Dimensionless;

/// Relative difference of a drive or a response from the requested one up to which it is the same, whatever its uncertainty.
pub(crate) const SAME: f64 = 0.01;

/// Whether a drive that differs by `difference` with the standard uncertainty `u` is another one than `requested`; all in m.
pub(crate) fn is_another(difference: f64, u: f64, requested: f64) -> bool {
    difference.abs() > (SAME * requested).max(SIGNIFICANT * u)
}

/// What a controller holds otherwise than asked over these samples, the last of a run, in words: steadily, in each of the last periods. What is still
/// moving is no departure, but on its way. `None` if phase and drive are as asked, or cannot be measured.
pub(crate) fn departure(samples: &[Sample], plan: &Plan) -> Option<String> {
    let knowledge = &plan.knowledge;
    let cycles = Cycle::all(samples, 0.0, knowledge);
    if cycles.len() < LevelEstimate::FEWEST {
        return None;
    }
    let [noise, base_noise] = Cycle::noise_of(&cycles, false);
    let measured = LevelEstimate::means(&cycles);
    let [response, drive, omega] = measured.at;
    let requested = plan.requested(omega.value);
    let drives: Vec<f64> = cycles.iter().map(|cycle| cycle.base.norm() - requested).collect();
    let is_another = departs(&drives, (SAME * requested).max(SIGNIFICANT * base_noise));
    let reported: Option<Vec<f64>> = samples.iter().map(|sample| sample.command.phase_error).collect();
    let reported = reported.map(mean);
    let phases: Vec<f64> = cycles
        .iter()
        .map(|cycle| cycle.phase_error - reported.unwrap_or(0.0))
        .collect();
    let phase_noise = (noise / response.value).hypot(base_noise / drive.value);
    let mut departures = Vec::new();
    if departs(&phases, plan.lock.lock.phase_tolerance + SIGNIFICANT * phase_noise) {
        let Estimate { value, uncertainty } = measured.phase_error.scaled(1_f64.to_degrees());
        let reported = reported.map_or("no phase error".into(), |error| {
            format!("{:.2} degrees", error.to_degrees())
        });
        departures.push(format!(
            "the phase of the response is {value:.2} ± {uncertainty:.1e} degrees off controller.phase_target, and the controller reports {reported}"
        ));
    }
    if is_another {
        let Dimensionless { g, .. } = knowledge.numbers;
        let Estimate { value, uncertainty } = drive.scaled(g / requested);
        let commanded = mean(samples.iter().map(|sample| sample.command.drive.amplitude)) / plan.amplitude;
        departures.push(format!(
            "the measured drive is G = {value:.4} ± {uncertainty:.1e}, {:.3} times the requested G = {g:.4}, and the controller commands \
             {commanded:.3} times the requested drive",
            value / g
        ));
    }
    (!departures.is_empty()).then(|| departures.join("; "))
}

/// Whether all values lie beyond `allowed` on one side, and nearer to each other than to zero.
fn departs(values: &[f64], allowed: f64) -> bool {
    let (low, high) = range((f64::INFINITY, f64::NEG_INFINITY), values.iter().copied());
    (low > allowed || high < -allowed) && high - low < mean(values.iter().copied()).abs()
}
