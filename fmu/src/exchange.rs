//! The plant for masters that integrate its equations.

use super::derivatives::of_instant;
use super::variables::Real;
use super::{LoViNes, Progress, Simulation, log};
use crate::model_exchange::hybrid::Hybrid;
use fmi2_component::{Discrete, Log, ModelExchange, Refusal};
use lovines::{Drive, Parameters, State};

/// How far behind a wall an impact may be met without a warning, in half-widths. Masters that look for the zeros of event indicators
/// stop within 1e-6.
const LATE_IMPACT: f64 = 1e-3;

impl LoViNes {
    /// A value that was set, or that follows from the equations' state.
    #[inline(never)]
    pub(super) fn of_equations(&self, hybrid: &Hybrid, variable: Real) -> f64 {
        match variable {
            Real::q1 => hybrid.states.q1,
            Real::q2 => hybrid.states.q2,
            Real::phase => hybrid.states.phase,
            Real::u1 => hybrid.states.u1,
            Real::u2 => hybrid.states.u2,
            Real::impact_time => hybrid.totals().impact_time,
            Real::impact_velocity => hybrid.totals().impact_velocity,
            Real::dissipated => hybrid.totals().dissipated,
            Real::stuck_time => hybrid.totals().stuck_time,
            Real::friction_loss => hybrid.totals().friction,
            _ => (self.setting(variable)).unwrap_or_else(|| of_instant(&hybrid.instant(), variable)),
        }
    }

    fn hybrid(&self) -> &Hybrid {
        match &self.simulation {
            Simulation::Equations(hybrid) => hybrid,
            _ => unreachable!("the shell asks this only after select"),
        }
    }

    fn hybrid_mut(&mut self) -> &mut Hybrid {
        match &mut self.simulation {
            Simulation::Equations(hybrid) => hybrid,
            _ => unreachable!("the shell asks this only after select"),
        }
    }
}

impl ModelExchange for LoViNes {
    fn select(&mut self) {
        let parameters = Parameters::dimensionless(1.0, 0.0, 1.0);
        let hybrid = Hybrid::new(parameters, State::default(), Drive::default());
        self.simulation = Simulation::Equations(hybrid.expect("unit parameters make sense"));
    }

    fn set_state(&mut self, state: Real, value: f64) {
        self.progress = Progress::UnderWay;
        let states = &mut self.hybrid_mut().states;
        match state {
            Real::q1 => states.q1 = value,
            Real::u1 => states.u1 = value,
            Real::q2 => states.q2 = value,
            Real::u2 => states.u2 = value,
            _ => states.phase = value,
        }
    }

    fn set_time(&mut self, time: f64) {
        self.hybrid_mut().time = time;
    }

    fn event_indicator(&self, index: usize) -> f64 {
        self.hybrid().event_functions()[index]
    }

    fn enter_event_mode(&mut self) {
        self.hybrid_mut().begin_event();
    }

    fn new_discrete_states(&mut self, time: f64, log: &Log) -> Result<Discrete, Refusal> {
        self.check_settings()?;
        let behind = self.hybrid().behind_wall();
        if behind > 1.0 + LATE_IMPACT {
            log.warn_once(
                "walls",
                format_args!(
                    "the master's steps resolve no impact: the particle is met at |w| = {behind:.2} b at t = {time} s, behind the wall. \
                     Expected an integrator that finds the zeros of the event indicators, at a tolerance of 1e-8, or shorter steps; in \
                     co-simulation steps may have any length"
                ),
            );
        }
        self.progress = Progress::UnderWay;
        let jumped = (self.hybrid_mut()).resolve(time, |event, rest| log::tell_exchange(log, time, event, rest));
        Ok(Discrete { states_changed: jumped, ..Discrete::default() })
    }

    fn completed_step(&mut self) -> bool {
        self.hybrid().overdue()
    }

    fn nominal(&self, state: Real) -> f64 {
        // Before initialization the rig is not yet made of the values set.
        let length = self.parameters.half_width;
        let velocity = length * self.parameters.natural_frequency();
        let nominal = match state {
            Real::q1 | Real::q2 => length,
            Real::u1 | Real::u2 => velocity,
            _ => 1.0,
        };
        if nominal.is_normal() && nominal > 0.0 {
            nominal
        } else {
            1.0
        }
    }
}
