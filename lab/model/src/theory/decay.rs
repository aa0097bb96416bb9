//! The free decay along the manifold in closed form (docs/theory.md, eq. 20).

use std::f64::consts::{FRAC_2_PI, PI};

use super::slow_flow::{BackbonePoint, SlowFlow};
use crate::numerics::equally_spaced;

impl SlowFlow {
    /// `points` points of the free decay from the particle speed `b` on the right branch down to the fold, at equal steps of B, each with the slow
    /// time `epsilon omega0 t` since the release; None left of the fold, or without dissipation.
    pub fn decay(&self, b: f64, points: usize) -> Option<Vec<(f64, BackbonePoint)>> {
        let fold = self.manifold.b_min();
        let dissipates = self.lambda > 0.0 || self.manifold.dissipation > 0.0;
        let start = self.time_primitive(b);
        let point = |b: f64| (start - self.time_primitive(b), self.backbone_at(b));
        (dissipates && b >= fold).then(|| equally_spaced(b, fold, points).map(point).collect())
    }

    /// Slow time of the decay as a function of B, up to a constant and the sign.
    ///
    /// `D1 C~ = -loss(B)` becomes `D1 B = -loss(B) dB/dC~`, and `tau1` is the integral of `(2 K B - pi)/loss(B)`
    /// with `K = R^2 + pi^2/4`: a logarithm and an arc tangent, because the loss is quadratic in B.
    fn time_primitive(&self, b: f64) -> f64 {
        let SlowFlow { lambda, manifold } = *self;
        let (r, k) = (manifold.dissipation, manifold.curvature());
        let a = lambda * k + 2.0 * FRAC_2_PI * r;
        // The root and this slope are never negative on the right branch; the root vanishes with lambda or R.
        let root = 2.0 * (lambda * r * (lambda * r + 4.0 / PI)).sqrt();
        let slope = 2.0 * a * b - PI * lambda;
        let arc = if root > 0.0 {
            (root / slope).atan() / root
        } else {
            1.0 / slope
        };
        let rest = if r > 0.0 { 8.0 * r / a * arc } else { 0.0 };
        k / a * self.loss(b).ln() + rest
    }
}
