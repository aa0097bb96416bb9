//! The slow invariant manifold (SIM): the relation between C and B that impacts enforce (docs/theory.md, eqs. 4 to 6).

use std::f64::consts::{FRAC_PI_2, PI};

use serde::Serialize;

/// The manifold `C^2 = R^2 B^2 + (1 - pi B/2)^2` with `R = (1 - r)/(1 + r)` (eq. 4).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Manifold {
    /// `R = (1 - r)/(1 + r)`: 0 for elastic impacts.
    pub dissipation: f64,
}

/// Which side of the fold.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum BranchSide {
    /// `B < Bmin`: always unstable.
    Left,
    /// `B >= Bmin`.
    Right,
}

impl Manifold {
    /// The manifold for the restitution coefficient `r`, in (0, 1].
    pub fn new(r: f64) -> Self {
        Self { dissipation: (1.0 - r) / (1.0 + r) }
    }

    /// `R^2 + pi^2/4`: the coefficient of B^2.
    pub(super) fn curvature(&self) -> f64 {
        self.dissipation * self.dissipation + FRAC_PI_2 * FRAC_PI_2
    }

    /// Particle speed at the fold, `Bmin = (pi/2)/(R^2 + pi^2/4)` (eq. 5).
    pub fn b_min(&self) -> f64 {
        FRAC_PI_2 / self.curvature()
    }

    /// Smallest amplitude, at the fold: `Cmin = R/sqrt(R^2 + pi^2/4)` (eq. 5).
    pub fn c_min(&self) -> f64 {
        self.dissipation / self.curvature().sqrt()
    }

    /// Amplitude C at the particle speed `b`.
    pub fn c(&self, b: f64) -> f64 {
        (self.dissipation * b).hypot(1.0 - FRAC_PI_2 * b)
    }

    /// Particle speed `B = Bmin ± sqrt((2/pi) Bmin (C^2 - Cmin^2))` on a branch; None below the fold, and where B < 0.
    ///
    /// Eq. 6; the published text prints pi/2 in that root, but 2/pi follows from the manifold.
    pub fn b(&self, c: f64, side: BranchSide) -> Option<f64> {
        let (b_min, c_min) = (self.b_min(), self.c_min());
        if c.is_nan() || c < c_min {
            return None;
        }
        let square = 2.0 / PI * b_min * (c - c_min) * (c + c_min);
        let b = match side {
            BranchSide::Left => b_min - square.sqrt(),
            BranchSide::Right => b_min + square.sqrt(),
        };
        (b >= 0.0).then_some(b)
    }

    /// The branch on which `b` lies.
    pub fn side(&self, b: f64) -> BranchSide {
        if b < self.b_min() {
            BranchSide::Left
        } else {
            BranchSide::Right
        }
    }

    /// Slope `dB/d(C^2) = 1/(2 (R^2 + pi^2/4)(B - Bmin))`; infinite at the fold.
    pub fn slope(&self, b: f64) -> f64 {
        0.5 / (self.curvature() * (b - self.b_min()))
    }
}
