//! Guards the exact backbone over the particle speed against the orbits at one frequency.

use vines_model::Dimensionless;
use vines_model::orbit::{backbone_at_speed, exact_backbone};
use vines_model::theory::SlowFlow;

#[test]
fn the_backbone_over_the_speed_passes_through_every_orbit_of_the_backbone_over_the_frequency() {
    for (epsilon, lambda, r) in [(0.0084, 1.43, 0.65), (0.03, 0.4, 0.9), (0.002, 2.5, 0.4)] {
        let scene = Dimensionless::new(epsilon, lambda, r, 1.0);
        let mut compared = 0;
        for n in -300..100 {
            let omega = 1.0 + epsilon * 0.01 * f64::from(n);
            let fold = SlowFlow::new(lambda, r).manifold.b_min();
            for orbit in exact_backbone(&scene, omega).into_iter().filter(|orbit| orbit.b > fold) {
                let [at, c, g] = backbone_at_speed(&scene, orbit.b).unwrap_or_else(|| panic!("{scene:?} {orbit:?}"));
                assert!((at - omega).abs() < 1e-11, "{scene:?} {orbit:?}: {at}");
                assert!(
                    (c - orbit.c).abs() < 1e-9 && (g - orbit.g).abs() < 1e-8,
                    "{orbit:?}: {c} {g}"
                );
                compared += 1;
            }
        }
        assert!(compared > 50, "{compared}");
    }
}
