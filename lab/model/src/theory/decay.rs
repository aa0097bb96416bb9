//! The free decay along the manifold in closed form (docs/theory.md, eq. 20), and the first-order motion in physical time: a sine for
//! v, and a sine with a triangle wave for w (eq. 22).

use std::f64::consts::{FRAC_2_PI, PI};

use super::slow_flow::{BackbonePoint, SlowFlow};
use crate::Dimensionless;
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
}

/// The triangle wave Pi: slope ±1, height pi/2, zero and rising at 0.
fn triangle_wave(phase: f64) -> f64 {
    phase.sin().asin()
}
