//! Tests of `forcing`.

use super::*;

#[test]
fn the_series_of_phi_agrees_with_the_quotient() {
    for angle in 0..16 {
        for (size, error) in [(0.5, 1e-15), (0.032, 1e-14), (0.031, 1e-14), (1e-3, 1e-12)] {
            let z = Complex64::from_polar(size, f64::from(angle) * 0.4);
            let quotient = (z.exp() - 1.0) / z;
            assert!((phi(z) - quotient).norm() < error, "{size}");
        }
    }
}
