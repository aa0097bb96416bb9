//! Tests of `drift`.

use super::*;

#[test]
fn without_drift_a_flight_has_the_detuning_and_the_drive_of_the_backbone() {
    let flow = SlowFlow::new(1.43, 0.65);
    for c in [0.2, 0.45, 0.7] {
        let b = flow.manifold.b(c, BranchSide::Right).unwrap();
        let [sigma, g] = flow.flight(c, b, 0.0);
        let backbone = flow.backbone_at(b);
        assert!((sigma - backbone.sigma).abs() < 1e-12, "{sigma} {}", backbone.sigma);
        assert!((g - backbone.g).abs() < 1e-12, "{g} {}", backbone.g);
    }
}
