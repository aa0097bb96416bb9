//! Tests of `statistics`.

use super::*;

#[test]
fn four_numbers_have_their_mean_and_deviation() {
    let values = [1.0, 3.0, 5.0, 7.0];
    assert_eq!(mean(values), 4.0);
    assert_eq!(mean_square(values), 21.0);
    assert!((standard_deviation(&values) - 5f64.sqrt()).abs() < 1e-15);
    assert_eq!(range((2.0, 2.0), values), (1.0, 7.0));
    assert!(mean([]).is_nan());
}

#[test]
fn both_ends_are_included() {
    assert!(equally_spaced(1.0, 2.0, 5).eq([1.0, 1.25, 1.5, 1.75, 2.0]));
    assert!(equally_spaced(1.0, 2.0, 1).eq([1.0]));
}

#[test]
fn third_differences_see_noise_and_no_cubic() {
    let cubic = |n: usize| 1e-3 * (n as f64).powi(2) - 2.0;
    let smooth: Vec<f64> = (0..200).map(cubic).collect();
    assert!(noise(&smooth) < 1e-12);
    // Alternating signs: every third difference is eight times the amplitude.
    let rough: Vec<f64> = (0..200)
        .map(|n| cubic(n) + 0.1 * f64::from(1 - 2 * (n as i32 % 2)))
        .collect();
    assert!((noise(&rough) - 0.8 / 20f64.sqrt()).abs() < 1e-9);
    assert_eq!(noise(&[1.0; 5]), 0.0);
}

#[test]
fn a_line_has_its_slope() {
    assert!((slope(&[1.0, 1.5, 2.0, 2.5]) - 0.5).abs() < 1e-15);
    assert_eq!(slope(&[0.0, 1.0, 0.0]), 0.0);
}
