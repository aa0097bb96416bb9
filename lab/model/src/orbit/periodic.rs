//! A periodic motion of any pattern, its stability, and the Newton iteration that finds it.

use nalgebra::{Complex, Matrix4, Matrix6, SVector, Vector4};
use serde::Serialize;

use super::condition::{Condition, Row};
use super::pattern::{ImpactPattern, Returned, Unknowns, follow, wrapped};
use super::{bounce::Bounce, impact_map::ImpactMap};
use crate::Dimensionless;

/// An exact periodic motion.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Periodic {
    /// Base amplitude over `b epsilon`.
    #[serde(rename = "G")]
    pub g: f64,
    /// Detuning `(Omega - 1)/epsilon`.
    pub sigma: f64,
    /// Amplitude of the response's harmonic at the base's frequency.
    #[serde(rename = "C")]
    pub c: f64,
    /// Phase of that harmonic relative to the reference, rad, in (-pi, pi].
    pub gamma: f64,
    /// Speed of the particle over `b omega0`, averaged over time.
    #[serde(rename = "B")]
    pub b: f64,
    /// Its pattern.
    #[serde(rename = "shape")]
    pub pattern: ImpactPattern,
    /// The states just after the impacts of the map.
    pub bounces: Vec<Bounce>,
    /// Multipliers (real, imaginary) of the map, by rising modulus; those of a mirrored pattern are for half of its period.
    pub multipliers: [[f64; 2]; 4],
    /// All of them are inside the unit circle.
    pub stable: bool,
    #[serde(skip)]
    pub(super) durations: Vec<f64>,
    /// Derivative of the map by the state.
    #[serde(skip)]
    pub(super) monodromy: Matrix4<f64>,
}

/// Size of the last Newton correction, and that from which on a correction that does not shrink is rounding: small isolas are nearly singular.
const CONVERGED: f64 = 1e-12;
const ROUNDING: f64 = 1e-10;
const ROUNDS: usize = 30;
/// Closing error of a motion that is known in closed form, and is not one with an earlier contact.
const CLOSED: f64 = 1e-8;

impl Periodic {
    /// The motion with the pattern `pattern` near the unknowns `guess` that satisfies both conditions, by Newton's method with
    /// analytic derivatives; None if the iteration leaves the pattern or does not converge.
    pub fn find(
        scene: &Dimensionless,
        pattern: &ImpactPattern,
        guess: &Unknowns,
        conditions: [Condition; 2],
    ) -> Option<Self> {
        let x = newton(scene, pattern, *guess, |x, returned| {
            conditions.map(|one| one.value(scene, pattern, x, returned))
        })?;
        Self::at(scene, pattern, &x)
    }

    /// The unknowns of this motion: (phase, q1, q1', q2') after its first impact, sigma, G.
    pub fn unknowns(&self) -> Unknowns {
        let Bounce { phase, q1, dq1, dq2, .. } = self.bounces[0];
        Unknowns::from([phase, q1, dq1, dq2, self.sigma, self.g])
    }

    /// The motion at unknowns that may satisfy the closing equations; None if they do not.
    pub(super) fn closed(scene: &Dimensionless, pattern: &ImpactPattern, x: &Unknowns) -> Option<Self> {
        let returned = follow(scene, pattern, x).filter(|returned| returned.residual.norm() < CLOSED)?;
        Some(Self::of(pattern, x, returned))
    }

    /// The motion at unknowns that satisfy the closing equations.
    pub(super) fn at(scene: &Dimensionless, pattern: &ImpactPattern, x: &Unknowns) -> Option<Self> {
        Some(Self::of(pattern, x, follow(scene, pattern, x)?))
    }

    fn of(pattern: &ImpactPattern, x: &Unknowns, returned: Returned) -> Self {
        let mut multipliers: [Complex<f64>; 4] = returned.monodromy.complex_eigenvalues().into();
        multipliers.sort_unstable_by(|one, other| one.norm().total_cmp(&other.norm()));
        let total: f64 = returned.durations.iter().sum();
        let travelled: f64 = returned
            .bounces
            .iter()
            .zip(&returned.durations)
            .map(|(bounce, duration)| bounce.dq2.abs() * duration)
            .sum();
        Self {
            g: x[5],
            sigma: x[4],
            c: returned.s.norm(),
            gamma: wrapped(returned.s.arg()),
            b: travelled / total,
            pattern: pattern.clone(),
            bounces: returned.bounces,
            durations: returned.durations,
            monodromy: returned.monodromy,
            stable: multipliers[3].norm() < 1.0,
            multipliers: multipliers.map(|one| [one.re, one.im]),
        }
    }

