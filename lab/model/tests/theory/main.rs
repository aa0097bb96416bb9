//! Guards first-order theory: its identities, the impact sequence, frequency responses and activation, and waveforms.

#[path = "../common/mod.rs"]
mod common;
mod identities;
mod motions;
#[path = "../reference/mod.rs"]
mod reference;
mod responses;
mod walk;

use std::f64::consts::PI;

use vines_model::theory::SlowFlow;

use common::close;

const EPSILON: f64 = 0.0084;
const LAMBDA: f64 = 1.43;
const R: f64 = 0.65;
/// Excitations and detunings with one to four equilibria.
const DRIVES: [(f64, f64); 6] = [
    (1.1, -1.0),
    (1.1, -1.5),
    (1.3, 0.2),
    (1.6, -0.8),
    (0.9, -1.2),
    (1.1, 3.0),
];

fn flow() -> SlowFlow {
    SlowFlow::new(LAMBDA, R)
}

/// `(D1 C~, D1 gamma)` at the particle speed `b` and the phase `gamma`, rad (docs/theory.md, eq. 11).
fn rates(flow: &SlowFlow, (g, sigma): (f64, f64), [b, gamma]: [f64; 2]) -> [f64; 2] {
    let c = flow.manifold.c(b);
    [
        -flow.loss(b) - g * c * gamma.sin(),
        flow.free_detuning(b) - g * gamma.cos() / (2.0 * c) - sigma,
    ]
}

/// Trace and determinant of the fast half-period map at the particle speed `b`:
/// `2 r + (1 + r)^2 (pi/(2 B) - pi^2/4)` and `r^2` (docs/theory.md, eq. 9).
fn half_period_map(r: f64, b: f64) -> [f64; 2] {
    let trace = 2.0 * r + (1.0 + r).powi(2) * (PI / (2.0 * b) - PI * PI / 4.0);
    [trace, r * r]
}

/// Columns of the Jacobian of a map of the plane, by central differences.
fn jacobian(at: [f64; 2], map: impl Fn([f64; 2]) -> [f64; 2]) -> [[f64; 2]; 2] {
    const H: f64 = 1e-6;
    [[H, 0.0], [0.0, H]].map(|h| {
        let [plus, minus] = [1.0, -1.0].map(|sign| map([0, 1].map(|i| at[i] + sign * h[i])));
        [0, 1].map(|i| (plus[i] - minus[i]) / (2.0 * H))
    })
}
