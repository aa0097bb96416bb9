//! The backbone: phase resonance `gamma = -pi/2` along the manifold (docs/theory.md, eqs. 16 to 18).

use std::f64::consts::FRAC_2_PI;

use serde::Serialize;

use crate::numerics::equally_spaced;

use super::{manifold::BranchSide, slow_flow::SlowFlow, stability::impacts_stable};

/// One point of the backbone, with the excitation that it needs.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct BackbonePoint {
    /// Amplitude of v over b.
    #[serde(rename = "C")]
    pub c: f64,
    /// Particle speed over `b omega0`.
    #[serde(rename = "B")]
    pub b: f64,
    /// Detuning sigma_R.
    pub sigma: f64,
    /// Base amplitude over `b epsilon` for phase resonance here: `lambda C + (4/pi) R B^2/C`.
    #[serde(rename = "G")]
    pub g: f64,
    /// Side of the fold.
    pub branch: BranchSide,
    /// The impact pattern is stable: `Bmin < B < 2 pi/(pi^2 - 4)`.
    pub impacts_stable: bool,
    /// The slow flow is stable: `dG/dC > 0`.
    pub slow_flow_stable: bool,
}

impl BackbonePoint {
    /// Stable in both senses: a phase-locked loop can settle here.
    pub fn stable(&self) -> bool {
        self.impacts_stable && self.slow_flow_stable
    }
}

impl SlowFlow {
    /// The backbone point at the particle speed `b > 0`.
    pub fn backbone_at(&self, b: f64) -> BackbonePoint {
        let c = self.manifold.c(b);
        BackbonePoint {
            c,
            b,
            sigma: self.free_detuning(b),
            g: self.loss(b) / c,
            branch: self.manifold.side(b),
            impacts_stable: impacts_stable(&self.manifold, b),
            slow_flow_stable: self.excitation_slope(b) > 0.0,
        }
    }

    /// Slope dG/dC of the excitation along the backbone (eq. 18).
    pub fn excitation_slope(&self, b: f64) -> f64 {
        let r = self.manifold.dissipation;
        let c = self.manifold.c(b);
        let through_b = 4.0 * b * self.manifold.slope(b) - (b / c).powi(2);
        self.lambda + 2.0 * FRAC_2_PI * r * through_b
    }

    /// The detuning sigma_R at the amplitude `c` on a branch; None below the fold.
    pub fn backbone_sigma(&self, c: f64, side: BranchSide) -> Option<f64> {
        self.manifold.b(c, side).map(|b| self.free_detuning(b))
    }

    /// All phase-resonant solutions at the excitation `g`, on both branches, by increasing B.
    ///
    /// `(G C)^2 = (lambda C^2 + (4/pi) R B^2)^2` (eq. 17) is a quartic in B.
    pub fn phase_resonant(&self, g: f64) -> Vec<BackbonePoint> {
        self.equilibrium_speeds(g, None)
            .into_iter()
            .map(|b| self.backbone_at(b))
            .collect()
    }

    /// `points` samples of the backbone at equal steps of B, from `from` to `to`.
    pub fn backbone(&self, from: f64, to: f64, points: usize) -> Vec<BackbonePoint> {
        equally_spaced(from, to, points).map(|b| self.backbone_at(b)).collect()
    }
}
