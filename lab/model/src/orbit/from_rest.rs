//! Impacts from rest: the exact linear response after the drive is switched on (docs/theory.md, eq. 19).

use std::f64::consts::TAU;

use nalgebra::Complex;

use super::oscillator::Oscillator;
use crate::numerics::{equally_spaced, golden_section};

/// Points per period at which the largest displacement is looked for.
const POINTS: f64 = 32.0;
/// Cosine of half the phase between two points, rounded down.
const ROUNDED: f64 = 0.99;
/// Beats that are searched; the first is the largest but for the phase of the fast motion in it.
const BEATS: f64 = 3.0;
/// Decay times after which the start is forgotten, and most periods of the search.
const FORGOTTEN: f64 = 12.0;
const LONGEST: f64 = 20_000.0;

/// The smallest G at which the primary mass, at rest until the drive is switched on, moves by the half-width of the cavity: for a base that
/// begins as `sin(Omega tau)`, and for the phase of the base at the beginning that needs the least. Another phase than that of the sine
/// is a jump of the base, which the damper passes on as an impulse.
pub fn impacts_from_rest(epsilon: f64, lambda: f64, sigma: f64) -> [f64; 2] {
    let (zeta, omega) = (epsilon * lambda / 2.0, 1.0 + epsilon * sigma);
    let oscillator = Oscillator::new(zeta);
    let steady = oscillator.base_force(omega) * oscillator.compliance(omega) * epsilon;
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
        .clamp(TAU, LONGEST * TAU);
    let step = TAU / POINTS;
    let largest = |size: &dyn Fn(f64) -> f64| {
        let times = equally_spaced(0.0, end, (end / step) as usize + 2);
        let sizes: Vec<(f64, f64)> = times.map(|t| (t, size(t))).collect();
        let most = sizes.iter().fold(0.0, |most: f64, one| most.max(one.1));
        // Between two points a sine of that height grows by no more than this.
        let near = sizes.iter().filter(|one| one.1 > ROUNDED * most);
        let peaks = near.map(|(t, _)| size(golden_section((t - step).max(0.0), t + step, |t| -size(t))));
        peaks.fold(steady.norm(), f64::max)
    };
    [1.0 / largest(&|t| u(t).im.abs()), 1.0 / largest(&|t| u(t).norm())]
}
