//! The slow invariant manifold, the slow flow on it with all its equilibria, and the stability of its motions (docs/theory.md, eqs. 4 to 18).
//!
//! The two detunings at which a particle speed B occurs have a closed form, so B parametrises each frequency response. Its turning points are
//! the points of the backbone, where `loss = G C`.

use std::f64::consts::{FRAC_2_PI, FRAC_PI_2, PI, TAU};

use serde::Serialize;

use crate::numerics::{bisection, equally_spaced};

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

    /// The detuning at which a drive holds the particle speed `b` with v `off` beyond phase resonance, rad: `sigma_R - tan(off) loss/(2 C^2)` (eq. 12).
    pub fn detuning_at(&self, b: f64, off: f64) -> f64 {
        self.free_detuning(b) - off.tan() * self.loss(b) / (2.0 * self.manifold.c(b).powi(2))
    }

    /// `points` points of the free decay along the manifold from the particle speed `b` on the right branch down to the fold, at equal steps
    /// of B, each with the slow time `epsilon omega0 t` since the release; None left of the fold, or without dissipation.
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

/// Above this particle speed, `2 pi/(pi^2 - 4)`, the orbit loses its symmetry, whatever r (docs/theory.md, eq. 10).
pub const B_SYMMETRY_BREAKING: f64 = 2.0 * PI / (PI * PI - 4.0);

/// The impacts keep their symmetric 1:1 pattern: `Bmin < B < 2 pi/(pi^2 - 4)` (eq. 10).
pub fn impacts_stable(manifold: &Manifold, b: f64) -> bool {
    manifold.b_min() < b && b < B_SYMMETRY_BREAKING
}

/// A steady 1:1 motion.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Equilibrium {
    /// Detuning.
    #[serde(skip)]
    pub sigma: f64,
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

impl Equilibrium {
    /// Stable in both senses.
    pub fn is_stable(&self) -> bool {
        self.impacts_stable && self.slow_flow_stable
    }
}

impl SlowFlow {
    /// All equilibria at the excitation `g` and the detuning `sigma`, on both branches, by rising B.
    ///
    /// The squares of the two equilibrium conditions (eq. 12) add up to a quartic in B (eq. 14).
    pub fn equilibria(&self, g: f64, sigma: f64) -> Vec<Equilibrium> {
        let speeds = self.equilibrium_speeds(g, Some(sigma)).into_iter();
        speeds.map(|b| self.equilibrium((g, sigma), b)).collect()
    }

    /// `G C cos gamma = (4/pi) B (1 - pi B/2) - 2 sigma C^2` at an equilibrium.
    pub(super) fn spring(&self, sigma: f64, b: f64) -> f64 {
        2.0 * (self.free_detuning(b) - sigma) * self.manifold.c(b).powi(2)
    }

