//! Tests of the oscillator and its rotor.

use super::*;

#[test]
fn a_million_binary_steps_return_to_exactly_zero() {
    let mut oscillator = Oscillator::default();
    let step = TAU / 128.0;
    let wraps = (0..1 << 20).filter(|_| oscillator.advance(step, 1.0)).count();
    assert_eq!(wraps, 1 << 13);
    assert_eq!(oscillator.turns.get(), 0.0);
}

#[test]
fn the_rotor_of_a_turn_has_the_sine_and_cosine_of_its_angle() {
    for n in -100_000..300_000 {
        let turns = f64::from(n) / 100_003.0;
        let (sin, cos) = libm::sincos(TAU * turns);
        let Complex { re, im } = Complex::of_turns(turns);
        // The rounded angle alone is wrong by half a unit in its last place.
        let tolerance = f64::EPSILON * (TAU * turns).abs().max(1.0);
        assert!(
            (re - cos).abs() <= tolerance && (im - sin).abs() <= tolerance,
            "{turns}"
        );
    }
}

#[test]
fn the_rotor_of_a_quarter_turn_is_exact() {
    for (turns, re, im) in [
        (0.0, 1.0, 0.0),
        (0.25, 0.0, 1.0),
        (0.5, -1.0, 0.0),
        (0.75, 0.0, -1.0),
        (1.0, 1.0, 0.0),
    ] {
        assert_eq!(Complex::of_turns(turns), Complex { re, im }, "{turns}");
    }
}
