//! Limits of displacements: where the rounding error is as wide as the cavity, contacts cannot be found, and the search for them would
//! take seconds. And of steps: which are accepted, and why one is refused or ended early.

use super::LoViNes;
use fmi2_component::Refusal;
use lovines::plant::{MOST_EVALUATIONS, MOST_IMPACTS, MOST_RELEASES};
use lovines::{Drive, InvalidValue, Outcome, Parameters, State};

/// Limit in half-widths: there the spacing of doubles is one half-width.
const DOUBLES_LIMIT: f64 = 1.0 / f64::EPSILON;

/// The largest displacements and velocities allowed for a cavity.
#[derive(Clone, Copy, Default)]
pub(super) struct Reach {
    /// m.
    displacement: f64,
    /// m/s: it leads to that displacement at most.
    velocity: f64,
    /// Displacement of the cavity that a constant drive gives, m per unit: 1 for a base.
    per_drive: f64,
    /// The largest sum of a held signal and an amplitude, m or N or V.
    drive: f64,
    /// The fastest rate of the motion without that of the drive, rad/s, and its inverse.
    fastest: f64,
    briefest: f64,
    /// The middle between the walls and half their distance, m.
    cavity: (f64, f64),
}

impl Reach {
    pub fn of(parameters: &Parameters, fastest: f64, per_drive: f64) -> Self {
        let displacement = parameters.half_width * DOUBLES_LIMIT;
        let [plus, minus] = parameters.gaps();
        Self {
            // The position on a wall has a rounding error if the gaps differ.
            cavity: (0.5 * (plus - minus), 0.5 * (plus + minus) * (1.0 + 1e-12)),
            displacement,
            velocity: displacement * fastest,
            per_drive,
            drive: Drive::LARGEST.min(displacement / per_drive),
            fastest,
            briefest: 1.0 / fastest,
        }
    }

    /// Whether a state is within; one that is not a number is not.
    #[inline]
    pub fn holds(&self, state: &State) -> bool {
        state.q1.abs() <= self.displacement && state.dq1.abs() + state.dq2.abs() <= self.velocity
    }

    /// Whether the particle is in its cavity.
    #[inline]
    pub fn holds_particle(&self, w: f64) -> bool {
        (w - self.cavity.0).abs() <= self.cavity.1
    }

    /// Whether a step is short enough under a drive of the frequency `omega`, rad/s.
    #[inline]
    fn holds_step(&self, step: f64, omega: f64) -> bool {
        step * self.fastest <= LONGEST_STEP && step * omega.abs() <= LONGEST_STEP
    }

    /// Whether a held drive is within its limits.
    #[inline]
    fn holds_held(&self, drive: &Drive) -> bool {
        drive.is_held()
            && drive.signal[0].abs() + drive.amplitude.abs() < self.drive
            && drive.omega.abs() < Drive::FASTEST
    }

    /// Whether the base stays within during a step under `drive`.
    fn holds_base(&self, drive: &Drive, step: f64) -> bool {
        let [u0, u1, u2, u3] = drive.signal;
        let moved = if drive.is_held() {
            0.0
        } else {
            // However short the step: derivatives of the base displacement cause forces.
            let span = step.max(self.briefest);
            span * (u1.abs() + span * (u2.abs() + span * u3.abs()))
        };
        (u0.abs() + drive.amplitude.abs() + moved) * self.per_drive <= self.displacement
    }

    /// Refuses a start that is not within.
    pub fn check(&self, start: &State) -> Result<(), InvalidValue> {
        let (far, fast) = (self.displacement, self.velocity);
        let near = "at most 2^52 half-widths: beyond, the rounding of displacements is wider than the cavity";
        let slow = "a velocity that leads no further than 2^52 half-widths: beyond, the rounding of displacements is wider \
                    than the cavity";
        let name = "q1 (displacement of the primary mass)";
        InvalidValue::unless(start.q1.abs() <= far, name, start.q1, "m", near)?;
        let name = "der(q1) (velocity of the primary mass)";
        InvalidValue::unless(start.dq1.abs() <= fast, name, start.dq1, "m/s", slow)?;
        let name = "der(q2) (velocity of the particle)";
        InvalidValue::unless(start.dq2.abs() <= fast, name, start.dq2, "m/s", slow)
    }
}

/// The longest accepted step, in radians of the fastest rate: more than a million periods. Even without impacts, the search for the
/// first contact evaluates the motion about once in two radians, and every call must end.
const LONGEST_STEP: f64 = 1e7;

/// Why a step could not be finished.
#[cold]
pub(super) fn lost(resolved: bool, time: f64, step: f64, outcome: &Outcome) -> Refusal {
    let Outcome { impacts, released, elapsed, evaluations, .. } = outcome;
    Refusal::error(if resolved {
        format!(
            "there are {impacts} impacts, {released} releases and {evaluations} evaluations of the motion within the first {elapsed} s of \
             the step of {step} s at t = {time} s; a step ends at {MOST_IMPACTS}, {MOST_RELEASES} or {MOST_EVALUATIONS} of them; expected \
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
    /// Whether a step can certainly be done, as most can: with held inputs. [`Self::judge`] decides on all others.
    #[inline]
    pub(super) fn accepts(&self, step: f64) -> bool {
        let drive = self.inputs.drive();
        self.valid && self.reach.holds_step(step, drive.omega) && self.reach.holds_held(&drive)
    }

    /// Refuses a step that cannot be done.
    #[inline(never)]
    pub(super) fn judge(&self, step: f64) -> Result<(), Refusal> {
        let drive = self.inputs.drive();
        self.check_settings()?;
        drive.validate()?;
        if !self.reach.holds_step(step, drive.omega) {
            return Err(too_long(step, self.reach.fastest.max(drive.omega.abs())));
        }
        if !self.reach.holds_base(&drive, step) {
            return Err(too_far(&drive));
        }
        Ok(())
    }
}
