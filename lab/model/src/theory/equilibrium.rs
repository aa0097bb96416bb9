//! Equilibria of the slow flow at any excitation and detuning (docs/theory.md, eqs. 12 and 14).

use std::f64::consts::{FRAC_2_PI, FRAC_PI_2};

use serde::Serialize;

use super::{manifold::BranchSide, polynomial::real_roots, slow_flow::SlowFlow, stability::impacts_stable};

/// A steady 1:1 motion.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Equilibrium {
    /// Amplitude of v over b.
    #[serde(rename = "C")]
    pub c: f64,
    /// Particle speed over `b omega0`.
    #[serde(rename = "B")]
    pub b: f64,
    /// Phase of v relative to the base, rad.
    pub gamma: f64,
    /// Side of the fold.
    pub branch: BranchSide,
    /// The impact pattern is stable.
    pub impacts_stable: bool,
    /// Both eigenvalues of the slow flow have negative real parts.
    pub slow_flow_stable: bool,
}

impl SlowFlow {
    /// All equilibria at the excitation `g` and the detuning `sigma`, on both branches, by rising B.
    ///
    /// The squares of the two equilibrium conditions (eq. 12) add up to a quartic in B (eq. 14).
    pub fn equilibria(&self, g: f64, sigma: f64) -> Vec<Equilibrium> {
        self.equilibrium_speeds(g, Some(sigma))
            .into_iter()
            .map(|b| {
                let sine = -self.loss(b);
                let cosine = self.spring(sigma, b);
                self.equilibrium(g, b, sine.atan2(cosine))
            })
            .collect()
    }

    /// `G C cos gamma = (4/pi) B (1 - pi B/2) - 2 sigma C^2` at an equilibrium.
    pub(super) fn spring(&self, sigma: f64, b: f64) -> f64 {
        2.0 * (self.free_detuning(b) - sigma) * self.manifold.c(b).powi(2)
    }

    pub(super) fn equilibrium(&self, g: f64, b: f64, gamma: f64) -> Equilibrium {
        Equilibrium {
            c: self.manifold.c(b),
            b,
            gamma,
            branch: self.manifold.side(b),
            impacts_stable: impacts_stable(&self.manifold, b),
            slow_flow_stable: self.is_attracting(g, b, gamma),
        }
    }

    /// Trace negative and determinant positive of the slow flow's Jacobian in (C~, gamma).
    fn is_attracting(&self, g: f64, b: f64, gamma: f64) -> bool {
        let r = self.manifold.dissipation;
        let c = self.manifold.c(b);
        let slope = self.manifold.slope(b);
        let (sine, cosine) = gamma.sin_cos();
        let loss_slope = self.lambda + 4.0 * FRAC_2_PI * r * b * slope;
        let free_slope = (FRAC_2_PI * (1.0 - 2.0 * FRAC_PI_2 * b) * slope - self.free_detuning(b)) / (c * c);
        let jacobian = [
            [-loss_slope - g * sine / (2.0 * c), -g * c * cosine],
            [free_slope + g * cosine / (4.0 * c.powi(3)), g * sine / (2.0 * c)],
        ];
        let trace = jacobian[0][0] + jacobian[1][1];
        let determinant = jacobian[0][0] * jacobian[1][1] - jacobian[0][1] * jacobian[1][0];
        trace < 0.0 && determinant > 0.0
    }

    /// Particle speeds of all equilibria, ascending; without `sigma`, of those at phase resonance.
    pub(super) fn equilibrium_speeds(&self, g: f64, sigma: Option<f64>) -> Vec<f64> {
        let mut speeds = real_roots(&self.equilibrium_polynomial(g, sigma));
        // Elastic impacts reach C = 0 at the fold: there everything squared vanishes, but nothing rests.
        speeds.retain(|b| *b > 0.0 && self.manifold.c(*b) > 1e-6);
        speeds
    }

    /// `loss^2 + spring^2 - G^2 C^2` in powers of B, ascending; without `sigma`, phase resonance: no spring term.
    fn equilibrium_polynomial(&self, g: f64, sigma: Option<f64>) -> [f64; 5] {
        // C^2 = 1 - pi B + (R^2 + pi^2/4) B^2
        let square = [1.0, -2.0 * FRAC_PI_2, self.manifold.curvature()];
        let mut loss = square.map(|one| self.lambda * one);
        loss[2] += 2.0 * FRAC_2_PI * self.manifold.dissipation;
        let spring = sigma.map_or([0.0; 3], |sigma| {
            let free = [0.0, 2.0 * FRAC_2_PI, -2.0];
            std::array::from_fn(|i| free[i] - 2.0 * sigma * square[i])
        });
        let mut sum = [0.0; 5];
        for i in 0..3 {
            for j in 0..3 {
                sum[i + j] += loss[i] * loss[j] + spring[i] * spring[j];
            }
            sum[i] -= g * g * square[i];
        }
        sum
    }
}
