//! Guards first-order theory: its identities, the impact sequence, frequency responses and activation, and waveforms.

mod identities;
mod modulation;
#[path = "../reference/mod.rs"]
mod reference;
mod responses;
mod waveforms;

use std::f64::consts::PI;

use vines_model::theory::SlowFlow;

const EPSILON: f64 = 0.0084;
const LAMBDA: f64 = 1.43;
const R: f64 = 0.65;

fn flow() -> SlowFlow {
    SlowFlow::new(LAMBDA, R)
}

/// `(D1 C~, D1 gamma)` at the particle speed `b` and the phase `gamma`, rad (docs/theory.md, eq. 11).
fn rates(flow: &SlowFlow, (g, sigma): (f64, f64), b: f64, gamma: f64) -> [f64; 2] {
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

fn close(one: f64, other: f64, tolerance: f64) {
    let size = 1f64.max(one.abs());
    assert!((one - other).abs() <= tolerance * size, "{one} and {other}");
}
