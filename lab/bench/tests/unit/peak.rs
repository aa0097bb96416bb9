//! Tests of `peak`.

use super::*;
use crate::identification::Regime;

#[test]
fn the_peak_is_where_the_drive_at_a_constant_level_is_smallest() {
    // At resonance: G = 1 + 0.02 x, sigma = -1 + 0.1 x.
    let resonance = |x: f64| Known { c: 0.5, g: 1.0 + 0.02 * x, sigma: -1.0 + 0.1 * x };
    let point = |x: f64| {
        let Known { c, g, sigma } = resonance(x);
        Point {
            level: c,
            c,
            sigma,
            g,
            phase_error_deg: x.to_degrees(),
            u_c: 0.0,
            u_sigma: 0.0,
            u_g: 1e-4,
            u_phase_deg: 0.0,
            periods: 10.0,
            averaged: 8,
            settled: true,
            reached: true,
            regime: Regime::Symmetric,
            regime_by_impacts: None,
            tone: None,
        }
    };
    let scans = PHASES.map(|x| vec![point(x)]);
    let found = peaks(&scans, &Dimensionless::new(1e-12, 1.43, 0.65, 1.1))[0];
    let drive = |x: f64| at_phase(&resonance(x), x, 0.0)[0];
    let x = vines_model::numerics::golden_section(-0.2, 0.2, drive);
    assert!((found.phase_error_deg.to_radians() - x).abs() < 1e-6, "{found:?}");
    assert!((found.g - drive(x)).abs() < 1e-12 && x < -0.015);
    assert!((found.sigma - at_phase(&resonance(x), x, 0.0)[1]).abs() < 1e-6);
    // The phase that each drive moves by its own uncertainty.
    let moved = (0..scans.len()).map(|n| {
        let mut scans = scans.clone();
        scans[n][0].g += scans[n][0].u_g;
        peaks(&scans, &Dimensionless::new(1e-12, 1.43, 0.65, 1.1))[0].phase_error_deg - found.phase_error_deg
    });
    let expected = moved.map(|one| one * one).sum::<f64>().sqrt();
    assert!(
        (found.u_phase_deg / expected - 1.0).abs() < 5e-3,
        "{found:?}, {expected}"
    );
}
