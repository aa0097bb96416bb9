//! Which steps are accepted, and why one is refused or ended early.

use super::LoViNes;
use fmi2_component::Refusal;
use lovines::Drive;
use lovines::plant::MOST_IMPACTS;

/// The longest accepted step, in radians of the fastest rate: more than a million periods. Even without impacts, the search for the
/// first contact evaluates the motion about once in two radians, and every call must end.
const LONGEST_STEP: f64 = 1e7;

/// Why a step could not be finished.
#[cold]
pub(super) fn lost(resolved: bool, time: f64, (step, elapsed): (f64, f64)) -> Refusal {
    Refusal::error(if resolved {
        format!(
            "there are {MOST_IMPACTS} impacts within the first {elapsed} s of the step of {step} s at t = {time} s; expected \
             velocities and a half-width of the cavity that make sense together, or a shorter step"
        )
    } else {
        format!(
            "displacements have become so large in the step at t = {time} s that their rounding is wider than the cavity; \
             expected start values and inputs of a sensible size"
        )
    })
}

/// Why a step is not begun.
#[cold]
fn too_far(drive: &Drive) -> Refusal {
    Refusal::error(format!(
        "the base would go further than 2^52 half-widths of the cavity, where the rounding of displacements is wider than it \
         (e = {} m and its derivatives, E = {} m); expected inputs of a sensible size",
        drive.signal[0], drive.amplitude
    ))
}

/// Why a step is not begun.
#[cold]
fn too_long(step: f64, rate: f64) -> Refusal {
    let longest = LONGEST_STEP / rate;
    Refusal::error(format!(
        "communicationStepSize = {step} s is refused; allowed are at most {longest} s, which is {LONGEST_STEP} rad of \
         the fastest rate"
    ))
}

impl LoViNes {
    /// Whether a step can be done; steps up to that length need not be checked again.
    #[inline(never)]
    pub(super) fn judge(&self, step: f64) -> Result<(), Refusal> {
        self.check_settings()?;
        let rate = self.fastest.max(self.drive.omega.abs());
        self.drive.validate()?;
        if step * rate > LONGEST_STEP {
            return Err(too_long(step, rate));
        }
        // However short the step: derivatives of the base displacement cause forces.
        if !self.reach.holds_base(&self.drive, step.max(1.0 / self.fastest)) {
            return Err(too_far(&self.drive));
        }
        self.longest.set(step);
        Ok(())
    }
}
