//! Tests of the gains.

use super::*;

#[test]
fn the_closed_loop_has_a_triple_root() {
    let (bandwidth, delta) = (5.5, 0.33);
    let gains = Gains::from_bandwidth(bandwidth, delta);
    let s = -(bandwidth + delta) / 3.0;
    let [c2, c1, c0] = [
        bandwidth + delta,
        bandwidth * (delta + gains.proportional),
        bandwidth * gains.integral,
    ];
    for residual in [
        s * s * s + c2 * s * s + c1 * s + c0,
        3.0 * s * s + 2.0 * c2 * s + c1,
        6.0 * s + 2.0 * c2,
    ] {
        assert!(residual.abs() < 1e-12, "{residual}");
    }
}

#[test]
fn the_phase_margin_is_above_50_degrees_and_zero_with_the_delay_that_uses_it_up() {
    for damping in [0.0, 0.01, 0.06, 0.3] {
        let gains = Gains::from_bandwidth(1.0, damping);
        let margin = gains.phase_margin(1.0, damping, 0.0);
        assert!((50.0..75.0).contains(&margin.to_degrees()), "{damping}: {margin}");
        // The open loop at the frequency of gain 1, whose phase a delay of 1 s shifts by that frequency.
        let w = margin - gains.phase_margin(1.0, damping, 1.0);
        let open = (gains.proportional * w).hypot(gains.integral) / (w * w.hypot(damping) * w.hypot(1.0));
        assert!((open - 1.0).abs() < 1e-9, "{open}");
        assert!(gains.phase_margin(1.0, damping, margin / w).abs() < 1e-9);
    }
}

#[test]
fn gains_are_positive_for_every_damping() {
    for delta in [0.0, 0.1, 1.0, 10.0, 1e3] {
        let gains = Gains::from_bandwidth(1.0, delta);
        assert!(gains.proportional > 0.0 && gains.integral > 0.0);
    }
}
