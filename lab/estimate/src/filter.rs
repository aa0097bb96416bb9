//! The Kalman filter that whitens a record, period by period, and its backward pass.
//!
//! The state is u, two real numbers. With the unknowns as further columns the filter is that of de Jong (The diffuse Kalman filter, Annals of
//! Statistics 19, 1991): one pass whitens the record and a unit of each unknown.

use nalgebra::{DMatrix, Matrix2, Vector2};
use num_complex::Complex64;

use crate::columns::Columns;
use crate::record::Record;

/// What the filter does at a period.
pub struct Step {
    transition: Matrix2<f64>,
    predicted: Matrix2<f64>,
    /// Covariance of the state after it.
    pub corrected: Matrix2<f64>,
    gain: Matrix2<f64>,
    /// Makes the innovation one of covariance 1.
    whitening: Matrix2<f64>,
    /// Whether the period says something.
    is_used: bool,
}

impl Step {
    /// From the covariance after the period before. `process`: covariance that is added on the way; `noise`: variance of each component of what is
    /// measured, `None` where the period says nothing.
    pub fn new(transition: Matrix2<f64>, process: Matrix2<f64>, covariance: Matrix2<f64>, noise: Option<f64>) -> Self {
        let predicted = transition * covariance * transition.transpose() + process;
        let (mut gain, mut whitening) = (Matrix2::zeros(), Matrix2::zeros());
        if let Some(noise) = noise {
            let innovation = predicted + Matrix2::from_diagonal_element(noise);
            let lower = innovation.cholesky().map_or(Matrix2::zeros(), |one| one.l());
            whitening = lower.try_inverse().unwrap_or_default();
            gain = predicted * whitening.transpose() * whitening;
        }
        let corrected = predicted - gain * predicted;
        let corrected = 0.5 * (corrected + corrected.transpose());
        Self {
            transition,
            predicted,
            corrected,
            gain,
            whitening,
            is_used: noise.is_some(),
        }
    }

    /// Moves a state on by `increment`, and corrects it by the difference `direct` of what is measured from it. Returns the state before the correction and
    /// the whitened innovation.
    fn advance(&self, state: &mut Vector2<f64>, [increment, direct]: [Vector2<f64>; 2]) -> [Vector2<f64>; 2] {
        let predicted = self.transition * *state + increment;
        let innovation = direct + predicted;
        *state = predicted - self.gain * innovation;
        [predicted, self.whitening * innovation]
    }
}

/// Whitened innovations: a row for each of `rows`, the record and units of the unknowns, and two columns for each period that says something. `acts`:
/// increment of the state and difference of what is measured from it, at a period, of a row.
pub fn whiten(steps: &[Step], rows: usize, acts: impl Fn(usize, usize) -> [Vector2<f64>; 2]) -> DMatrix<f64> {
    let used = steps.iter().filter(|step| step.is_used).count();
    let mut states = vec![Vector2::zeros(); rows];
    let mut white = DMatrix::zeros(rows, 2 * used);
    let mut column = 0;
    for (k, step) in steps.iter().enumerate() {
        for (row, state) in states.iter_mut().enumerate() {
            let [_, innovation] = step.advance(state, acts(k, row));
            if step.is_used {
                white
                    .fixed_view_mut::<1, 2>(row, column)
                    .copy_from(&innovation.transpose());
            }
        }
        column += if step.is_used { 2 } else { 0 };
    }
    white
}

/// States from all periods, those before and those after: the filter, and the backward pass. `acts`: as in [`whiten`], of the record with its unknowns.
pub fn smooth(steps: &[Step], acts: impl Fn(usize) -> [Vector2<f64>; 2]) -> Vec<Vector2<f64>> {
    let mut state = Vector2::zeros();
    let forward = |(k, step): (usize, &Step)| {
        let [predicted, _] = step.advance(&mut state, acts(k));
        (predicted, state)
    };
    let (predicted, mut all): (Vec<_>, Vec<_>) = steps.iter().enumerate().map(forward).unzip();
    for k in (1..all.len()).rev() {
        let back = steps[k - 1].corrected * steps[k].transition.transpose();
        let back = steps[k]
            .predicted
            .try_inverse()
            .map_or(Matrix2::zeros(), |inverse| back * inverse);
        let ahead = all[k] - predicted[k];
        all[k - 1] += back * ahead;
    }
    all
}

