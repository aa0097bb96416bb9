//! Activation: the smallest excitation of a 1:1 regime.

use serde::Serialize;

use crate::numerics::{bisection, golden_section};
use crate::orbit::impacts_from_rest;

use super::slow_flow::SlowFlow;
use super::stability::{B_SYMMETRY_BREAKING, impacts_stable};

/// Smallest base amplitudes G, over `b epsilon`, at one detuning (docs/theory.md, eq. 19).
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Activation {
    /// The steady linear response reaches the wall, C = 1. Below, a particle at rest in the middle stays at rest once the start
    /// of the drive is forgotten.
    pub steady_linear: f64,
    /// Impacts begin from rest: the beat after the drive is switched on, as `e = E sin(omega t)`, reaches the wall. Exact.
    pub from_rest: f64,
    /// The same if the base begins at the phase that needs the least. Exact.
    pub from_rest_any_phase: f64,
    /// Some 1:1 motion exists, stable or not.
    pub existence: f64,
    /// A 1:1 motion exists that is stable in its impacts and on the slow flow; it is reached from a moving particle.
    /// Absent where there is none at any G.
    pub stable: Option<f64>,
}

/// Speeds at which a minimum is bracketed.
const GRID: u32 = 600;

impl SlowFlow {
    /// Base amplitude that holds the particle speed `b` at the detuning `sigma`: `sqrt(loss^2 + spring^2)/C`.
    pub fn excitation_at(&self, sigma: f64, b: f64) -> f64 {
        self.loss(b).hypot(self.spring(sigma, b)) / self.manifold.c(b)
    }

    /// The motion at `sigma` and `b` is stable in both senses under the excitation that holds it.
    pub fn stable_at(&self, sigma: f64, b: f64) -> bool {
        let gamma = (-self.loss(b)).atan2(self.spring(sigma, b));
        let g = self.excitation_at(sigma, b);
        impacts_stable(&self.manifold, b) && self.equilibrium(g, b, gamma).slow_flow_stable
    }

    /// A stable 1:1 motion exists at the excitation `g` and the detuning `sigma`.
    pub fn has_stable_motion(&self, g: f64, sigma: f64) -> bool {
        self.equilibria(g, sigma)
            .iter()
            .any(|one| one.impacts_stable && one.slow_flow_stable)
    }

    /// The activation thresholds at the detuning `sigma`; the mass ratio `epsilon` matters only for those from rest.
    pub fn activation(&self, epsilon: f64, sigma: f64) -> Activation {
        let [from_rest, from_rest_any_phase] = impacts_from_rest(epsilon, self.lambda, sigma);
        let g = |b: f64| self.excitation_at(sigma, b);
        // Every B that a smallest G may need: the loss alone makes G grow with B far beyond the fold.
        let highest = 2.0 * B_SYMMETRY_BREAKING;
        let all = smallest((0.0, highest), |_| true, g).unwrap_or(f64::NAN);
        let range = (self.manifold.b_min(), B_SYMMETRY_BREAKING);
        let stable = smallest(range, |b| self.stable_at(sigma, b), g);
        Activation {
            steady_linear: self.lambda.hypot(2.0 * sigma),
            from_rest,
            from_rest_any_phase,
            // Where the two minima are one, rounding does not order them.
            existence: stable.map_or(all, |g| all.min(g)),
            stable,
        }
    }
}

/// Infimum of `f` over the open interval where `wanted` holds.
fn smallest((low, high): (f64, f64), wanted: impl Fn(f64) -> bool, f: impl Fn(f64) -> f64) -> Option<f64> {
    let step = (high - low) / f64::from(GRID);
    let best = (0..GRID)
        .map(|n| low + step * (f64::from(n) + 0.5))
        .filter(|b| wanted(*b))
        .min_by(|one, other| f(*one).total_cmp(&f(*other)))?;
    // The minimum lies inside the neighbouring cells, or at the edge of the region of interest.
    let edge = |end: f64| {
        let end = end.clamp(low, high);
        if wanted(end) {
            end
        } else {
            bisection(best, end, &wanted).0
        }
    };
    let (left, right) = (edge(best - step), edge(best + step));
    let inner = golden_section(left, right, &f);
    Some(f(inner).min(f(left)).min(f(right)))
}
