//! Tests of `least_squares`.

use super::*;

fn signal(phases: &[f64]) -> DVector<f64> {
    let n = phases.len() as f64;
    DVector::from_iterator(
        phases.len(),
        phases.iter().enumerate().map(|(i, phase)| {
            let t = 2.0 * i as f64 / (n - 1.0) - 1.0;
            let first = (0.7 + 0.1 * t) * phase.sin() - 0.2 * phase.cos();
            0.3 + first + 0.05 * (3.0 * phase + 0.4).sin()
        }),
    )
}

#[test]
fn amplitudes_and_drift_are_found_to_rounding() {
    let phases: Vec<f64> = (0..150).map(|n| 0.1 * f64::from(n)).collect();
    let basis = HarmonicBasis::new(&phases, 0, &[Some(1), None, Some(0)]);
    let values = signal(&phases);
    let fit = basis.fit(&values).unwrap();
    assert!((fit.harmonic(1) - Complex::new(0.7, -0.2)).norm() < 1e-14);
    assert!((fit.drift(1) - Complex::new(0.1, 0.0)).norm() < 1e-14);
    assert!((fit.harmonic(3) - Complex::from_polar(0.05, 0.4)).norm() < 1e-14);
    assert!(basis.residual(&values, &fit).norm() < 1e-13);
}

#[test]
fn too_few_or_equal_phases_give_no_fit() {
    let few = [0.0, 0.1];
    assert!(
        HarmonicBasis::new(&few, 0, &[Some(0)])
            .fit(&DVector::zeros(2))
            .is_none()
    );
    let equal = [0.0; 20];
    assert!(
        HarmonicBasis::new(&equal, 0, &[Some(0)])
            .fit(&DVector::zeros(20))
            .is_none()
    );
}
