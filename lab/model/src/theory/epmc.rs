//! The extended periodic motion concept: negative damping instead of a drive keeps the motion periodic (docs/theory.md, eq. 23).

use serde::Serialize;

use super::slow_flow::SlowFlow;

/// An unforced periodic motion held by the mass-proportional negative damping `2 delta`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Epmc {
    /// Half of the negative damping, in units of `epsilon omega0`.
    pub delta: f64,
    /// Amplitude of v over b.
    pub c: f64,
    /// Detuning.
    pub sigma: f64,
}

impl SlowFlow {
    /// The periodic motion at the particle speed `b`: with `G = 0` and `lambda - 2 delta` for lambda,
    /// the loss vanishes at `2 delta = loss/C^2`, while the detuning is the free one.
    #[must_use]
    pub fn epmc(&self, b: f64) -> Epmc {
        let c = self.manifold.c(b);
        Epmc {
            delta: self.loss(b) / (2.0 * c * c),
            c,
            sigma: self.free_detuning(b),
        }
    }
}
