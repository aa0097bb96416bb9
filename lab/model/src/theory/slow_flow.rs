//! The slow flow on the manifold, and its coefficients in the published form (docs/theory.md, eqs. 11 to 13).

use std::f64::consts::{FRAC_2_PI, FRAC_PI_2, PI};

use serde::Serialize;

use super::manifold::Manifold;

/// The slow flow in `tau1 = epsilon tau`, for given damping and restitution.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SlowFlow {
    /// Damping `c/(m omega0)`.
    pub lambda: f64,
    /// The manifold that it runs on.
    pub manifold: Manifold,
}

/// The coefficients k1…k6 of the equilibria
/// `-G C sin gamma = k1 C~ ± k2 s + k3`, `G C cos gamma = k4 C~ ± k5 s + k6` with `s = sqrt(C~ - Cmin^2)`, `C~ = C^2`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[allow(missing_docs, reason = "the names are those of the equations above")]
pub struct Coefficients {
    pub k1: f64,
    pub k2: f64,
    pub k3: f64,
    pub k4: f64,
    pub k5: f64,
    pub k6: f64,
}

impl SlowFlow {
    /// The slow flow for the damping `lambda` and the restitution coefficient `r`.
    #[must_use]
    pub fn new(lambda: f64, r: f64) -> Self {
        Self { lambda, manifold: Manifold::new(r) }
    }

    /// `lambda C^2 + (4/pi) R B^2`: dissipation of C^2 by damping and impacts per unit of tau1 (eq. 11).
    #[must_use]
    pub fn loss(&self, b: f64) -> f64 {
        self.lambda * self.manifold.c(b).powi(2) + 2.0 * FRAC_2_PI * self.manifold.dissipation * b * b
    }

    /// `(2/pi) B (1 - pi B/2)/C^2`: the detuning at which the motion rotates by itself (eq. 11).
    #[must_use]
    pub fn free_detuning(&self, b: f64) -> f64 {
        FRAC_2_PI * b * (1.0 - FRAC_PI_2 * b) / self.manifold.c(b).powi(2)
    }

    /// `(D1 C~, D1 gamma)` at the particle speed `b` and the phase `gamma`, rad (eq. 11).
    #[must_use]
    pub fn rates(&self, g: f64, sigma: f64, b: f64, gamma: f64) -> [f64; 2] {
        let c = self.manifold.c(b);
        [
            -self.loss(b) - g * c * gamma.sin(),
            self.free_detuning(b) - g * gamma.cos() / (2.0 * c) - sigma,
        ]
    }

    /// k1…k6 at the detuning `sigma` (eq. 13).
    #[must_use]
    pub fn coefficients(&self, sigma: f64) -> Coefficients {
        let r = self.manifold.dissipation;
        let b_min = self.manifold.b_min();
        let c_min_squared = self.manifold.c_min().powi(2);
        let root = (FRAC_2_PI * b_min).sqrt();
        Coefficients {
            k1: self.lambda + 8.0 / (PI * PI) * r * b_min,
            k2: 8.0 / PI * r * b_min * root,
            k3: 4.0 / PI * r * b_min * (b_min - FRAC_2_PI * c_min_squared),
            k4: -4.0 / PI * b_min - 2.0 * sigma,
            k5: 4.0 / PI * root * (1.0 - PI * b_min),
            k6: 4.0 / PI * b_min * (1.0 - FRAC_PI_2 * b_min + c_min_squared),
        }
    }
}
