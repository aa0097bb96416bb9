//! A small disturbance along a simulated motion, linearised through flights, impacts and sticking (docs/theory.md, eq. 25).
//!
//! Between impacts a disturbance obeys the free equations whatever the motion is. Only an impact needs the motion itself: its
//! relative velocity, and the jump of the velocity and acceleration of the primary mass.

use nalgebra::Vector2;

use super::oscillator::Oscillator;
use crate::Dimensionless;

/// A disturbance (q1, q1', q2, q2') of size one at the beginning of every step.
#[derive(Debug, Clone, Copy)]
pub struct Tangent {
    free: Oscillator,
    epsilon: f64,
    r: f64,
    zeta: f64,
    primary: Vector2<f64>,
    particle: Vector2<f64>,
    stuck: bool,
    /// Time of the last event of the step.
    at: f64,
}

impl Tangent {
    /// A disturbance of all four variables.
    #[must_use]
    pub fn new(scene: &Dimensionless) -> Self {
        let zeta = scene.epsilon * scene.lambda / 2.0;
        Self {
            free: Oscillator::new(zeta),
            epsilon: scene.epsilon,
            r: scene.r,
            zeta,
            primary: Vector2::new(0.5, 0.5),
            particle: Vector2::new(0.5, -0.5),
            stuck: false,
            at: 0.0,
        }
    }

    /// An impact at the time `t` of the step with the relative velocity `dw` before it, where the relative acceleration is `ddw`.
    pub fn impact(&mut self, t: f64, dw: f64, ddw: f64) {
        self.flow(t);
        // The disturbed motion reaches the wall later by this.
        let later = -(self.primary[0] - self.particle[0]) / dw;
        let change = self.primary[1] - self.particle[1] + ddw * later;
        let particle = (1.0 + self.r) / (1.0 + self.epsilon);
        let impulse = -self.epsilon * particle;
        self.primary += Vector2::new(-impulse * dw * later, impulse * (change + 2.0 * self.zeta * dw * later));
        self.particle += Vector2::new(-particle * dw * later, particle * change);
    }

    /// The particle comes to rest on a wall: from now on it moves with the primary mass. A disturbed motion does so a little earlier or
    /// later, with other velocities until then; only their common centre of mass has no jump.
    pub fn stick(&mut self, t: f64) {
        self.flow(t);
        self.stuck = true;
        self.primary = (self.primary + self.particle * self.epsilon) / (1.0 + self.epsilon);
        self.particle = self.primary;
    }

    /// The wall releases the particle; the relative acceleration is zero there.
    pub fn release(&mut self, t: f64) {
        self.flow(t);
        self.stuck = false;
    }

    /// Ends the step at the time `t`: the natural logarithm of the growth over the step.
    pub fn end(&mut self, t: f64) -> f64 {
        self.flow(t);
        self.at = 0.0;
        let size = self.primary.norm().hypot(self.particle.norm());
        self.primary /= size;
        self.particle /= size;
        size.ln()
    }

    fn flow(&mut self, t: f64) {
        let duration = t - self.at;
        self.at = t;
        if self.stuck {
            // Both masses as one oscillator: slower by the root of 1 + epsilon.
            let slow = (1.0 + self.epsilon).sqrt();
            let joint = Oscillator::new(self.zeta / slow).propagator(duration / slow);
            let [q, dq] = (joint * Vector2::new(self.primary[0], self.primary[1] * slow)).into();
            self.primary = Vector2::new(q, dq / slow);
            self.particle = self.primary;
        } else {
            self.primary = self.free.propagator(duration) * self.primary;
            self.particle[0] += self.particle[1] * duration;
        }
    }
}
