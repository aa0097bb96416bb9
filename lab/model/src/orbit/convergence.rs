//! How first-order theory approaches the exact orbits as epsilon shrinks.

use std::f64::consts::LN_2;

use serde::Serialize;

use super::phase_resonant;
use crate::{Dimensionless, numerics::slope, theory::resonant};

/// Theory minus exact orbit at one mass ratio.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Difference {
    /// Mass ratio.
    pub epsilon: f64,
    /// Detuning and amplitude of the exact orbit.
    #[serde(skip)]
    pub exact: [f64; 2],
    /// Of the detuning.
    pub sigma: f64,
    /// Of the amplitude of the response over b.
    #[serde(rename = "C")]
    pub c: f64,
    /// Of the particle speed over `b omega0`.
    #[serde(rename = "B")]
    pub b: f64,
}

/// The study: the differences, and the exponents of epsilon that fit them.
#[derive(Debug, Clone, PartialEq)]
pub struct Convergence {
    /// One row a mass ratio, from the scene's down.
    pub rows: Vec<Difference>,
    /// Exponents for sigma, C and B: slopes of the straight lines that fit the logarithms best.
    pub slopes: [f64; 3],
}

/// Compares the stable resonant solutions of theory and exact orbits at the scene's mass ratio and at this number of halvings of
/// it, with constant lambda, r and G; None where one of them has no stable solution, or there is nothing to fit.
pub fn convergence(scene: &Dimensionless, halvings: u32) -> Option<Convergence> {
    let rows: Vec<Difference> = (0..=halvings)
        .map(|n| {
            let scene = Dimensionless { epsilon: scene.epsilon / 2f64.powi(n as i32), ..*scene };
            let theory = resonant(&scene).into_iter().find(|point| point.stable())?;
            let exact = phase_resonant(&scene)
                .into_iter()
                .filter(|orbit| orbit.stable)
                .min_by(|first, second| (first.b - theory.b).abs().total_cmp(&(second.b - theory.b).abs()))?;
            Some(Difference {
                epsilon: scene.epsilon,
                exact: [exact.sigma, exact.c],
                sigma: theory.sigma - exact.sigma,
                c: theory.c - exact.c,
                b: theory.b - exact.b,
            })
        })
        .collect::<Option<_>>()?;
    // From row to row ln(epsilon) changes by -ln 2.
    let exponent = |of: fn(&Difference) -> f64| {
        let logs: Vec<f64> = rows.iter().map(|row| of(row).abs().ln()).collect();
        -slope(&logs) / LN_2
    };
    let slopes = [exponent(|row| row.sigma), exponent(|row| row.c), exponent(|row| row.b)];
    (halvings > 0).then_some(Convergence { rows, slopes })
}
