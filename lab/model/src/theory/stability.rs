//! Stability of the two symmetric impacts per period, on the fast time scale.

use std::f64::consts::PI;

use nalgebra::Complex;

use super::manifold::Manifold;

/// Above this particle speed, `2 pi/(pi^2 - 4)`, the orbit loses its symmetry, whatever r (docs/theory.md, eq. 10).
pub const B_SYMMETRY_BREAKING: f64 = 2.0 * PI / (PI * PI - 4.0);

/// Trace and determinant of the fast half-period map at the particle speed `b`:
/// `2 r + (1 + r)^2 (pi/(2 B) - pi^2/4)` and `r^2` (eq. 9).
pub fn half_period_map(r: f64, b: f64) -> [f64; 2] {
    let trace = 2.0 * r + (1.0 + r).powi(2) * (PI / (2.0 * b) - PI * PI / 4.0);
    [trace, r * r]
}

/// Multipliers of that map.
pub fn half_period_multipliers(r: f64, b: f64) -> [Complex<f64>; 2] {
    let [trace, determinant] = half_period_map(r, b);
    let root = Complex::new(0.25 * trace * trace - determinant, 0.0).sqrt();
    [0.5 * trace + root, 0.5 * trace - root]
}

/// The impacts keep their symmetric 1:1 pattern: `Bmin < B < 2 pi/(pi^2 - 4)` (eq. 10).
pub fn impacts_stable(manifold: &Manifold, b: f64) -> bool {
    manifold.b_min() < b && b < B_SYMMETRY_BREAKING
}

#[cfg(test)]
#[path = "../../tests/unit/stability.rs"]
mod tests;
