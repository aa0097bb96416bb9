//! Linear least squares of signals: by any columns, and by harmonics whose amplitudes are polynomials in time.

use std::ops::Mul;

use nalgebra::{DMatrix, DVector, Dyn, linalg::QR};
use num_complex::Complex64;

/// Columns that explain signals. Their factors serve any number of them.
pub(crate) struct Projection {
    matrix: DMatrix<f64>,
    factors: QR<f64, Dyn, Dyn>,
}

impl Projection {
    pub fn new(matrix: DMatrix<f64>) -> Self {
        Self { factors: matrix.clone().qr(), matrix }
    }

    /// The best factors of the columns, and what they leave; `None` for fewer values than columns, and for columns that are not independent.
    pub fn fit(&self, values: &DVector<f64>) -> Option<[DVector<f64>; 2]> {
        let count = self.matrix.ncols();
        if self.matrix.nrows() < count {
            return None;
        }
        let mut right = values.clone();
        self.factors.q_tr_mul(&mut right);
        let right = right.rows(0, count).into_owned();
        let found = self.factors.r().solve_upper_triangular(&right)?;
        let rest = values - &self.matrix * &found;
        Some([found, rest])
    }

    /// The inverse of the triangular factor, whose rows have the covariance of the fit, for values with white noise of variance 1, as products; `None` for
    /// columns that are not independent.
    pub fn inverse(&self) -> Option<DMatrix<f64>> {
        let count = self.matrix.ncols();
        self.factors
            .r()
            .solve_upper_triangular(&DMatrix::identity(count, count))
    }
}

/// Basis functions at given phases: a polynomial, and harmonics whose amplitudes are polynomials in time.
///
/// Time runs from -1 at the first sample to 1 at the last. The factors serve any number of signals.
pub struct HarmonicBasis {
    columns: Projection,
    /// Column of each harmonic's constant part.
    places: Vec<usize>,
    weights: DVector<f64>,
}

/// A signal in such a basis.
pub struct HarmonicFit {
    coefficients: DVector<f64>,
    places: Vec<usize>,
    /// What the basis leaves of the signal, weighted.
    pub rest: DVector<f64>,
    /// Variance of the white noise that leaves so much.
    pub noise: f64,
}

impl HarmonicBasis {
    /// The basis at the `phases` (rad) of the fundamental: a polynomial of degree `trend`, and as many harmonics, at least one, of which the first has an
    /// amplitude of degree `drift`.
    pub fn new(phases: &[f64], [trend, drift]: [i32; 2], harmonics: usize) -> Self {
        let mut degrees = vec![Some(0); harmonics];
        degrees[0] = Some(drift);
        Self::weighted(phases, trend, &degrees, DVector::from_element(phases.len(), 1.0))
    }

    /// A basis with each of the harmonics 1, 2, … that is given with the degree of its amplitude; `None` leaves one out. Residuals count with these weights.
    pub fn weighted(phases: &[f64], trend: i32, harmonics: &[Option<i32>], weights: DVector<f64>) -> Self {
        let last = (phases.len().max(2) - 1) as f64;
        let time = |row: usize| 2.0 * row as f64 / last - 1.0;
        let mut terms: Vec<(u32, i32, bool)> = (0..=trend).map(|degree| (0, degree, true)).collect();
        let mut places = Vec::new();
        for (n, degree) in (1..).zip(harmonics) {
            places.push(terms.len());
            for degree in degree.map_or(0..0, |degree| 0..degree + 1) {
                terms.extend([(n, degree, false), (n, degree, true)]);
            }
        }
        let turns: Vec<Complex64> = phases.iter().map(|phase| Complex64::cis(*phase)).collect();
        let matrix = DMatrix::from_fn(phases.len(), terms.len(), |row, column| {
            let (harmonic, degree, cosine) = terms[column];
            let wave = turns[row].powu(harmonic);
            weights[row] * time(row).powi(degree) * if cosine { wave.re } else { wave.im }
        });
        Self { columns: Projection::new(matrix), places, weights }
    }

