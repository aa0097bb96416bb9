//! Tests of `predictor`.

use super::*;
use vines_model::Sensor;

fn known(c: f64) -> Known {
    Known { c, g: 1.0 + c * c, sigma: -3.0 + 2.0 * c }
}

fn scene() -> Dimensionless {
    Dimensionless::new(0.0084, 1.43, 0.65, 1.1)
}

#[test]
fn three_points_foresee_a_parabola_exactly() {
    let before = [0.7, 0.65, 0.6].map(known);
    let (g, sigma) = change(Predictor::Previous, &before, 0.55, &scene());
    assert!((g - (known(0.55).g - known(0.6).g)).abs() < 1e-12);
    assert!((sigma + 0.1).abs() < 1e-12);
}

#[test]
fn one_point_foresees_no_change() {
    assert_eq!(change(Predictor::Previous, &[known(0.7)], 0.6, &scene()), (0.0, 0.0));
}

#[test]
fn theory_foresees_the_difference_between_two_levels() {
    let mut scene = scene();
    scene.definition.sensor = Sensor::Q1;
    let (g, sigma) = change(Predictor::Theory, &[known(0.5)], 0.4, &scene);
    let at = |c| backbone_at_level(&scene, c).unwrap().sigma;
    let expected = at(0.4) - at(0.5);
    assert!((sigma - expected).abs() < 1e-12 && g < 0.0);
    // Below the fold the theory has no backbone.
    assert_eq!(change(Predictor::Theory, &[known(0.5)], 0.1, &scene), (0.0, 0.0));
}
