//! What a master sets: parameters, start values and inputs.

use super::outputs::Outputs;
use super::reach::Reach;
use super::variables::Real;
use super::{LoViNes, Progress, Rig, unknown};
use fmi2_component::Refusal;
use lovines::{InvalidValue, Parameters};

impl LoViNes {
    /// A parameter or an input, as it was set.
    pub(super) fn setting(&self, variable: Real) -> Option<f64> {
        let p = &self.parameters;
        Some(match variable {
            Real::M => p.primary_mass,
            Real::k => p.stiffness,
            Real::c => p.damping,
            Real::m => p.particle_mass,
            Real::b => p.half_width,
            Real::r => p.restitution,
            Real::e => self.drive.signal[0],
            Real::E => self.drive.amplitude,
            Real::omega => self.drive.omega,
            Real::q1_start => self.start.q1,
            Real::der_q1_start => self.start.dq1,
            Real::q2_start => self.start.q2,
            Real::der_q2_start => self.start.dq2,
            _ => return None,
        })
    }

    /// Passes changed inputs to the rig.
    #[inline]
    pub(super) fn input(&mut self) {
        self.inputs_set = true;
        self.outputs.forget_base();
        self.longest = unknown();
        if let Rig::Equations(hybrid) = &mut self.rig {
            hybrid.drive = self.drive;
        }
    }

    /// Sets a parameter or a start value.
    #[cold]
    pub(super) fn configure(&mut self, variable: Real, value: f64) -> Result<(), Refusal> {
        let mut parameters = self.parameters;
        let slot = match variable {
            // One value under two names: some masters set parameters only, others start values of outputs only.
            Real::q1 | Real::q1_start => &mut self.start.q1,
            Real::der_q1 | Real::der_q1_start => &mut self.start.dq1,
            Real::q2 | Real::q2_start => &mut self.start.q2,
            Real::der_q2 | Real::der_q2_start => &mut self.start.dq2,
            Real::M => &mut self.parameters.primary_mass,
            Real::m => &mut self.parameters.particle_mass,
            Real::b => &mut self.parameters.half_width,
            Real::k => &mut parameters.stiffness,
            Real::c => &mut parameters.damping,
            Real::r => &mut parameters.restitution,
            _ => return Err(Refusal::error("this variable is computed, not set")),
        };
        *slot = value;
        self.outputs = Outputs::default();
        if matches!(variable, Real::k | Real::c | Real::r) {
            self.set_parameters(parameters)?;
        }
        Ok(())
    }

    /// Passes changed parameters to the rig.
    pub(super) fn set_parameters(&mut self, parameters: Parameters) -> Result<(), InvalidValue> {
        if self.progress != Progress::None {
            match &mut self.rig {
                Rig::Steps(plant) => plant.set_parameters(parameters)?,
                Rig::Equations(hybrid) => hybrid.set_parameters(parameters)?,
            }
        }
        self.parameters = parameters;
        self.fastest = parameters.fastest_rate();
        self.reach = Reach::of(&parameters);
        self.longest = unknown();
        Ok(())
    }
}
