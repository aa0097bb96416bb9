//! Least squares of harmonics, by a QR decomposition of the basis.

use nalgebra::{Complex, DMatrix, DVector, Dyn, linalg::QR};

/// Basis functions at given phases: a polynomial, and harmonics whose amplitudes are polynomials in time.
///
/// Time runs from -1 at the first sample to 1 at the last. The factors serve any number of signals.
pub struct HarmonicBasis {
    matrix: DMatrix<f64>,
    factors: QR<f64, Dyn, Dyn>,
    /// Column of each harmonic's constant part.
    columns: Vec<usize>,
}

/// The coefficients of a signal in such a basis.
pub struct HarmonicFit {
    coefficients: DVector<f64>,
    columns: Vec<usize>,
}

impl HarmonicBasis {
    /// The basis at the `phases` (rad) of the fundamental: a polynomial of degree `trend`, and each of the harmonics 1, 2, …
    /// of `harmonics` that is given with the degree of its amplitude; `None` leaves one out.
    pub fn new(phases: &[f64], trend: usize, harmonics: &[Option<usize>]) -> Self {
        let last = (phases.len().max(2) - 1) as f64;
        let time = |row: usize| 2.0 * row as f64 / last - 1.0;
        let mut terms: Vec<(usize, usize, bool)> = (0..=trend).map(|degree| (0, degree, true)).collect();
        let mut columns = Vec::new();
        for (n, degree) in harmonics.iter().enumerate() {
            columns.push(terms.len());
            for degree in degree.map_or(0..0, |degree| 0..degree + 1) {
                terms.extend([(n + 1, degree, false), (n + 1, degree, true)]);
            }
        }
        let matrix = DMatrix::from_fn(phases.len(), terms.len(), |row, column| {
            let (harmonic, degree, cosine) = terms[column];
            let angle = harmonic as f64 * phases[row];
            let wave = if cosine { angle.cos() } else { angle.sin() };
            time(row).powi(degree as i32) * wave
        });
        Self { factors: matrix.clone().qr(), matrix, columns }
    }

    /// Number of unknowns.
    pub fn terms(&self) -> usize {
        self.matrix.ncols()
    }

    /// The best fit of `values`, one for each phase; `None` for fewer values than unknowns, or phases for which the
    /// terms are not independent.
    pub fn fit(&self, values: &DVector<f64>) -> Option<HarmonicFit> {
        if self.matrix.nrows() < self.terms() {
            return None;
        }
        let mut right = values.clone();
        self.factors.q_tr_mul(&mut right);
        let right = right.rows(0, self.terms()).into_owned();
        let coefficients = self.factors.r().solve_upper_triangular(&right)?;
        Some(HarmonicFit { coefficients, columns: self.columns.clone() })
    }

    /// Variances of a harmonic's sine and cosine coefficient of this degree, for values with noise of variance 1; NaN where the
    /// terms are not independent. `harmonic` counts from 1.
    pub fn variances(&self, harmonic: usize, degree: usize) -> [f64; 2] {
        let column = self.columns[harmonic - 1] + 2 * degree;
        let identity = DMatrix::identity(self.terms(), self.terms());
        let Some(inverse) = self.factors.r().solve_upper_triangular(&identity) else {
            return [f64::NAN; 2];
        };
        [column, column + 1].map(|row| inverse.row(row).norm_squared())
    }

    /// The residual of a fit.
    pub fn residual(&self, values: &DVector<f64>, fit: &HarmonicFit) -> DVector<f64> {
        values - &self.matrix * &fit.coefficients
    }
}

impl HarmonicFit {
    /// Complex amplitude a of a harmonic in the middle: `Im(a exp(i n phase))`. `harmonic` counts from 1.
    pub fn harmonic(&self, harmonic: usize) -> Complex<f64> {
        self.pair(self.columns[harmonic - 1])
    }

    /// Change of that amplitude per half of the window; the basis has it where the harmonic's degree is at least 1.
    pub fn drift(&self, harmonic: usize) -> Complex<f64> {
        self.pair(self.columns[harmonic - 1] + 2)
    }

    fn pair(&self, column: usize) -> Complex<f64> {
        Complex::new(self.coefficients[column], self.coefficients[column + 1])
    }
}

#[cfg(test)]
#[path = "../../tests/unit/least_squares.rs"]
mod tests;
