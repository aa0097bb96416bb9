//! First-order theory.

mod identities;
mod modulation;
#[path = "../reference/mod.rs"]
mod reference;
mod responses;
mod waveforms;

use vines_model::theory::SlowFlow;

const EPSILON: f64 = 0.0084;
const LAMBDA: f64 = 1.43;
const R: f64 = 0.65;

fn flow() -> SlowFlow {
    SlowFlow::new(LAMBDA, R)
}

fn close(one: f64, other: f64, tolerance: f64) {
    let size = 1f64.max(one.abs());
    assert!((one - other).abs() <= tolerance * size, "{one} and {other}");
}
