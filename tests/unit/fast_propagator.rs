//! Tests of `fast/propagator`.

use super::*;
use crate::base_motion::BaseMotion;
use crate::segment::Segment;

#[test]
fn a_short_step_agrees_with_the_closed_form_for_every_drive() {
    for zeta in [0.0, 0.006, 0.5, 1.0, 3.0] {
        let oscillator = Oscillator::new(1.0, 1.0, 2.0 * zeta);
        let t = LONGEST / oscillator.fastest;
        let mut step = ShortStep::from(t);
        for omega in [0.0, 0.3, -0.3, 1.0, oscillator.fastest] {
            let drive = Drive { signal: [0.3, -0.2, 0.1, 0.7], ..Drive::harmonic(0.4, omega) };
            let base = BaseMotion { drive, ..BaseMotion::default() };
            let [x, v, ..] = Segment::new(&oscillator, base, (0.7, -0.4)).derivatives(t);
            let start = Point { y: 0.7 - 0.3, dy: -0.4 + 0.2, phasor: (1.0, 0.0) };
            let response = step.response(&oscillator, omega);
            let mut increment = step.increment(&response, drive.amplitude, &start);
            increment.bend(drive.signal, &step);
            let (got, dgot) = (0.7 + increment.y - 0.2 * t, -0.4 + increment.dy);
            assert!((got - x).abs() < 2e-15, "{zeta} {omega}: {got} {x}");
            assert!(
                (dgot - v).abs() < 2e-15 * oscillator.fastest,
                "{zeta} {omega}: {dgot} {v}"
            );
        }
    }
}