    /// Number of unknowns.
    pub fn terms(&self) -> usize {
        self.columns.matrix.ncols()
    }

    /// The best fit of `values`, one for each phase; `None` for fewer values than unknowns, or phases for which the
    /// terms are not independent.
    pub fn fit(&self, values: &DVector<f64>) -> Option<HarmonicFit> {
        let [coefficients, rest] = self.columns.fit(&values.component_mul(&self.weights))?;
        let count = self.weights.norm_squared() / values.len() as f64 * (values.len() - self.terms()) as f64;
        Some(HarmonicFit {
            coefficients,
            places: self.places.clone(),
            noise: rest.norm_squared() / count,
            rest,
        })
    }

    /// Variances of a harmonic's sine and cosine coefficient of this degree, for values with white noise of variance 1; NaN where the terms are not
    /// independent. `harmonic` counts from 1.
    pub fn variances(&self, harmonic: usize, degree: usize) -> [f64; 2] {
        let column = self.places[harmonic - 1] + 2 * degree;
        let Some(inverse) = self.columns.inverse() else {
            return [f64::NAN; 2];
        };
        // Q is the matrix times the inverse of R.
        let variance = |row: usize| {
            let weighted = &self.columns.matrix * (&inverse * inverse.row(row).transpose());
            weighted.component_mul(&self.weights).norm_squared()
        };
        [column, column + 1].map(variance)
    }
}

impl HarmonicFit {
    /// Number of harmonics.
    pub fn harmonics(&self) -> usize {
        self.places.len()
    }

    /// Complex amplitude a of a harmonic in the middle: `Im(a exp(i n phase))`. `harmonic` counts from 1.
    pub fn harmonic(&self, harmonic: usize) -> Complex64 {
        self.pair(self.places[harmonic - 1])
    }

    /// Change of that amplitude per half of the window; the basis has it where the harmonic's degree is at least 1.
    pub fn drift(&self, harmonic: usize) -> Complex64 {
        self.pair(self.places[harmonic - 1] + 2)
    }

    fn pair(&self, column: usize) -> Complex64 {
        Complex64::new(self.coefficients[column], self.coefficients[column + 1])
    }
}

/// Sum of the values times `exp(-i turn n)`.
pub fn transform<T: Copy + Mul<Complex64, Output = Complex64>>(values: &[T], turn: f64) -> Complex64 {
    let (mut sum, mut rotor, step) = (Complex64::ZERO, Complex64::ONE, Complex64::cis(-turn));
    for value in values {
        sum += *value * rotor;
        rotor *= step;
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn amplitudes_and_drift_are_found_to_rounding() {
        let phases: Vec<f64> = (0..150).map(|n| 0.1 * f64::from(n)).collect();
        let values = phases.iter().map(|phase| {
            let t = phase / 7.45 - 1.0;
            0.3 + (0.7 + 0.1 * t) * phase.sin() - 0.2 * phase.cos() + 0.05 * (3.0 * phase + 0.4).sin()
        });
        let values = DVector::from_iterator(150, values);
        let basis = HarmonicBasis::new(&phases, [0, 1], 3);
        let fit = basis.fit(&values).unwrap();
        assert!((fit.harmonic(1) - Complex64::new(0.7, -0.2)).norm() < 1e-14);
        assert!((fit.drift(1) - Complex64::new(0.1, 0.0)).norm() < 1e-14);
        assert!((fit.harmonic(3) - Complex64::from_polar(0.05, 0.4)).norm() < 1e-14);
        assert!(fit.rest.norm() < 1e-13);
        // Too few or equal phases give no fit.
        for phases in [&[0.0, 0.1][..], &[0.0; 20]] {
            let basis = HarmonicBasis::new(phases, [0, 0], 1);
            assert!(basis.fit(&DVector::zeros(phases.len())).is_none());
        }
    }
}
