//! Tests of `model_exchange/dual`.

use super::*;

#[test]
fn the_derivative_of_an_expression_is_exact() {
    let x = Dual { value: 0.7, slope: 1.0 };
    let y = (x * x - Dual::from(2.0)) / x.cosine() + x.sine();
    let (sin, cos) = (0.7f64.sin(), 0.7f64.cos());
    let expected = 1.4 / cos + (0.49 - 2.0) * sin / (cos * cos) + cos;
    assert!((y.slope - expected).abs() < 1e-15);
}
