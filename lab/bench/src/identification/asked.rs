//! What a controller was asked for, phase and drive, beside what it does.

use std::fmt::{self, Display, Formatter};

use vines_model::numerics::{Estimate, SIGNIFICANT, mean, range};

use super::{Cycle, LevelEstimate, ResonanceFit};
use crate::record::Sample;
use vines_scene::plan::Plan;
use vines_scene::scene::Dimensionless;

/// Relative difference of a drive or a response from the requested one up to which it is the same, whatever its uncertainty.
pub(crate) const SAME: f64 = 0.01;

/// Whether a drive that differs by `difference` with the standard uncertainty `u` is another one than `requested`; all in m.
pub(crate) fn is_another(difference: f64, u: f64, requested: f64) -> bool {
    difference.abs() > (SAME * requested).max(SIGNIFICANT * u)
}

/// What a controller holds otherwise than asked: steadily, in each of the last periods. What is still moving is no departure, but on its way.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Departure {
    /// Measured phase error, and the one that the controller reports, degrees.
    phase: Option<(Estimate, Option<f64>)>,
    /// Measured G, requested G, and commanded over requested drive.
    drive: Option<(Estimate, f64, f64)>,
}

impl Departure {
    /// Over these samples, the last of a run; `None` if phase and drive are as asked, or cannot be measured.
    pub fn of(samples: &[Sample], plan: &Plan) -> Option<Self> {
        let knowledge = &plan.knowledge;
        let cycles = Cycle::all(samples, knowledge.sample_time, knowledge.target);
        if cycles.len() < ResonanceFit::FEWEST {
            return None;
        }
        let [noise, base_noise] = [0, 1].map(|i| mean(cycles.iter().map(|cycle| cycle.noise[i])).sqrt());
        let measured = LevelEstimate::means(&cycles);
        let ([drive, omega], phase) = (measured.at, measured.phase_error);
        let requested = plan.requested(omega.value);
        let drives: Vec<f64> = cycles.iter().map(|cycle| cycle.base.norm() - requested).collect();
        let another = departs(&drives, (SAME * requested).max(SIGNIFICANT * base_noise));
        let reported: Option<Vec<f64>> = samples.iter().map(|sample| sample.command.phase_error).collect();
        let reported = reported.map(mean);
        let phases: Vec<f64> = cycles
            .iter()
            .map(|cycle| cycle.phase_error - reported.unwrap_or(0.0))
            .collect();
        let phase_noise = (noise / measured.response.value).hypot(base_noise / drive.value);
        let turned = departs(&phases, plan.lock.lock.phase_tolerance + SIGNIFICANT * phase_noise);
        let Dimensionless { g, .. } = knowledge.numbers;
        let commanded = mean(samples.iter().map(|sample| sample.command.drive.amplitude));
        let departure = Self {
            phase: turned.then(|| (phase.scaled(1_f64.to_degrees()), reported.map(f64::to_degrees))),
            drive: another.then(|| (drive.scaled(g / requested), g, commanded / plan.amplitude)),
        };
        (turned || another).then_some(departure)
    }
}

/// Whether all values lie beyond `allowed` on one side, and nearer to each other than to zero.
fn departs(values: &[f64], allowed: f64) -> bool {
    let (low, high) = range((f64::INFINITY, f64::NEG_INFINITY), values.iter().copied());
    (low > allowed || high < -allowed) && high - low < mean(values.iter().copied()).abs()
}

impl Display for Departure {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        if let Some((Estimate { value, uncertainty }, reported)) = self.phase {
            write!(
                f,
                "the phase of the response is {value:.2} ± {uncertainty:.1e} degrees off controller.phase_target, and the controller reports "
            )?;
            match reported {
                Some(reported) => write!(f, "{reported:.2} degrees")?,
                None => f.write_str("no phase error")?,
            }
        }
        if self.phase.is_some() && self.drive.is_some() {
            f.write_str("; ")?;
        }
        let Some((Estimate { value, uncertainty }, requested, commanded)) = self.drive else {
            return Ok(());
        };
        write!(
            f,
            "the measured drive is G = {value:.4} ± {uncertainty:.1e}, {:.3} times the requested G = {requested:.4}, and the controller commands \
             {commanded:.3} times the requested drive",
            value / requested
        )
    }
}
