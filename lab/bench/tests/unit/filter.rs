//! Tests of `filter`.

use super::*;

/// Amplitude and lag of the output for a sine of frequency 1.
fn response(cut_off: f64) -> (f64, f64) {
    let mut filter = LowPass::new(cut_off);
    let dt = std::f64::consts::TAU / 1000.0;
    let (mut sine, mut cosine) = (0.0, 0.0);
    for n in 0..20_000 {
        let t = f64::from(n) * dt;
        let output = filter.pass(t.sin(), dt);
        if n >= 19_000 {
            sine += output * t.sin() / 500.0;
            cosine += output * t.cos() / 500.0;
        }
    }
    (sine.hypot(cosine), -cosine.atan2(sine))
}

#[test]
fn a_sine_passes_as_the_transfer_function_says() {
    for cut_off in [0.5, 1.0, 3.0, 20.0] {
        let (amplitude, lag) = response(cut_off);
        let x: f64 = 1.0 / cut_off;
        assert!((amplitude - 1.0 / (1.0 + x.powi(4)).sqrt()).abs() < 1e-4, "{cut_off}");
        assert!((lag - (SQRT_2 * x).atan2(1.0 - x * x)).abs() < 1e-4, "{cut_off}: {lag}");
    }
}
