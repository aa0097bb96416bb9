//! Estimates with their standard uncertainties, from least squares.

use nalgebra::{DMatrix, DVector};

/// A value and its standard uncertainty: the value ± 1.96 uncertainties is a 95 % interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate {
    /// The value.
    pub value: f64,
    /// Its standard uncertainty, in the same unit.
    pub uncertainty: f64,
}

/// Scatter over the noise beyond which it is a misfit.
const MISFIT: f64 = 10.0;
/// Quantile of the normal distribution for a two-sided interval of 95 %.
const NORMAL: f64 = 1.959_964;

impl Estimate {
    /// An estimate from a value and the independent parts of its uncertainty.
    pub fn new(value: f64, parts: &[f64]) -> Self {
        let uncertainty = parts.iter().map(|part| part * part).sum::<f64>().sqrt();
        Self { value, uncertainty }
    }

    /// The mean of independent values.
    pub fn mean(values: &[f64]) -> Self {
        let fit = Regression::fit(&[vec![1.0; values.len()]], values, &[], 0.0);
        fit.map_or(Self { value: f64::NAN, uncertainty: f64::NAN }, |fit| {
            fit.estimate(&[1.0])
        })
    }

    /// In another unit.
    pub fn scaled(self, factor: f64) -> Self {
        Self {
            value: self.value * factor,
            uncertainty: self.uncertainty * factor.abs(),
        }
    }
}

/// Half width of a 95 % interval of Student's distribution over that of the normal distribution (Cornish and Fisher's expansion;
/// within 1 % from 4 degrees of freedom on).
pub fn student_factor(degrees: f64) -> f64 {
    let (z, n) = (NORMAL, degrees.max(1.0));
    let first = (z.powi(3) + z) / (4.0 * n);
    let second = (5.0 * z.powi(5) + 16.0 * z.powi(3) + 3.0 * z) / (96.0 * n * n);
    let third = (3.0 * z.powi(7) + 19.0 * z.powi(5) + 17.0 * z.powi(3) - 15.0 * z) / (384.0 * n * n * n);
    1.0 + (first + second + third) / z
}

/// Standard deviation of a sum of residuals over that of as many independent ones, from the correlation of neighbours (a process of first
/// order): the effective number of values is smaller than their number.
fn colour(residuals: &[f64]) -> f64 {
    let neighbours: f64 = residuals.windows(2).map(|pair| pair[0] * pair[1]).sum();
    let squares: f64 = residuals.iter().map(|one| one * one).sum();
    // A correlation over more than a twelfth of the record cannot be told from a trend.
    let longest = (1.0 - 12.0 / residuals.len() as f64).clamp(0.0, 0.9);
    let correlation = (neighbours / squares).clamp(0.0, longest);
    ((1.0 + correlation) / (1.0 - correlation)).sqrt()
}

/// What is known of a coefficient in advance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Prior {
    /// Number of the coefficient.
    pub coefficient: usize,
    /// Its expected value.
    pub value: f64,
    /// The standard uncertainty of that.
    pub uncertainty: f64,
}

/// A linear least-squares fit.
#[derive(Debug, Clone, PartialEq)]
pub struct Regression {
    coefficients: DVector<f64>,
    covariance: DMatrix<f64>,
    /// Standard deviation of the residuals over that of the noise; 1 where the noise is not known.
    pub excess: f64,
}

impl Regression {
    /// Fits `values` by the sum of `columns`. `noise` is the standard deviation of a value, 0 where it is not known; where the
    /// residuals scatter significantly more, their scatter counts, with Student's distribution and the correlation of neighbours. Priors need a known noise. `None` for
    /// too few values, or columns that are not independent.
    pub fn fit(columns: &[Vec<f64>], values: &[f64], priors: &[Prior], noise: f64) -> Option<Self> {
        let (rows, terms) = (values.len(), columns.len());
        let degrees = (rows + priors.len())
            .checked_sub(terms)
            .filter(|n| *n > 0 || noise > 0.0)? as f64;
        let data = DMatrix::from_fn(rows, terms, |row, column| columns[column][row]);
        let values = DVector::from_column_slice(values);
        // A prior counts as one more value, weighted by its uncertainty relative to the noise.
        let (mut matrix, mut right) = (data, values);
        for prior in priors {
            let (row, weight) = (matrix.nrows(), noise / prior.uncertainty);
            matrix = matrix.insert_row(row, 0.0);
            right = right.insert_row(row, prior.value * weight);
            matrix[(row, prior.coefficient)] = weight;
        }
        // Columns of very different size make the normal equations ill-conditioned; scaled to length 1 they are not.
        let lengths: Vec<f64> = matrix.column_iter().map(|column| column.norm()).collect();
        if lengths.contains(&0.0) {
            return None;
        }
        for (mut column, length) in matrix.column_iter_mut().zip(&lengths) {
            column /= *length;
        }
        let factors = matrix.clone().qr();
        let inverse = factors.r().solve_upper_triangular(&DMatrix::identity(terms, terms))?;
        let mut turned = right.clone();
        factors.q_tr_mul(&mut turned);
        let scaled = &inverse * turned.rows(0, terms);
        let residual = &right - &matrix * &scaled;
        let scatter = (residual.norm_squared() / degrees.max(1.0)).sqrt();
        // White noise alone exceeds this in one case of twenty.
        let is_noise = scatter <= noise * (1.0 + 1.64 / (2.0 * degrees).sqrt());
        let deviation = if is_noise {
            noise
        } else {
            // Residuals far above the noise are those of the model, not a random process.
            let colour = if scatter <= MISFIT * noise {
                colour(&residual.as_slice()[..rows])
            } else {
                1.0
            };
            scatter * student_factor(degrees) * colour
        };
        let variance = deviation * deviation;
        let excess = if noise > 0.0 { scatter / noise } else { 1.0 };
        let covariance = DMatrix::from_fn(terms, terms, |i, j| {
            inverse.row(i).dot(&inverse.row(j)) * variance / (lengths[i] * lengths[j])
        });
        let coefficients = DVector::from_fn(terms, |i, _| scaled[i] / lengths[i]);
        coefficients
            .iter()
            .all(|one| one.is_finite())
            .then_some(Self { coefficients, covariance, excess })
    }

    /// A coefficient.
    pub fn coefficient(&self, n: usize) -> f64 {
        self.coefficients[n]
    }

    /// The sum of the coefficients with these weights.
    pub fn estimate(&self, weights: &[f64]) -> Estimate {
        let weights = DVector::from_column_slice(weights);
        Estimate {
            value: weights.dot(&self.coefficients),
            uncertainty: weights.dot(&(&self.covariance * &weights)).max(0.0).sqrt(),
        }
    }
}

#[cfg(test)]
#[path = "../../tests/unit/estimate.rs"]
mod tests;
