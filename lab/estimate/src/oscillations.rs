//! Oscillations in equally spaced samples: `y(t) = trend + Im Σ c exp(s t)`, where all poles s but one are known. Least squares of the samples.
//!
//! A driven mode is one case: the known pole is that of the drive, the unknown one is the mode's, whatever its motion was at the start. A channel that
//! reads the drive is another: its only pole has the frequency of the clock.
//!
//! The amplitudes are linear unknowns, found anew for each pole (variable projection; Golub and Pereyra, SIAM Journal on Numerical Analysis 10, 1973).

use std::f64::consts::FRAC_PI_2;

use nalgebra::{DMatrix, DVector};
use num_complex::Complex64;

use crate::harmonics::{Projection, transform};

/// Oscillations that explain some samples best.
#[derive(Debug, Clone)]
pub struct Oscillations {
    /// Complex amplitudes at the time zero: of the known poles, and of the unknown one.
    pub amplitudes: Vec<Complex64>,
    /// The pole that was unknown, 1/s.
    pub pole: Complex64,
    /// What they leave.
    pub rest: DVector<f64>,
    /// Covariance of trend, amplitudes and pole for noise of variance 1, real and imaginary part of each; NaN where they are not determined.
    covariance: DMatrix<f64>,
    trend: usize,
}

/// Largest number of steps of Gauss and Newton; they end where the samples are not explained better.
const STEPS: usize = 12;

/// Samples, of which the first is at `first` times `step`, s, and what is known of them.
struct Samples<'a> {
    values: DVector<f64>,
    times: Vec<f64>,
    trend: usize,
    known: &'a [Complex64],
}

impl Samples<'_> {
    /// Columns of the trend, of the amplitudes, and of a pole whose amplitude is given.
    fn columns(&self, pole: Complex64, amplitude: Option<Complex64>) -> DMatrix<f64> {
        let scale = self.times.iter().fold(0.0, |largest: f64, t| largest.max(t.abs()));
        let known = self.known.iter().map(|one| (*one, None));
        let all = known.chain([(pole, None)]).chain(amplitude.map(|of| (pole, Some(of))));
        let factors: Vec<_> = all.collect();
        let begin = self.trend + 1;
        let mut columns = DMatrix::zeros(self.times.len(), begin + 2 * factors.len());
        for (row, t) in self.times.iter().enumerate() {
            (0..begin).for_each(|degree| columns[(row, degree)] = (t / scale).powi(degree as i32));
            for (n, (pole, amplitude)) in factors.iter().enumerate() {
                let factor = (pole * t).exp() * amplitude.map_or(Complex64::ONE, |of| of * *t);
                columns[(row, begin + 2 * n)] = factor.im;
                columns[(row, begin + 2 * n + 1)] = factor.re;
            }
        }
        columns
    }

    /// The best oscillations with this pole.
    fn at(&self, pole: Complex64) -> Oscillations {
        let columns = Projection::new(self.columns(pole, None));
        let nothing =
            || [3 + self.trend + 2 * self.known.len(), self.times.len()].map(|n| DVector::from_element(n, f64::NAN));
        let [unknowns, rest] = columns.fit(&self.values).unwrap_or_else(nothing);
        let pairs = unknowns.as_slice()[self.trend + 1..].chunks_exact(2);
        let amplitudes = pairs.map(|pair| Complex64::new(pair[0], pair[1])).collect();
        let (covariance, trend) = (DMatrix::zeros(0, 0), self.trend);
        Oscillations { amplitudes, pole, rest, covariance, trend }
    }
}

impl Oscillations {
    /// Of samples `step` seconds apart, the first of which is at the time `first`, s, beside a trend of this degree. `start`: a first value of the
    /// unknown pole, whose frequency is looked for within this `range`, relative, in quarters of a turn over the record.
    pub fn new(
        samples: impl IntoIterator<Item = f64>,
        [first, step]: [f64; 2],
        trend: usize,
        known: &[Complex64],
        start: Complex64,
        range: f64,
    ) -> Self {
        let values = DVector::from_vec(samples.into_iter().collect());
        let times = (0..values.len()).map(|n| first + n as f64 * step).collect();
        let samples = Samples { values, times, trend, known };
        let quarter = FRAC_PI_2 / (samples.values.len() as f64 * step);
        let better = |one: Self, other: Self| if other.error() < one.error() { other } else { one };
        let turned = |n: i32| samples.at(start + Complex64::new(0.0, f64::from(n) * quarter));
        let most = (range * start.im / quarter) as i32;
        let mut best = (-most..=most).map(turned).fold(turned(0), better);
        let columns = |best: &Self| Projection::new(samples.columns(best.pole, best.amplitudes.last().copied()));
        for _ in 0..STEPS {
            let Some([change, _]) = columns(&best).fit(&best.rest) else {
                break;
            };
            let n = change.len();
            let next = samples.at(best.pole + Complex64::new(change[n - 2], change[n - 1]));
            if next.error() < best.error() {
                best = next;
            } else {
                break;
            }
        }
        let n = trend + 5 + 2 * known.len();
        let inverse = columns(&best).inverse();
        best.covariance = inverse.map_or(DMatrix::from_element(n, n, f64::NAN), |r| &r * r.transpose());
        best
    }

    /// Sum of the squares of what is left.
    fn error(&self) -> f64 {
        self.rest.norm_squared()
    }

    /// Standard uncertainty of each component of a sum of amplitudes and pole with these factors, for white noise of variance 1.
    pub fn u(&self, factors: &[Complex64]) -> f64 {
        let row = |turn: Complex64| {
            let parts = factors.iter().flat_map(|one| [(turn * one).re, -(turn * one).im]);
            let all = std::iter::repeat_n(0.0, self.trend + 1).chain(parts);
            let row = DVector::from_iterator(self.covariance.nrows(), all);
            row.dot(&(&self.covariance * &row))
        };
        // The imaginary part of a number is the real part of -i times it.
        (0.5 * (row(Complex64::ONE) + row(-Complex64::i()))).sqrt()
    }

    /// Variance of the noise about the frequency that turns by `turn` rad from sample to sample, as if it were white: from what is left, in blocks of
    /// this many samples.
    pub fn variance(&self, turn: f64, block: usize) -> f64 {
        let blocks = self.rest.as_slice().chunks_exact(block);
        // As many complex unknowns as amplitudes, and the pole.
        let degrees = blocks.len() as f64 - self.amplitudes.len() as f64 - 1.0;
        let in_band = |values: &[f64]| transform(values, turn).norm_sqr();
        blocks.map(in_band).sum::<f64>() / (block as f64 * degrees)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_driven_mode_is_found_from_a_start_that_is_a_tenth_off() {
        let (drive, mode, step) = (Complex64::new(0.0, 1.0), Complex64::new(-0.02, 1.03), 0.06);
        let amplitudes = [Complex64::new(2.0, 1.0), Complex64::new(-2.1, -0.9)];
        let at = |n: i32| {
            let t = f64::from(n) * step;
            0.3 - 0.01 * t + (amplitudes[0] * (drive * t).exp() + amplitudes[1] * (mode * t).exp()).im
        };
        let start = Complex64::new(-0.01, 0.95);
        let found = Oscillations::new((50..2500).map(at), [50.0 * step, step], 1, &[drive], start, 0.1);
        assert!((found.pole - mode).norm() < 1e-12, "{}", found.pole);
        let errors = found
            .amplitudes
            .iter()
            .zip(amplitudes)
            .map(|(one, exact)| (one - exact).norm());
        assert!(errors.fold(0.0, f64::max) < 1e-10);
    }
}