    /// How far the second half of the motion is from repeating the first one or its mirror image; None for a pattern that is not
    /// the double of another. It changes sign where a branch passes the motion that it doubles.
    pub(super) fn halves_apart(&self) -> Option<Vector4<f64>> {
        let half = self.pattern.halved()?;
        let (first, middle) = (&self.bounces[0], &self.bounces[half.walls.len()]);
        Some(first.apart(middle, half.turn(), half.sign()))
    }

    /// Numbers that a motion shares with its mirror image and with itself one period later.
    pub(super) fn invariants(&self) -> SVector<f64, 5> {
        let (sine, cosine) = self.gamma.sin_cos();
        [self.sigma, self.c * cosine, self.c * sine, self.b, self.g].into()
    }

    /// A complex pair of multipliers is on the unit circle.
    pub(super) fn on_circle_in_pairs(&self) -> bool {
        let mut pairs = self.multipliers.iter().filter(|[_, im]| im.abs() > 1e-3);
        pairs.any(|[re, im]| (re.hypot(*im) - 1.0).abs() < 1e-6)
    }

    /// No multiplier is outside the unit circle, except for those that a bifurcation places on it.
    pub fn bounds_stability(&self) -> bool {
        self.moduli()[3] < 1.0 + 1e-5
    }

    /// Moduli of the multipliers, ascending.
    pub fn moduli(&self) -> [f64; 4] {
        self.multipliers.map(|[re, im]| re.hypot(im))
    }

    /// Largest Lyapunov exponent per period of the base.
    pub(crate) fn exponent(&self) -> f64 {
        2.0 * self.moduli()[3].ln() / f64::from(self.pattern.half_periods)
    }

    /// (tau, q1, q1', q2, q2') at `points` equal steps over one period of the base, from a passage of the base through
    /// zero, upwards; dimensionless. The impacts fall between the points.
    pub fn motion(&self, scene: &Dimensionless, points: usize) -> Vec<[f64; 5]> {
        let omega = 1.0 + scene.epsilon * self.sigma;
        let map = ImpactMap::new(scene, omega, self.g);
        let turn = std::f64::consts::TAU;
        (0..points)
            .filter_map(|n| {
                let phase = turn * n as f64 / points as f64;
                let [q1, dq1, q2, dq2] = self.state_at(&map, phase)?;
                Some([phase / omega, q1, dq1, q2, dq2])
            })
            .collect()
    }

    /// (q1, q1', q2, q2') where the base is at `phase`, rad, in the motion's first period.
    fn state_at(&self, map: &ImpactMap, phase: f64) -> Option<[f64; 4]> {
        // The bounces of the whole period; a mirrored pattern's other half is minus the first.
        let half = self.pattern.half_periods as f64 * std::f64::consts::PI;
        let mirror = |bounce: &Bounce| Bounce {
            phase: bounce.phase + half,
            q1: -bounce.q1,
            dq1: -bounce.dq1,
            dq2: -bounce.dq2,
            wall: -bounce.wall,
        };
        let mut bounces = self.bounces.clone();
        let mut period = half;
        if self.pattern.mirrored {
            bounces.extend(self.bounces.iter().map(mirror));
            period = 2.0 * half;
        }
        let since = |bounce: &Bounce| (phase - bounce.phase).rem_euclid(period);
        let last = bounces
            .iter()
            .min_by(|one, other| since(one).total_cmp(&since(other)))?;
        Some(map.state(last, since(last) / map.oscillator.omega))
    }

    /// (q1, q1', q2, q2') where the base passes through zero, upwards: a start for the plant.
    pub fn start(&self, scene: &Dimensionless) -> Option<[f64; 4]> {
        let map = ImpactMap::new(scene, 1.0 + scene.epsilon * self.sigma, self.g);
        self.state_at(&map, 0.0)
    }
}

/// Newton's method for the four closing equations and two more.
pub(super) fn newton(
    scene: &Dimensionless,
    pattern: &ImpactPattern,
    mut x: Unknowns,
    conditions: impl Fn(&Unknowns, &Returned) -> [Row; 2],
) -> Option<Unknowns> {
    let mut last = f64::INFINITY;
    for _ in 0..ROUNDS {
        let returned = follow(scene, pattern, &x)?;
        let mut matrix = Matrix6::zeros();
        let mut right = SVector::<f64, 6>::zeros();
        matrix.fixed_rows_mut::<4>(0).copy_from(&returned.by);
        right.fixed_rows_mut::<4>(0).copy_from(&returned.residual);
        for (n, (value, row)) in conditions(&x, &returned).into_iter().enumerate() {
            matrix.set_row(4 + n, &row);
            right[4 + n] = value;
        }
        let correction = matrix.lu().solve(&right)?;
        let size = correction.norm();
        if !size.is_finite() || size > 1e3 {
            return None;
        }
        x -= correction;
        if size < CONVERGED || size < ROUNDING && size > 0.5 * last {
            return Some(x);
        }
        last = size;
    }
    None
}
