//! The slow flow on the manifold (docs/theory.md, eq. 11).

use std::f64::consts::{FRAC_2_PI, FRAC_PI_2};

use super::manifold::Manifold;

/// The slow flow in `tau1 = epsilon tau`, for given damping and restitution.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SlowFlow {
    /// Damping `c/(m omega0)`.
    pub lambda: f64,
    /// The manifold that it runs on.
    pub manifold: Manifold,
}

impl SlowFlow {
    /// The slow flow for the damping `lambda` and the restitution coefficient `r`.
    pub fn new(lambda: f64, r: f64) -> Self {
        Self { lambda, manifold: Manifold::new(r) }
    }

    /// `lambda C^2 + (4/pi) R B^2`: dissipation of C^2 by damping and impacts per unit of tau1 (eq. 11).
    pub fn loss(&self, b: f64) -> f64 {
        self.lambda * self.manifold.c(b).powi(2) + 2.0 * FRAC_2_PI * self.manifold.dissipation * b * b
    }

    /// `(2/pi) B (1 - pi B/2)/C^2`: the detuning at which the motion rotates by itself (eq. 11).
    pub fn free_detuning(&self, b: f64) -> f64 {
        FRAC_2_PI * b * (1.0 - FRAC_PI_2 * b) / self.manifold.c(b).powi(2)
    }

    /// `(D1 C~, D1 gamma)` at the particle speed `b` and the phase `gamma`, rad (eq. 11).
    pub fn rates(&self, g: f64, sigma: f64, b: f64, gamma: f64) -> [f64; 2] {
        let c = self.manifold.c(b);
        [
            -self.loss(b) - g * c * gamma.sin(),
            self.free_detuning(b) - g * gamma.cos() / (2.0 * c) - sigma,
        ]
    }
}
