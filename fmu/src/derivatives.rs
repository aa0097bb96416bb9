//! Partial derivatives of what the master may ask for, and time derivatives of the outputs.

use super::variables::Real;
use super::{LoViNes, Progress, Simulation};
use crate::model_exchange::equations::{Dual, Instant, Scalar};
use crate::model_exchange::rates::Movement;
use fmi2_component::{Causality, Key, Refusal};
use lovines::cavity::GRAVITY;
use lovines::{Cavity, Plant};

/// The highest order of output derivatives, as the description says it.
const OUTPUT_ORDER: u32 = 3;

/// A value that follows from the rig at one instant; 0 for one that only changes at events.
pub(super) fn of_instant<T: Scalar>(now: &Instant<T>, variable: Real) -> T {
    match variable {
        Real::q1 => now.q1,
        Real::der_q1 => now.dq1,
        Real::q2 => now.q2,
        Real::der_q2 => now.dq2,
        Real::v => now.centre(),
        Real::w => now.relative_displacement(),
        Real::der_w => now.relative_velocity(),
        Real::base => now.base(),
        Real::phase => now.phase,
        Real::energy => now.energy(),
        Real::u1 => now.reduced_velocities().0,
        Real::u2 => now.reduced_velocities().1,
        Real::der_u1 => now.reduced_accelerations().0,
        Real::der_u2 => now.reduced_accelerations().1,
        Real::der_phase => now.omega,
        _ => T::from(0.0),
    }
}

impl LoViNes {
    /// The present plant with the present inputs.
    pub(super) fn instant(&self, plant: &Plant) -> Instant<f64> {
        let (p, state) = (&self.parameters, plant.state());
        let base = self.base_motion(plant.base());
        let (gravity, friction) = plant.constant_accelerations();
        Instant {
            primary_mass: p.primary_mass,
            stiffness: p.stiffness,
            damping: p.damping,
            particle_mass: p.particle_mass,
            signal: base.drive.signal[0],
            slope: base.drive.signal[1],
            amplitude: base.drive.amplitude,
            omega: base.drive.omega,
            phase: base.phase.radians(),
            q1: state.q1,
            dq1: state.dq1,
            q2: state.q2,
            dq2: state.dq2,
            gravity,
            friction,
            stuck: plant.contact().is_some() || plant.sticks(),
        }
    }

    /// The partial derivative of `unknown` with respect to `known`; the contact state does not change.
    ///
    /// What is held constant depends on the interface: in model exchange, after initialization, the reduced velocities are
    /// states, so that a velocity changes with the base; in co-simulation it does not.
    pub(super) fn slope(&self, unknown: Real, known: Real) -> Result<f64, Refusal> {
        let causality = unknown.variable().causality;
        if !matches!(causality, Causality::Output | Causality::Local) {
            return Err(Refusal::error(format!(
                "{} is not an unknown: expected an output or a derivative",
                unknown.variable().name
            )));
        }
        let known = match known {
            // A start value has an effect until Initialization Mode is left.
            Real::q1_start | Real::der_q1_start | Real::q2_start | Real::der_q2_start
                if self.progress == Progress::UnderWay =>
            {
                return Ok(0.0);
            }
            Real::q1_start => Real::q1,
            Real::der_q1_start => Real::der_q1,
            Real::q2_start => Real::q2,
            Real::der_q2_start => Real::der_q2,
            other => other,
        };
        let (now, integrated) = match &self.simulation {
            Simulation::Steps(plant) => (self.instant(plant), false),
            Simulation::Structure(_) => return Err(Refusal::error("a structure has no directional derivatives")),
            Simulation::Equations(hybrid) => (hybrid.instant(), self.progress == Progress::UnderWay),
        };
        let reduced_are_states = match known {
            Real::u1 | Real::u2 => true,
            Real::der_q1 | Real::der_q2 => false,
            _ => integrated,
        };
        let mut dual = perturbed(&now, known, reduced_are_states)?;
        if unknown == Real::friction_loss {
            // The force times the way since the last event; in co-simulation it changes with a step only.
            let way = (dual.q1 - dual.q2).slope * f64::from(u8::from(integrated));
            return Ok(now.particle_mass * now.friction * way);
        }
        // The friction has the sign of the relative velocity.
        let Cavity { tilt, kinetic_friction, .. } = self.parameters.cavity;
        let ((sin, cos), sign) = (
            tilt.sin_cos(),
            if now.friction == 0.0 {
                0.0
            } else {
                now.friction.signum()
            },
        );
        match known {
            Real::theta => {
                dual.gravity.slope = GRAVITY * cos;
                dual.friction.slope = -sign * kinetic_friction * GRAVITY * sin;
            }
            Real::mu_k => dual.friction.slope = sign * GRAVITY * cos,
            _ => {}
        }
        Ok(of_instant(&dual, unknown).slope)
    }

