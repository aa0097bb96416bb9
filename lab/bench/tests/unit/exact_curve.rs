//! Tests of `exact_curve`.

use super::*;

#[test]
fn an_exact_orbit_lies_on_the_curve() {
    let scene = Dimensionless::new(0.0084, 1.43, 0.65, 1.1);
    let curve = ExactCurve::of(&scene);
    let orbits = vines_model::orbit::phase_resonant(&scene);
    let orbit = orbits.iter().find(|orbit| orbit.stable).unwrap();
    let distance = curve.distance(orbit.c, orbit.sigma, orbit.g).unwrap();
    assert!(distance.nearest < 1e-5, "{distance:?}");
    assert!(distance.sigma.unwrap().abs() < 1e-5 && distance.g.unwrap().abs() < 1e-5);
    let off = curve.distance(orbit.c, orbit.sigma + 0.01, orbit.g).unwrap();
    assert!((off.sigma.unwrap() - 0.01).abs() < 1e-5);
    assert!(off.nearest > 1e-3 && off.nearest < 0.01);
}
