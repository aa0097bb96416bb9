//! Tests of `estimate`.

use super::*;

#[test]
fn students_factor_is_that_of_the_tables() {
    // t(0.975) of 4, 10 and 30 degrees of freedom: 2.776, 2.228, 2.042.
    for (degrees, quantile) in [(4.0, 2.776), (10.0, 2.228), (30.0, 2.042)] {
        assert!((student_factor(degrees) * NORMAL / quantile - 1.0).abs() < 0.01);
    }
}

#[test]
fn a_mean_has_the_uncertainty_of_the_textbook() {
    let mean = Estimate::mean(&[1.0, 3.0, 5.0, 7.0, 9.0]);
    assert!((mean.value - 5.0).abs() < 1e-12);
    // The standard deviation is sqrt(10), for four degrees of freedom.
    assert!((mean.uncertainty - (10f64 / 5.0).sqrt() * student_factor(4.0)).abs() < 1e-9);
}

#[test]
fn a_wandering_mean_is_less_certain_than_one_of_independent_values() {
    // Each value repeated four times has a quarter of the independent ones.
    let values: Vec<f64> = (0..200).map(|n| f64::from((n / 4 * 37) % 50) - 24.5).collect();
    let fit = Regression::fit(&[vec![1.0; 200]], &values, &[], 3.0).unwrap();
    let independent = 50f64.mul_add(50.0, -1.0) / 12.0 / 200.0;
    let ratio = fit.estimate(&[1.0]).uncertainty / independent.sqrt();
    assert!((1.8..3.0).contains(&ratio), "{ratio}");
}

#[test]
fn a_known_noise_is_the_least_uncertainty_and_a_prior_narrows_it() {
    let columns = [vec![1.0; 8], (0..8).map(f64::from).collect()];
    let values: Vec<f64> = (0..8).map(|n| 2.0 + 0.5 * f64::from(n)).collect();
    let fit = Regression::fit(&columns, &values, &[], 0.1).unwrap();
    assert!((fit.coefficient(1) - 0.5).abs() < 1e-12 && fit.excess < 1e-9);
    let free = fit.estimate(&[0.0, 1.0]).uncertainty;
    assert!((free - 0.1 / 42f64.sqrt()).abs() < 1e-12);
    let prior = Prior { coefficient: 1, value: 0.5, uncertainty: free };
    let held = Regression::fit(&columns, &values, &[prior], 0.1)
        .unwrap()
        .estimate(&[0.0, 1.0]);
    assert!((held.uncertainty - free / 2f64.sqrt()).abs() < 1e-9);
    assert_eq!(Regression::fit(&[vec![0.0; 3]], &[1.0; 3], &[], 0.1), None);
}
