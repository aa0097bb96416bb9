//! What a master reads of the plant: computed once after a step, and looked up on request.

use super::derivatives;
use super::variables::Real;
use super::{LoViNes, Progress, Simulation, with_plant};
use lovines::{BaseMotion, State};
use std::cell::Cell;

/// Number of outputs that are kept.
const OUTPUTS_KEPT: usize = 11;

/// Where an output is kept, in the order of the variable table, so that this is a subtraction; `OUTPUTS_KEPT` for what is not.
#[inline]
const fn place(variable: Real) -> usize {
    match variable {
        Real::q1 => 0,
        Real::der_q1 => 1,
        Real::q2 => 2,
        Real::der_q2 => 3,
        Real::v => 4,
        Real::w => 5,
        Real::der_w => 6,
        Real::base => BASE,
        Real::phase => 8,
        Real::impact_time => 9,
        Real::impact_velocity => 10,
        _ => OUTPUTS_KEPT,
    }
}

const BASE: usize = 7;

/// Outputs as they were at the end of the last step; NaN for one that must be computed.
#[derive(Clone, Debug)]
pub(super) struct Outputs([Cell<f64>; OUTPUTS_KEPT]);

impl Default for Outputs {
    fn default() -> Self {
        Self([const { Cell::new(f64::NAN) }; OUTPUTS_KEPT])
    }
}

impl Outputs {
    /// The value, or NaN.
    #[inline(always)]
    pub fn get(&self, variable: Real) -> f64 {
        match self.0.get(place(variable)) {
            Some(kept) => kept.get(),
            None => f64::NAN,
        }
    }

    /// The inputs have changed, and with them the base displacement.
    #[inline]
    pub fn forget_base(&self) {
        self.0[BASE].set(f64::NAN);
    }
}

impl LoViNes {
    /// Keeps what masters read after a step. Returns whether the rounding error of displacements is narrower than the cavity.
    #[inline]
    pub(super) fn keep_outputs(&mut self) -> bool {
        with_plant!(
            &self.simulation,
            plant => {
                let (state, totals) = (plant.state(), plant.totals());
                let w = plant.relative_displacement();
                self.outputs.0 = [
                    state.q1,
                    state.dq1,
                    state.q2,
                    state.dq2,
                    state.q1 + self.epsilon * state.q2,
                    w,
                    plant.relative_velocity(),
                    plant.base_displacement(),
                    f64::NAN,
                    totals.impact_time,
                    totals.impact_velocity,
                ]
                .map(Cell::new);
                self.reach.holds(&state) && self.reach.holds_particle(w)
            },
            else _ => false
        )
    }

    /// A value that is not kept.
    #[cold]
    #[inline(never)]
    pub(super) fn work_out(&self, variable: Real) -> f64 {
        // One copy for each kind of plant.
        with_plant!(
            &self.simulation,
            plant => match variable {
                // Before the first step, outputs that can be set are what was set.
                Real::q1 => self.state_of(plant.state()).q1,
                Real::der_q1 => self.state_of(plant.state()).dq1,
                Real::q2 => self.state_of(plant.state()).q2,
                Real::der_q2 => self.state_of(plant.state()).dq2,
                Real::v => {
                    let state = plant.state();
                    state.q1 + self.epsilon * state.q2
                }
                Real::w => plant.relative_displacement(),
                Real::der_w => plant.relative_velocity(),
                Real::base => self.base(),
                Real::phase => plant.base().phase.radians(),
                Real::impact_time => plant.totals().impact_time,
                Real::impact_velocity => plant.totals().impact_velocity,
                Real::dissipated => plant.totals().dissipated,
                Real::stuck_time => plant.totals().stuck_time,
                Real::friction_loss => plant.totals().friction,
                _ => self.setting(variable).unwrap_or_else(|| self.of_oscillator(variable)),
            },
            else hybrid => self.of_equations(hybrid, variable)
        )
    }

    /// The state that was set, before the first step.
    fn state_of(&self, now: State) -> State {
        match self.progress {
            Progress::UnderWay => now,
            _ if self.adopted.is_some() => State { q2: self.start.q2, dq2: self.start.dq2, ..now },
            _ => self.start,
        }
    }

    /// A value that follows from the oscillator's equations; a structure does not have it.
    fn of_oscillator(&self, variable: Real) -> f64 {
        match (&self.simulation, variable) {
            (Simulation::Steps(plant), Real::energy) => plant.energy(self.base()),
            (Simulation::Structure(plant), Real::energy) => plant.energy(),
            (Simulation::Steps(plant), _) => derivatives::of_instant(&self.instant(plant), variable),
            _ => 0.0,
        }
    }

    /// The displacement of the base, or the force, with the present inputs; computed once, because it contains a sine.
    fn base(&self) -> f64 {
        let kept = &self.outputs.0[BASE];
        if kept.get().is_nan() {
            kept.set(with_plant!(
                &self.simulation,
                plant => if self.inputs_set {
                    let BaseMotion { drive, phase } = self.base_motion(plant.base());
                    let drive = drive.signal[0] + drive.amplitude * libm::sin(phase.radians());
                    drive.clamp(-self.largest_drive(), self.largest_drive())
                } else {
                    plant.base_displacement()
                },
                else _ => f64::NAN
            ));
        }
        kept.get()
    }

    /// The present base with the present inputs.
    pub(super) fn base_motion(&self, base: BaseMotion) -> BaseMotion {
        if self.inputs_set {
            BaseMotion { drive: self.inputs.drive(), ..base }
        } else {
            base
        }
    }
}
