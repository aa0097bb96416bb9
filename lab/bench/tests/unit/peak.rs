//! Tests of `peak`.

use super::*;
use crate::identification::Regime;

#[test]
fn the_peak_is_where_the_drive_at_a_constant_level_is_smallest() {
    // At resonance: drive 1e-3 (1 + 0.02 x), frequency 1 + 1e-3 (-1 + 0.1 x).
    let resonance = |x: f64| Known {
        response: 0.5,
        drive: 1e-3 * (1.0 + 0.02 * x),
        omega: 1.0 + 1e-3 * (-1.0 + 0.1 * x),
    };
    let exact = |value: f64| Estimate { value, uncertainty: 0.0 };
    let point = |x: f64| {
        let Known { response, drive, omega } = resonance(x);
        Held {
            level: response,
            response: exact(response),
            drive: Estimate { value: drive, uncertainty: 1e-7 },
            omega: exact(omega),
            phase_error: exact(x),
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
    let found = peaks(&scans, 1.0)[0];
    let drive = |x: f64| at_phase(&resonance(x), x, 1.0)[0];
    let x = vines_model::numerics::golden_section(-0.2, 0.2, drive);
    assert!((found.phase_error.value - x).abs() < 1e-6, "{found:?}");
    assert!((found.drive.value - drive(x)).abs() < 1e-15 && x < -0.015);
    assert!((found.omega.value - at_phase(&resonance(x), x, 1.0)[1]).abs() < 1e-9);
    // The phase that each drive moves by its own uncertainty.
    let moved = (0..scans.len()).map(|n| {
        let mut scans = scans.clone();
        scans[n][0].drive.value += scans[n][0].drive.uncertainty;
        peaks(&scans, 1.0)[0].phase_error.value - found.phase_error.value
    });
    let expected = moved.map(|one| one * one).sum::<f64>().sqrt();
    assert!(
        (found.phase_error.uncertainty / expected - 1.0).abs() < 5e-3,
        "{found:?}, {expected}"
    );
}
