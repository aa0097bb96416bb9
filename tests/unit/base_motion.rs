//! Tests of `base_motion`.

use super::*;

#[test]
fn the_phase_stays_within_one_turn_whatever_the_step() {
    for omega in [-7.0, -1e-20, 0.0, 1e-20, 0.3, 55.0, 1e9] {
        for t in [1e-12, 0.1, 1.0, 1e3, 1e6] {
            let base = BaseMotion { drive: Drive::harmonic(1.0, omega), phase: Phase::default() };
            let phase = base.after(t).phase.radians();
            assert!((0.0..TAU.0).contains(&phase), "{omega} {t}: {phase}");
        }
    }
}

#[test]
fn a_million_turns_in_one_step_and_in_a_million_agree() {
    // 2^-4 is exact, so that both runs mean the same instants.
    let drive = Drive::harmonic(1.0, 1.000_1);
    let one = BaseMotion { drive, phase: Phase(0.5, 0.0) }.after(62_500.0);
    let mut many = BaseMotion { drive, phase: Phase(0.5, 0.0) };
    for _ in 0..1_000_000 {
        many = many.after(0.062_5);
    }
    let difference = libm::remainder(one.phase.radians() - many.phase.radians(), TAU.0);
    assert!(difference.abs() < 1e-12, "{difference:e}");
}

#[test]
fn sevenths_of_a_turn_add_up_to_turns_without_losing_digits() {
    let omega = 0.990_417;
    let t = TAU.0 / omega / 7.0;
    let (angle, error) = product(omega, t);
    let (seven, rounding) = product(7.0, angle);
    // What seven steps are longer than a turn.
    let surplus = ((seven - TAU.0) + rounding) + (7.0 * error - TAU.1);
    for sign in [1.0, -1.0] {
        let mut base = BaseMotion {
            drive: Drive::harmonic(1.0, sign * omega),
            phase: Phase::default(),
        };
        for turn in 1..=100_000 {
            for _ in 0..7 {
                base = base.after(t);
            }
            let phase = base.phase.radians();
            assert!((0.0..TAU.0).contains(&phase), "{turn}: {phase}");
            let lost = libm::remainder(phase, TAU.0) - sign * surplus * f64::from(turn);
            assert!(lost.abs() < 1e-15, "{turn}: {lost:e}");
        }
    }
}

#[test]
fn the_phase_after_turns_is_the_remainder_of_a_division_by_one_turn() {
    for turns in 1..3000 {
        for beside in [-1, 0, 1] {
            let angle = f64::from_bits((f64::from(turns) * TAU.0).to_bits().wrapping_add_signed(beside));
            for omega in [-1.0, 1.0] {
                let rest = libm::fmod(omega * angle, TAU.0);
                let whole = libm::round((omega * angle - rest) / TAU.0);
                let expected = Phase(0.5, 0.0).rotated(Sum { value: rest, error: -whole * TAU.1 });
                assert_eq!(
                    Phase(0.5, 0.0).advanced(omega, angle),
                    expected,
                    "{turns} {beside} {omega}"
                );
            }
        }
    }
}

#[test]
fn the_signal_seen_later_is_the_same_signal() {
    let base = BaseMotion {
        drive: Drive { signal: [1.0, -2.0, 0.5, 0.25], ..Drive::default() },
        phase: Phase::default(),
    };
    let direct = base.after(1.5).drive.signal[0];
    let in_two = base.after(0.7).after(0.8).drive.signal[0];
    assert!((direct - (1.0 - 3.0 + 0.5 * 2.25 + 0.25 * 3.375)).abs() < 1e-15);
    assert!((direct - in_two).abs() < 1e-15);
}
