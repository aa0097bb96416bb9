//! What a master sets: parameters, start values and inputs.

use super::outputs::Outputs;
use super::reach::Reach;
use super::variables::Real;
use super::{LoViNes, Progress, Simulation, unknown};
use fmi2_component::Refusal;
use lovines::{Cavity, InvalidValue, Parameters, Restitution};

/// The parameters of the cavity as a master sets them: 0 stands for a default that follows from another parameter.
#[derive(Clone, Copy, Default, serde::Serialize, serde::Deserialize)]
pub(super) struct CavitySettings {
    pub b_plus: f64,
    pub b_minus: f64,
    pub theta: f64,
    pub mu_k: f64,
    pub mu_s: f64,
    /// 0 constant, 1 viscoelastic, 2 plastic.
    pub r_law: i32,
    /// The parameter of the law: r, k or v_y.
    pub r_plus: f64,
    pub r_minus: f64,
    pub r_min: f64,
    pub r_scatter: f64,
    pub seed: i32,
}

impl From<CavitySettings> for Cavity {
    fn from(s: CavitySettings) -> Self {
        let given = |value: f64| (value != 0.0).then_some(value);
        let law = |value: f64| match s.r_law {
            1 => Some(Restitution::Viscoelastic(value)),
            2 => Some(Restitution::Plastic(value)),
            _ => given(value).map(Restitution::Constant),
        };
        Self {
            b_plus: given(s.b_plus),
            b_minus: given(s.b_minus),
            tilt: s.theta,
            kinetic_friction: s.mu_k,
            static_friction: given(s.mu_s),
            restitution: [law(s.r_plus), law(given(s.r_minus).unwrap_or(s.r_plus))],
            least_restitution: s.r_min,
            scatter: s.r_scatter,
            seed: s.seed as u64,
        }
    }
}

impl LoViNes {
    /// A parameter or an input, as it was set.
    pub(super) fn setting(&self, variable: Real) -> Option<f64> {
        let (p, cavity) = (&self.parameters, &self.cavity);
        Some(match variable {
            Real::M => p.primary_mass,
            Real::k => p.stiffness,
            Real::c => p.damping,
            Real::m => p.particle_mass,
            Real::b => p.half_width,
            Real::r => p.restitution,
            Real::b_plus => cavity.b_plus,
            Real::b_minus => cavity.b_minus,
            Real::theta => cavity.theta,
            Real::mu_k => cavity.mu_k,
            Real::mu_s => cavity.mu_s,
            Real::r_plus => cavity.r_plus,
            Real::r_minus => cavity.r_minus,
            Real::r_min => cavity.r_min,
            Real::r_scatter => cavity.r_scatter,
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
        if let Simulation::Equations(hybrid) = &mut self.simulation {
            hybrid.drive = self.drive;
        }
    }

    /// Sets a parameter or a start value.
    #[cold]
    pub(super) fn configure(&mut self, variable: Real, value: f64) -> Result<(), Refusal> {
        let (mut parameters, mut cavity) = (self.parameters, self.cavity);
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
            Real::b_plus => &mut cavity.b_plus,
            Real::b_minus => &mut cavity.b_minus,
            Real::theta => &mut cavity.theta,
            Real::mu_k => &mut cavity.mu_k,
            Real::mu_s => &mut cavity.mu_s,
            Real::r_plus => &mut cavity.r_plus,
            Real::r_minus => &mut cavity.r_minus,
            Real::r_min => &mut cavity.r_min,
            Real::r_scatter => &mut cavity.r_scatter,
            _ => return Err(Refusal::error("this variable is computed, not set")),
        };
        *slot = value;
        self.outputs = Outputs::default();
        match variable {
            Real::k | Real::c | Real::r => self.set_parameters(parameters)?,
            Real::b_plus
            | Real::b_minus
            | Real::theta
            | Real::mu_k
            | Real::mu_s
            | Real::r_plus
            | Real::r_minus
            | Real::r_min
            | Real::r_scatter => self.set_cavity(cavity)?,
            _ => {}
        }
        Ok(())
    }

    /// Passes changed parameters of the cavity to the rig.
    pub(super) fn set_cavity(&mut self, cavity: CavitySettings) -> Result<(), Refusal> {
        self.set_parameters(Parameters { cavity: cavity.into(), ..self.parameters })?;
        self.cavity = cavity;
        Ok(())
    }

    /// Passes changed parameters to the rig.
    pub(super) fn set_parameters(&mut self, parameters: Parameters) -> Result<(), InvalidValue> {
        if self.progress != Progress::None {
            match &mut self.simulation {
                Simulation::Steps(plant) => plant.set_parameters(parameters)?,
                Simulation::Equations(hybrid) => hybrid.set_parameters(parameters)?,
            }
        }
        self.parameters = parameters;
        self.fastest = parameters.fastest_rate();
        self.reach = Reach::of(&parameters);
        self.longest = unknown();
        Ok(())
    }
}