    /// The equilibrium of the particle speed `b`, which `g` holds at the detuning `sigma`.
    pub(super) fn equilibrium(&self, (g, sigma): (f64, f64), b: f64) -> Equilibrium {
        let gamma = (-self.loss(b)).atan2(self.spring(sigma, b));
        Equilibrium {
            sigma,
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

    /// Particle speeds of all equilibria, ascending; without `sigma`, of those at phase resonance, `G C = loss` (eq. 17).
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
        let mut loss = square.map(|coefficient| self.lambda * coefficient);
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
    fn excitation_slope(&self, b: f64) -> f64 {
        let r = self.manifold.dissipation;
        let c = self.manifold.c(b);
        let through_b = 4.0 * b * self.manifold.slope(b) - (b / c).powi(2);
        self.lambda + 2.0 * FRAC_2_PI * r * through_b
    }

    /// The distance from `sigma_R` of the detunings at which the excitation `g` holds the particle speed `b`: `sqrt(G^2 C^2 - loss^2)/(2 C^2)`
    /// (docs/theory.md, eq. 15). At the ends, which are phase-resonant, rounding may make the square negative.
    fn detuning_shift(&self, g: f64, b: f64) -> f64 {
        let (c, loss) = (self.manifold.c(b), self.loss(b));
        ((g * c - loss) * (g * c + loss)).max(0.0).sqrt() / (2.0 * c * c)
    }

    /// The frequency responses at the excitation `g`: closed curves over all B > 0, each of `points` points from its
    /// smallest C on one side to its largest and back. A curve that reaches B = 0 starts there, at C = 1.
    pub fn frequency_responses(&self, g: f64, points: usize) -> Vec<Vec<Equilibrium>> {
        let mut ends: Vec<f64> = self.equilibrium_speeds(g, None);
        // At B = 0 the loss is lambda and C is 1.
        if g > self.lambda {
            ends.insert(0, 0.0);
        }
        ends.chunks_exact(2)
            .map(|pair| self.loop_between(g, [pair[0], pair[1]], points))
            .collect()
    }

    /// The loop of a response between the two speeds at which it turns.
    fn loop_between(&self, g: f64, [low, high]: [f64; 2], points: usize) -> Vec<Equilibrium> {
        let at = |turn: f64| {
            let b = low + (high - low) * 0.5 * (1.0 - turn.cos());
            let b = b.clamp(low, high).max(1e-9);
            let side = if turn < PI { -1.0 } else { 1.0 };
            let sigma = self.free_detuning(b) + side * self.detuning_shift(g, b);
            sigma.is_finite().then(|| self.equilibrium((g, sigma), b))
        };
        equally_spaced(0.0, TAU, points).filter_map(at).collect()
    }
}

/// All real roots of a polynomial, ascending; coefficients by rising power. A double root counts once. Between two turning points there
/// is at most one root, so the derivative brackets them all.
fn real_roots(coefficients: &[f64]) -> Vec<f64> {
    let degree = coefficients.iter().rposition(|c| *c != 0.0);
    let Some(degree) = degree.filter(|degree| *degree > 0) else {
        return Vec::new();
    };
    let coefficients = &coefficients[..=degree];
    let derivative: Vec<f64> = coefficients
        .iter()
        .enumerate()
        .skip(1)
        .map(|(power, c)| power as f64 * c)
        .collect();
    // Cauchy's bound: no root is larger.
    let leading = coefficients[degree].abs();
    let bound = 1.0 + coefficients.iter().fold(0f64, |most, c| most.max(c.abs())) / leading;

    let mut ends = vec![-bound];
    ends.extend(real_roots(&derivative));
    ends.push(bound);
    let value = |x: f64| coefficients.iter().rev().fold(0.0, |sum, c| sum * x + c);
    let positive = |x: f64| value(x) > 0.0;
    let between = ends.windows(2).filter(|pair| positive(pair[0]) != positive(pair[1]));
    let mut roots: Vec<f64> = between
        .map(|pair| {
            let (below, above) = bisection(pair[0], pair[1], positive);
            below + (above - below) / 2.0
        })
        .collect();
    // A turning point that touches zero to within rounding.
    let touches = |x: &f64| {
        let size = coefficients.iter().rev().fold(0.0, |sum, c| sum * x.abs() + c.abs());
        value(*x).abs() <= 8.0 * f64::EPSILON * size
    };
    roots.extend(ends[1..ends.len() - 1].iter().copied().filter(touches));
    roots.sort_by(f64::total_cmp);
    roots.dedup_by(|first, second| (*first - *second).abs() <= 1e-7 * (1.0 + second.abs()));
    roots
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_real_roots_are_found_and_no_others() {
        // (x - 1)(x - 2)(x + 3)(x - 0.5)
        let roots = real_roots(&[-3.0, 9.5, -7.0, -0.5, 1.0]);
        assert_eq!(roots.len(), 4, "{roots:?}");
        for (root, expected) in roots.iter().zip([-3.0, 0.5, 1.0, 2.0]) {
            assert!((root - expected).abs() < 1e-12, "{roots:?}");
        }
        for without in [&[1.0, 0.0, 1.0][..], &[5.0], &[0.0, 0.0]] {
            assert!(real_roots(without).is_empty());
        }
    }
}
