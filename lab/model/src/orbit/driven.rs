//! The primary mass of a simulated motion between its events: what the plant's events do not contain.

use nalgebra::{Complex, Vector2};

use super::forced_oscillator::ForcedOscillator;
use super::oscillator::Oscillator;
use crate::Dimensionless;

/// The driven oscillator of a scene at one frequency.
#[derive(Debug, Clone, Copy)]
pub struct Driven {
    free: ForcedOscillator,
    epsilon: f64,
    r: f64,
    g: f64,
}

/// One step of the motion, from event to event.
pub struct DrivenStep<'a> {
    driven: &'a Driven,
    phase: f64,
    at: f64,
    state: Vector2<f64>,
    stuck: bool,
}

impl Driven {
    /// The oscillator of `scene` at the frequency `omega` over omega0.
    #[must_use]
    pub fn new(scene: &Dimensionless, omega: f64) -> Self {
        Self {
            free: ForcedOscillator::new(scene, omega, scene.g),
            epsilon: scene.epsilon,
            r: scene.r,
            g: scene.g,
        }
    }

    /// A step from (q1, q1') where the base has the phase `phase`, rad; the particle may be stuck to a wall.
    #[must_use]
    pub fn from(&self, phase: f64, state: [f64; 2], stuck: bool) -> DrivenStep<'_> {
        DrivenStep { driven: self, phase, at: 0.0, state: state.into(), stuck }
    }

    /// Bound of `|q1|` from (q1, q1') at the phase `phase` on, without impacts.
    #[must_use]
    pub fn reach(&self, phase: f64, state: [f64; 2]) -> f64 {
        let omega = self.free.omega;
        (Vector2::from(state) - self.free.harmonic(phase)).norm() + self.free.acceleration() / (omega * omega)
    }
}

impl DrivenStep<'_> {
    /// Passes an impact at the time `t` of the step with the relative velocity `dw`; returns the acceleration of the primary mass
    /// just before it, which is that of the relative motion.
    pub fn impact(&mut self, t: f64, dw: f64) -> f64 {
        self.flow(t);
        let Driven { free, epsilon, r, .. } = *self.driven;
        let acceleration =
            free.free.free_acceleration(self.state[0], self.state[1]) + free.force(self.phase + free.omega * t);
        self.state[1] -= epsilon * (1.0 + r) / (1.0 + epsilon) * dw;
        acceleration
    }

    /// Both masses move as one from the time `t` on.
    pub fn stick(&mut self, t: f64) {
        self.flow(t);
        self.stuck = true;
    }

    /// They separate.
    pub fn release(&mut self, t: f64) {
        self.flow(t);
        self.stuck = false;
    }

    fn flow(&mut self, t: f64) {
        let Driven { free, epsilon, g, .. } = *self.driven;
        let (duration, from, to) = (
            t - self.at,
            self.phase + free.omega * self.at,
            self.phase + free.omega * t,
        );
        self.at = t;
        if !self.stuck {
            let propagator = free.free.propagator(duration);
            self.state = propagator * (self.state - free.harmonic(from)) + free.harmonic(to);
            return;
        }
        // Both masses as one oscillator: slower by the root of 1 + epsilon.
        let slow = (1.0 + epsilon).sqrt();
        let joint = Oscillator::new(free.zeta / slow);
        let amplitude = joint.compliance(free.omega * slow) * free.free.base_force(free.omega) * (epsilon * g);
        let response = |phase: f64| {
            let z = amplitude * Complex::from_polar(1.0, phase);
            Vector2::new(z.im, free.omega * slow * z.re)
        };
        let scaled = Vector2::new(self.state[0], slow * self.state[1]) - response(from);
        let [q, dq] = (joint.propagator(duration / slow) * scaled + response(to)).into();
        self.state = Vector2::new(q, dq / slow);
    }
}
