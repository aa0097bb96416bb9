//! Activation: the smallest excitation of a 1:1 regime, and of impacts from rest by the exact linear response after the drive is switched
//! on (docs/theory.md, eq. 19).

use std::f64::consts::TAU;

use nalgebra::Complex;
use serde::Serialize;

use super::slow_flow::{B_SYMMETRY_BREAKING, Equilibrium, SlowFlow};
use crate::numerics::{bisection, equally_spaced, golden_section};
use crate::oscillator::section;

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
const SPEEDS_SEARCHED: u32 = 600;

impl SlowFlow {
    /// A stable 1:1 motion exists at the excitation `g` and the detuning `sigma`.
    pub fn has_stable_motion(&self, g: f64, sigma: f64) -> bool {
        self.equilibria(g, sigma).iter().any(Equilibrium::is_stable)
    }

    /// The activation thresholds at the detuning `sigma`; the mass ratio `epsilon` matters only for those from rest.
    pub fn activation(&self, epsilon: f64, sigma: f64) -> Activation {
        let [from_rest, from_rest_any_phase] = impacts_from_rest(epsilon, self.lambda, sigma);
        // What holds the particle speed B.
        let g = |b: f64| self.loss(b).hypot(self.spring(sigma, b)) / self.manifold.c(b);
        let is_stable = |b: f64| self.equilibrium((g(b), sigma), b).is_stable();
        // Every B that a smallest G may need: the loss alone makes G grow with B far beyond the fold.
        let highest = 2.0 * B_SYMMETRY_BREAKING;
        let all = smallest((0.0, highest), |_| true, g).unwrap_or(f64::NAN);
        let range = (self.manifold.b_min(), B_SYMMETRY_BREAKING);
        let stable = smallest(range, is_stable, g);
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
    let step = (high - low) / f64::from(SPEEDS_SEARCHED);
    let best = (0..SPEEDS_SEARCHED)
        .map(|n| low + step * (f64::from(n) + 0.5))
        .filter(|b| wanted(*b))
        .min_by(|first, second| f(*first).total_cmp(&f(*second)))?;
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

/// Points per period at which the largest displacement is looked for.
const POINTS_PER_PERIOD: f64 = 32.0;
/// Beats that are searched; the first is the largest but for the phase of the fast motion in it.
const BEATS: f64 = 3.0;
/// Decay times after which the start is forgotten, and most periods of the search.
const FORGOTTEN: f64 = 12.0;
const LONGEST_SEARCH: f64 = 20_000.0;

/// The smallest G at which the primary mass, at rest until the drive is switched on, moves by the half-width of the cavity: for a base that
/// begins as `sin(Omega tau)`, and for the phase of the base at the beginning that needs the least. Another phase
/// is a jump of the base, which the damper passes on as an impulse.
fn impacts_from_rest(epsilon: f64, lambda: f64, sigma: f64) -> [f64; 2] {
    let (zeta, omega) = (epsilon * lambda / 2.0, 1.0 + epsilon * sigma);
    let oscillator = section(epsilon * lambda);
    let steady = oscillator.steady(omega)[0] * epsilon;
    if !steady.is_finite() {
        // Undamped resonance: the response grows beyond all bounds.
        return [0.0; 2];
    }
    // q1 per G is Im(u exp(i phase)) for a base that begins at that phase.
    let u = |t: f64| {
        let free = oscillator.propagator(t);
        let kick = epsilon * epsilon * lambda * free[(0, 1)];
        steady * (Complex::from_polar(1.0, omega * t) - Complex::new(free[(0, 0)], omega * free[(0, 1)])) + kick
    };
    let end = (BEATS * TAU / (epsilon * sigma).abs())
        .min(FORGOTTEN / zeta)
        .clamp(TAU, LONGEST_SEARCH * TAU);
    let step = TAU / POINTS_PER_PERIOD;
    let largest = |size: &dyn Fn(f64) -> f64| {
        let times = equally_spaced(0.0, end, (end / step) as usize + 2);
        let sizes: Vec<(f64, f64)> = times.map(|t| (t, size(t))).collect();
        let most = sizes.iter().fold(0.0, |most: f64, size| most.max(size.1));
        // Between two points a sine of that height grows by less than from one to the next.
        let near = sizes.iter().filter(|size| size.1 > step.cos() * most);
        let peaks = near.map(|(t, _)| size(golden_section((t - step).max(0.0), t + step, |t| -size(t))));
        peaks.fold(steady.norm(), f64::max)
    };
    [1.0 / largest(&|t| u(t).im.abs()), 1.0 / largest(&|t| u(t).norm())]
}
