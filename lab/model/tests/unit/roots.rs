//! Tests of `roots`.

use super::*;

#[test]
fn a_small_root_beside_a_large_one_keeps_its_digits() {
    let [large, small] = quadratic(1e-12, 1.0, -1.0).unwrap();
    assert!((small - (1.0 - 1e-12)).abs() < 1e-15);
    assert!((large + 1e12).abs() < 2.0);
}

#[test]
fn both_roots_are_continuous_where_the_linear_coefficient_changes_sign() {
    let above = quadratic(1.0, 1e-9, -1.0).unwrap();
    let below = quadratic(1.0, -1e-9, -1.0).unwrap();
    assert!((above[0] - below[0]).abs() < 1e-8 && (above[1] - below[1]).abs() < 1e-8);
}

#[test]
fn bisection_ends_between_neighbouring_numbers() {
    let (a, b) = bisection(1.0, 2.0, |x| x * x > 2.0);
    assert!(a * a <= 2.0 && b * b > 2.0 && b - a < 3e-16);
    let (b, a) = bisection(2.0, 1.0, |x| x * x > 2.0);
    assert!(a * a <= 2.0 && b * b > 2.0 && b - a < 3e-16);
}

#[test]
fn bisection_stops_at_the_width_or_at_an_error() {
    let (a, b) = try_bisection(0.0, 1.0, 0.1, |x| Ok::<_, ()>(x < 0.3)).unwrap();
    assert!(a < 0.3 && b >= 0.3 && b - a <= 0.1);
    assert_eq!(try_bisection(0.0, 1.0, 0.1, |_| Err("no")), Err("no"));
}

#[test]
fn the_minimum_of_a_parabola_is_found() {
    assert!((golden_section(-1.0, 2.0, |x| (x - 0.3).powi(2)) - 0.3).abs() < 1e-7);
}
