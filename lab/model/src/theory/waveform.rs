//! The first-order motion in physical time: a sine for v, and a sine with a triangle wave for w.

use std::f64::consts::FRAC_PI_2;

use super::{decay::Decay, slow_flow::SlowFlow};
use crate::Dimensionless;

/// A motion of the 1:1 regime at one instant of its slow time; displacements in m (docs/theory.md, eq. 22).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Waveform {
    /// Amplitude of v, m.
    pub amplitude: f64,
    /// Particle speed over the angular frequency, m: the triangle wave has the height pi/2 times this.
    pub triangle: f64,
    /// Angular frequency, rad/s.
    pub omega: f64,
    /// Phase of v at t = 0, rad.
    pub gamma: f64,
    /// Phase of the triangle wave at t = 0, rad.
    pub psi: f64,
    epsilon: f64,
}

impl Waveform {
    /// The motion at the particle speed `b` on the manifold, the detuning `sigma` and the phase `gamma`, rad; time counts from
    /// a passage of the base through zero, upwards.
    pub fn new(scene: &Dimensionless, sigma: f64, b: f64, gamma: f64) -> Self {
        let flow = SlowFlow::new(scene.lambda, scene.r);
        Self {
            amplitude: scene.b * flow.manifold.c(b),
            triangle: scene.b * b,
            omega: scene.omega(sigma),
            gamma,
            psi: flow.psi(b, gamma),
            epsilon: scene.epsilon,
        }
    }

    /// `v = q1 + epsilon q2`, m, at the time `t`, s.
    pub fn v(&self, t: f64) -> f64 {
        self.amplitude * (self.omega * t + self.gamma).sin()
    }

    /// `w = q1 - q2`, m, at the time `t`, s.
    pub fn w(&self, t: f64) -> f64 {
        self.v(t) + self.triangle * triangle_wave(self.omega * t + self.psi)
    }

    /// Displacement of the primary mass, m: `(v + epsilon w)/(1 + epsilon)`.
    pub fn q1(&self, t: f64) -> f64 {
        (self.v(t) + self.epsilon * self.w(t)) / (1.0 + self.epsilon)
    }

    /// Displacement of the particle, m: `(v - w)/(1 + epsilon)`.
    pub fn q2(&self, t: f64) -> f64 {
        (self.v(t) - self.w(t)) / (1.0 + self.epsilon)
    }

    /// The first impact on the wall w = +b at or after t = 0, s.
    pub fn impact_time(&self) -> f64 {
        (FRAC_PI_2 - self.psi).rem_euclid(std::f64::consts::TAU) / self.omega
    }
}

/// The triangle wave Pi: slope ±1, height pi/2, zero and rising at 0.
pub fn triangle_wave(phase: f64) -> f64 {
    phase.sin().asin()
}

impl Decay {
    /// (v, w) over b at the fast time `tau = omega0 t` since the release, for v at the phase `gamma` (rad) then; None
    /// once the fold is passed. The phase advances by `tau` and the integral of sigma (docs/theory.md, eq. 21).
    pub fn motion(&self, epsilon: f64, gamma: f64, tau: f64) -> Option<[f64; 2]> {
        let point = self.at(epsilon * tau)?;
        let phase = gamma + tau + self.turned(point.b);
        let v = point.c * phase.sin();
        let psi = self.flow().psi(point.b, phase);
        Some([v, v + point.b * triangle_wave(psi)])
    }
}