/// The filter of a record.
pub struct Filter {
    periods: Vec<Step>,
    /// Sum of the logarithms of the determinants of the innovations' covariances.
    pub logarithms: f64,
}

/// Variance, over that of the noise, by which a period that is not used lets the state go: 3e4 standard deviations of it.
const FORGET: f64 = 1e9;

/// The matrix of a complex factor.
pub fn rotation(z: Complex64) -> Matrix2<f64> {
    Matrix2::new(z.re, -z.im, z.im, z.re)
}

/// The components.
pub fn pair(z: Complex64) -> Vector2<f64> {
    Vector2::new(z.re, z.im)
}

impl Filter {
    /// Of a record whose periods are `used` or say nothing. Variances: share of the force beyond its lag that is noise of the process, and noise of the
    /// response over the measured one.
    pub fn new(record: &Record, columns: &Columns, used: &[bool], [process_share, measured]: [f64; 2]) -> Self {
        let (noise, base) = (&record.periods.noise, &record.periods.base_noise);
        let mut covariance = Matrix2::zeros();
        let mut logarithms = 0.0;
        let mut period = |k: usize| {
            let (mut transition, mut process) = (Matrix2::zeros(), 0.0);
            if k > 0 {
                let duration = record.steps[k - 1];
                transition = rotation(record.transition(duration)) + columns.feedback[k];
                let moved = (record.linear.gain() * duration).norm_sqr();
                let of_base = base[k] + base[k - 1] + record.between[k - 1];
                process = 0.5 * moved * (process_share * columns.beyond[k - 1] + of_base);
            }
            if !used[k] {
                process += FORGET * noise[k];
            }
            let measured = used[k].then_some(measured * noise[k]);
            let step = Step::new(
                transition,
                Matrix2::from_diagonal_element(process),
                covariance,
                measured,
            );
            covariance = step.corrected;
            if used[k] {
                logarithms -= 2.0 * step.whitening.determinant().ln();
            }
            step
        };
        let periods = (0..used.len()).map(&mut period).collect();
        Self { periods, logarithms }
    }

    /// Whitened innovations, a row for each component of each used period: of the record, of its change where the base moved more than it read, over the
    /// share of it, and of a unit of the real and of the imaginary part of each unknown.
    pub fn whiten(&self, record: &Record, columns: &Columns) -> DMatrix<f64> {
        let unknowns = columns.direct[0].len() - 1;
        let linear = &record.periods.linear;
        let acts = |k: usize, row: usize| {
            let (both, before) = ([&columns.increments[k], &columns.direct[k]], k.saturating_sub(1));
            let fed_back = |path: Complex64| columns.feedback[k] * pair(path);
            match row {
                0 => {
                    let [increment, direct] = both.map(|of| of[0]);
                    let fed_back = fed_back(columns.path[before]);
                    [pair(increment) - fed_back, pair(direct - record.departure[k])]
                }
                1 => [-fed_back(linear[before]), -pair(linear[k])],
                _ => {
                    let unit = [Complex64::ONE, Complex64::i()][row % 2];
                    both.map(|of| pair(unit * of[row / 2]))
                }
            }
        };
        let mut white = whiten(&self.periods, 2 + 2 * unknowns, acts);
        white.rows_mut(0, 2).neg_mut();
        white
    }

    /// The response of each period that these unknowns explain best: the backward pass. As measured where a period is not used.
    pub fn smooth(&self, record: &Record, columns: &Columns, unknowns: &[Complex64]) -> Vec<Complex64> {
        let sum = |row: &[Complex64]| -> Complex64 {
            row[0] + row[1..].iter().zip(unknowns).map(|(a, b)| a * b).sum::<Complex64>()
        };
        let direct: Vec<Complex64> = columns.direct.iter().map(|row| sum(row)).collect();
        let acts = |k: usize| {
            let fed_back = columns.feedback[k] * pair(columns.path[k.saturating_sub(1)]);
            let increment = pair(sum(&columns.increments[k])) - fed_back;
            [increment, pair(direct[k] - record.departure[k])]
        };
        let mut response = record.periods.response.clone();
        for (k, state) in smooth(&self.periods, acts).into_iter().enumerate() {
            if self.periods[k].is_used {
                response[k] = record.periods.linear[k] + Complex64::new(state[0], state[1]) + direct[k];
            }
        }
        response
    }
}
