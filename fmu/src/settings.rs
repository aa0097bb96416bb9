//! What a master sets: parameters, start values and inputs.

use super::outputs::Outputs;
use super::reach::Reach;
use super::structure;
use super::variables::{Integer, Real};
use super::{LoViNes, Progress, Simulation, with_plant};
use fmi2_component::{Causality, Key, Refusal};
use lovines::table::{PARAMETERS, Parameter, Values};
use lovines::{InvalidValue, Parameters};

/// The row of the plant's table that a variable is, and its place.
fn row(variable: impl Key) -> Option<(usize, &'static Parameter)> {
    let n = Values::place(variable.variable().name)?;
    Some((n, &PARAMETERS[n]))
}

impl LoViNes {
    /// A parameter or an input, as it was set.
    pub(super) fn setting(&self, variable: Real) -> Option<f64> {
        Some(match variable {
            Real::e => self.inputs.signal,
            Real::E => self.inputs.amplitude,
            Real::omega => self.inputs.omega,
            Real::q1_start => self.start.q1,
            Real::der_q1_start => self.start.dq1,
            Real::q2_start => self.start.q2,
            Real::der_q2_start => self.start.dq2,
            _ if variable.variable().causality != Causality::Parameter => return None,
            _ => self.values.0[row(variable)?.0].unwrap_or_default(),
        })
    }

    /// A whole number, as it was set.
    pub(super) fn whole(&self, variable: Integer) -> i32 {
        row(variable).map_or(0, |(n, _)| self.values.0[n].unwrap_or_default() as i32)
    }

    /// Passes changed inputs to the rig.
    #[inline]
    pub(super) fn input(&mut self) {
        self.inputs_set = true;
        self.outputs.forget_base();
        if let Simulation::Equations(hybrid) = &mut self.simulation {
            hybrid.drive = self.inputs.drive();
        }
    }

    /// Sets a start value, or a parameter.
    #[cold]
    pub(super) fn configure(&mut self, variable: Real, value: f64) -> Result<(), Refusal> {
        if self.adopted.is_some() && matches!(variable, Real::q1 | Real::der_q1 | Real::q1_start | Real::der_q1_start) {
            return Err(structure::replaced(variable.variable().name));
        }
        let start = match variable {
            // One value under two names: some masters set parameters only, others start values of outputs only.
            Real::q1 | Real::q1_start => &mut self.start.q1,
            Real::der_q1 | Real::der_q1_start => &mut self.start.dq1,
            Real::q2 | Real::q2_start => &mut self.start.q2,
            Real::der_q2 | Real::der_q2_start => &mut self.start.dq2,
            _ => return self.set_parameter(variable, value),
        };
        *start = value;
        self.outputs = Outputs::default();
        Ok(())
    }

    /// Sets a parameter.
    ///
    /// A number that is not allowed whatever the others are is refused at once. Parameters that contradict each other wait for the next
    /// call to mend them, and the plant keeps its own until then: [`Self::check_settings`] refuses them when the plant has to move.
    pub(super) fn set_parameter(&mut self, variable: impl Key, value: f64) -> Result<(), Refusal> {
        let symbol = variable.variable().name;
        if self.adopted.is_some() && structure::REPLACED.contains(&symbol) {
            return Err(structure::replaced(symbol));
        }
        let Some((n, row)) = row(variable) else {
            return Err(Refusal::error("this variable is computed, not set"));
        };
        let is_default = value == 0.0 && row.has_zero_for_default();
        if !is_default {
            row.check(value)?;
        }
        self.values.0[n] = (!is_default).then_some(value);
        self.outputs = Outputs::default();
        let parameters = self.values.parameters();
        self.valid = parameters.validate().is_ok();
        if self.progress == Progress::None || self.valid {
            self.take_over(parameters)?;
        }
        Ok(())
    }

    /// Refuses parameters that contradict each other.
    #[inline]
    pub(super) fn check_settings(&self) -> Result<(), InvalidValue> {
        if self.valid {
            Ok(())
        } else {
            self.values.parameters().validate()
        }
    }

    /// Passes changed parameters to the rig.
    fn take_over(&mut self, parameters: Parameters) -> Result<(), InvalidValue> {
        if self.progress != Progress::None {
            with_plant!(&mut self.simulation, plant => plant.set_parameters(parameters)?, else hybrid => hybrid.set_parameters(parameters)?);
        }
        self.parameters = parameters;
        self.fit_limits();
        Ok(())
    }

    /// Fits the limits of displacements and steps to the parameters, and to the structure.
    pub(super) fn fit_limits(&mut self) {
        let mut fastest = self.parameters.fastest_rate();
        let mut per_drive = 1.0;
        if let (Some(adopted), Simulation::Structure(plant)) = (&self.adopted, &self.simulation) {
            fastest = fastest.max(plant.parameters().fastest_rate());
            per_drive = adopted.displacement_per_drive();
        }
        self.reach = Reach::of(&self.parameters, fastest, per_drive);
    }
}
