//! Exact orbits against independent 40-digit references, and against laws they must obey.

use vines_model::{
    Dimensionless,
    orbit::{Orbit, backbone_at_speed, exact_backbone, phase_resonant},
    theory::{Manifold, SlowFlow},
};

mod reference;
use reference::rows;

/// The orbit closest to the row's sigma.
fn nearest(row: &reference::Row) -> Orbit {
    let scene = Dimensionless::new(row.epsilon, row.lambda, row.r, row.g);
    let distance = |orbit: &Orbit| (orbit.sigma - row.sigma).abs();
    phase_resonant(&scene)
        .into_iter()
        .min_by(|one, other| distance(one).total_cmp(&distance(other)))
        .expect("an orbit for every row")
}

#[test]
fn orbits_match_the_references_to_all_their_digits() {
    let (mut state, mut multipliers) = (0f64, 0f64);
    for row in rows() {
        let orbit = nearest(&row);
        for (found, expected) in [(orbit.sigma, row.sigma), (orbit.c, row.c), (orbit.b, row.b)] {
            state = state.max((found - expected).abs());
        }
        for (found, expected) in orbit.multipliers.iter().zip(row.multipliers) {
            multipliers = multipliers.max((found - expected).abs());
        }
        assert_eq!(orbit.stable, row.multipliers[3] < 1.0, "{row:?}");
    }
    println!("largest deviation: sigma, C, B {state:.2e}, multipliers {multipliers:.2e}");
    assert!(state < 1e-10, "the references have ten digits: {state:e}");
    assert!(multipliers < 6e-7, "the references have six digits: {multipliers:e}");
}

#[test]
fn what_is_found_beside_the_references_lies_on_the_unstable_left_branch() {
    let rows = rows();
    for row in &rows {
        let listed = |orbit: &Orbit| {
            rows.iter()
                .filter(|other| (other.epsilon, other.r, other.g) == (row.epsilon, row.r, row.g))
                .any(|other| (other.sigma - orbit.sigma).abs() < 1e-8)
        };
        let scene = Dimensionless::new(row.epsilon, row.lambda, row.r, row.g);
        let b_min = Manifold::new(row.r).b_min();
        for orbit in phase_resonant(&scene).iter().filter(|orbit| !listed(orbit)) {
            assert!(orbit.b < b_min && !orbit.stable, "{orbit:?}");
        }
    }
}

#[test]
fn no_orbit_is_invented_where_the_excitation_is_too_weak() {
    assert_eq!(phase_resonant(&Dimensionless::new(0.0084, 1.43, 0.65, 0.2)), []);
    assert_eq!(phase_resonant(&Dimensionless::new(0.0084, 1.43, 0.65, 0.0)), []);
}

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
