//! Unit tests of numerical methods.

use super::*;

#[test]
fn roots_of_a_quadratic_keep_their_digits_and_are_continuous_where_the_linear_coefficient_changes_sign() {
    let [large, small] = quadratic(1e-12, 1.0, -1.0).unwrap();
    assert!((small - (1.0 - 1e-12)).abs() < 1e-15 && (large + 1e12).abs() < 2.0);
    let [above, below] = [1e-9, -1e-9].map(|linear| quadratic(1.0, linear, -1.0).unwrap());
    assert!((above[0] - below[0]).abs() < 1e-8 && (above[1] - below[1]).abs() < 1e-8);
}

#[test]
fn bisection_ends_between_neighbouring_numbers() {
    let (a, b) = bisection(1.0, 2.0, |x| x * x > 2.0);
    assert!(a * a <= 2.0 && b * b > 2.0 && b - a < 3e-16);
    assert_eq!(bisection(2.0, 1.0, |x| x * x > 2.0), (b, a));
}

#[test]
fn third_differences_see_noise_and_no_cubic() {
    let cubic = |n: usize| 1e-3 * (n as f64).powi(2) - 2.0;
    let smooth: Vec<f64> = (0..200).map(cubic).collect();
    assert!(noise(&smooth) < 1e-12);
    // Alternating signs: every third difference is eight times the amplitude.
    let rough = (0..200).map(|n| cubic(n) + 0.1 * f64::from(1 - 2 * (n as i32 % 2)));
    assert!((noise(&rough.collect::<Vec<_>>()) - 0.8 / 20f64.sqrt()).abs() < 1e-9);
    assert_eq!(noise(&[1.0; 5]), 0.0);
}

#[test]
fn amplitudes_and_drift_are_found_to_rounding() {
    let phases: Vec<f64> = (0..150).map(|n| 0.1 * f64::from(n)).collect();
    let values = phases.iter().map(|phase| {
        let t = phase / 7.45 - 1.0;
        0.3 + (0.7 + 0.1 * t) * phase.sin() - 0.2 * phase.cos() + 0.05 * (3.0 * phase + 0.4).sin()
    });
    let values = DVector::from_iterator(150, values);
    let basis = HarmonicBasis::new(&phases, 0, &[Some(1), None, Some(0)]);
    let fit = basis.fit(&values).unwrap();
    assert!((fit.harmonic(1) - Complex::new(0.7, -0.2)).norm() < 1e-14);
    assert!((fit.drift(1) - Complex::new(0.1, 0.0)).norm() < 1e-14);
    assert!((fit.harmonic(3) - Complex::from_polar(0.05, 0.4)).norm() < 1e-14);
    assert!(basis.residual(&values, &fit).norm() < 1e-13);
    // Too few or equal phases give no fit.
    for phases in [&[0.0, 0.1][..], &[0.0; 20]] {
        let basis = HarmonicBasis::new(phases, 0, &[Some(0)]);
        assert!(basis.fit(&DVector::zeros(phases.len())).is_none());
    }
}

#[test]
fn uncertainties_are_those_of_the_textbook() {
    // t(0.975) of 4, 10 and 30 degrees of freedom.
    for (degrees, quantile) in [(4.0, 2.776), (10.0, 2.228), (30.0, 2.042)] {
        assert!((student_factor(degrees) * NORMAL / quantile - 1.0).abs() < 0.01);
    }
    // The standard deviation is sqrt(10), for four degrees of freedom.
    let mean = Estimate::mean(&[1.0, 3.0, 5.0, 7.0, 9.0]);
    assert!((mean.value - 5.0).abs() < 1e-12);
    assert!((mean.uncertainty - (10f64 / 5.0).sqrt() * student_factor(4.0)).abs() < 1e-9);
}

#[test]
fn a_wandering_mean_is_less_certain_than_one_of_independent_values() {
    // Each value repeated four times has a quarter of the independent ones.
    let values: Vec<f64> = (0..200).map(|n| f64::from((n / 4 * 37) % 50) - 24.5).collect();
    let fit = Regression::fit(&[vec![1.0; 200]], &values, None, 3.0).unwrap();
    let independent = 50f64.mul_add(50.0, -1.0) / 12.0 / 200.0;
    let ratio = fit.estimate(&[1.0]).uncertainty / independent.sqrt();
    assert!((1.8..3.0).contains(&ratio), "{ratio}");
}

#[test]
fn a_known_noise_is_the_least_uncertainty_and_a_prior_narrows_it() {
    let columns = [vec![1.0; 8], (0..8).map(f64::from).collect()];
    let values: Vec<f64> = (0..8).map(|n| 2.0 + 0.5 * f64::from(n)).collect();
    let fit = |prior| Regression::fit(&columns, &values, prior, 0.1).unwrap();
    let free = fit(None).estimate(&[0.0, 1.0]).uncertainty;
    assert!((fit(None).coefficient(1) - 0.5).abs() < 1e-12 && fit(None).excess < 1e-9);
    assert!((free - 0.1 / 42f64.sqrt()).abs() < 1e-12);
    let held = fit(Some((1, Estimate { value: 0.5, uncertainty: free })));
    assert!((held.estimate(&[0.0, 1.0]).uncertainty - free / 2f64.sqrt()).abs() < 1e-9);
    assert_eq!(Regression::fit(&[vec![0.0; 3]], &[1.0; 3], None, 0.1), None);
}

/// The valley of Rosenbrock, whose minimum is at (1, 1).
struct Valley([[f64; 2]; 2]);

impl Misfit<2> for Valley {
    type Trace = ();

    fn residuals(&self, x: &SVector<f64, 2>, (): &()) -> Option<(Vec<f64>, ())> {
        // There is no model where the first unknown is below -2.
        (x[0] > -2.0).then_some((vec![10.0 * (x[1] - x[0] * x[0]), 1.0 - x[0]], ()))
    }

    fn derivatives(&self, x: &SVector<f64, 2>, (): &()) -> Option<Vec<SVector<f64, 2>>> {
        Some(vec![SVector::from([-20.0 * x[0], 10.0]), SVector::from([-1.0, 0.0])])
    }

    fn limits(&self) -> [[f64; 2]; 2] {
        self.0
    }
}

#[test]
fn least_squares_follow_a_curved_valley_and_stay_within_the_limits() {
    let free = [[f64::NEG_INFINITY, f64::INFINITY]; 2];
    let found = LeastSquares::minimum(&Valley(free), SVector::from([-1.2, 1.0]), &(), 1e-12).unwrap();
    assert!((found.x - SVector::from([1.0, 1.0])).norm() < 1e-6, "{}", found.x);
    // The inverse of J^T J at (1, 1).
    assert!((found.covariance() - SMatrix::from([[1.0, 2.0], [2.0, 4.01]])).norm() < 1e-4);
    // With x at most 0.5 the minimum is on the limit: y = x².
    let limited = [[f64::NEG_INFINITY, 0.5], free[1]];
    let found = LeastSquares::minimum(&Valley(limited), SVector::from([-1.2, 1.0]), &(), 1e-12).unwrap();
    assert!((found.x - SVector::from([0.5, 0.25])).norm() < 1e-6, "{}", found.x);
    assert!(LeastSquares::minimum(&Valley(free), SVector::from([-3.0, 1.0]), &(), 1e-12).is_none());
}
