//! Tests of `model_exchange/equations`.

use super::*;

#[test]
fn velocities_come_back_from_reduced_ones() {
    for stuck in [false, true] {
        let instant = Instant {
            primary_mass: 3.0,
            stiffness: 20.0,
            damping: 0.7,
            particle_mass: 0.2,
            signal: 0.1,
            amplitude: 0.02,
            phase: 0.3,
            dq1: -0.4,
            dq2: -0.4,
            stuck,
            ..Instant::default()
        };
        let reduced = instant.reduced_velocities();
        let back = Instant { dq1: 0.0, dq2: 0.0, ..instant }.with_reduced(reduced);
        assert!((back.dq1 + 0.4).abs() < 1e-16 && (back.dq2 + 0.4).abs() < 1e-16);
    }
}
