//! Unit tests of a section without drive.

use super::*;

#[test]
fn two_half_steps_make_one_step_which_starts_along_the_equation_of_motion_at_any_damping() {
    for zeta in [0.0, 0.006, 0.3, 1.0 - 1e-9, 1.0, 1.0 + 1e-9, 2.5] {
        let oscillator = Section::oscillator(2.0 * zeta);
        let half = oscillator.propagator(1.6);
        let difference = half * half - oscillator.propagator(3.2);
        assert!(difference.norm() < 1e-14, "zeta = {zeta}: {difference}");
        let h = 1e-6;
        let slope = (oscillator.propagator(h) - oscillator.propagator(-h)) / (2.0 * h);
        let expected = Matrix2::new(0.0, 1.0, -1.0, -2.0 * zeta);
        assert!((slope - expected).norm() < 1e-9, "zeta = {zeta}");
    }
}