    /// The time derivative of an output at the end of the last step.
    pub(super) fn time_derivative(&self, variable: Real, order: u32) -> Result<f64, Refusal> {
        let Simulation::Steps(plant) = &self.simulation else {
            return Err(Refusal::error(
                "output derivatives exist for one oscillator in co-simulation only",
            ));
        };
        if order > OUTPUT_ORDER {
            return Err(Refusal::error(format!(
                "derivative {order} of {} is refused; allowed are orders 1 to {OUTPUT_ORDER}",
                variable.variable().name
            )));
        }
        let n = order as usize;
        let Movement { base, primary, particle, .. } = Movement::of(plant);
        let p = &self.parameters;
        Ok(match variable {
            Real::q1 => primary[n],
            Real::der_q1 => primary[n + 1],
            Real::q2 => particle[n],
            Real::der_q2 => particle[n + 1],
            Real::v => primary[n] + p.mass_ratio() * particle[n],
            Real::w => primary[n] - particle[n],
            Real::der_w => primary[n + 1] - particle[n + 1],
            Real::base => base[n],
            Real::phase if n == 1 => plant.base().drive.omega,
            Real::energy => Movement::of(plant).energy(p, n),
            // `w'` and the friction have the same sign.
            Real::friction_loss => p.particle_mass * plant.constant_accelerations().1 * (primary[n] - particle[n]),
            Real::stuck_time if n == 1 => f64::from(u8::from(plant.sticks())),
            // The phase grows at a constant rate, and the outputs of impacts change at the next impact only.
            _ => 0.0,
        })
    }
}

/// The instant with a derivative along `known`.
fn perturbed(now: &Instant<f64>, known: Real, reduced_are_states: bool) -> Result<Instant<Dual>, Refusal> {
    let along = |variable: Real, value: f64| Dual { value, slope: f64::from(u8::from(variable == known)) };
    let instant = Instant {
        primary_mass: along(Real::M, now.primary_mass),
        stiffness: along(Real::k, now.stiffness),
        damping: along(Real::c, now.damping),
        particle_mass: along(Real::m, now.particle_mass),
        signal: along(Real::e, now.signal),
        slope: Dual::from(now.slope),
        amplitude: along(Real::E, now.amplitude),
        omega: along(Real::omega, now.omega),
        phase: along(Real::phase, now.phase),
        q1: along(Real::q1, now.q1),
        dq1: along(Real::der_q1, now.dq1),
        q2: along(Real::q2, now.q2),
        dq2: along(Real::der_q2, now.dq2),
        gravity: Dual::from(now.gravity),
        friction: Dual::from(now.friction),
        stuck: now.stuck,
    };
    let (u1, u2) = now.reduced_velocities();
    match known {
        Real::M
        | Real::k
        | Real::c
        | Real::m
        | Real::e
        | Real::E
        | Real::omega
        | Real::phase
        | Real::q1
        | Real::der_q1
        | Real::q2
        | Real::der_q2
        | Real::u1
        | Real::u2 => Ok(if reduced_are_states {
            instant.with_reduced((along(Real::u1, u1), along(Real::u2, u2)))
        } else {
            instant
        }),
        // Only the next event depends on it, or what is constant.
        _ if known.variable().causality == Causality::Parameter => Ok(instant),
        _ => Err(Refusal::error(format!(
            "{} is not a known: expected a parameter, an input or a state",
            known.variable().name
        ))),
    }
}
