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
        Self { transition, predicted, corrected, gain, whitening }
    }

    /// Moves a state on, and corrects it by the difference `direct` of what is measured from it. Returns the state before the correction and the whitened
    /// innovation.
    pub fn advance(
        &self,
        state: &mut Vector2<f64>,
        increment: Vector2<f64>,
        direct: Vector2<f64>,
    ) -> [Vector2<f64>; 2] {
        let predicted = self.transition * *state + increment;
        let innovation = direct + predicted;
        *state = predicted - self.gain * innovation;
        [predicted, self.whitening * innovation]
    }
}

/// The backward pass: states from all periods, from those before and after the correction at each.
pub fn smooth(steps: &[&Step], states: &[[Vector2<f64>; 2]]) -> Vec<Vector2<f64>> {
    let mut all: Vec<Vector2<f64>> = states.iter().map(|[_, corrected]| *corrected).collect();
    for k in (1..states.len()).rev() {
        let back = steps[k - 1].corrected * steps[k].transition.transpose();
        let back = steps[k]
            .predicted
            .try_inverse()
            .map_or(Matrix2::zeros(), |inverse| back * inverse);
        let ahead = all[k] - states[k][0];
        all[k - 1] += back * ahead;
    }
    all
}

/// The filter of a record.
pub struct Filter {
    periods: Vec<Step>,
    used: Vec<bool>,
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
        Self { periods, used: used.to_vec(), logarithms }
    }

    /// Whitened innovations, a row for each component of each used period: of the record, of its change where the base moved more than it read, over the
    /// share of it, and of a unit of the real and of the imaginary part of each unknown.
    pub fn whiten(&self, record: &Record, columns: &Columns) -> DMatrix<f64> {
        let unknowns = columns.direct[0].len() - 1;
        let rows = 2 * self.used.iter().filter(|used| **used).count();
        let mut state = vec![Vector2::zeros(); 2 + 2 * unknowns];
        let mut white = DMatrix::zeros(2 + 2 * unknowns, rows);
        let mut row = 0;
        let linear = &record.periods.linear;
        for (k, period) in self.periods.iter().enumerate() {
            let (increments, direct, before) = (&columns.increments[k], &columns.direct[k], k.saturating_sub(1));
            let fed_back = |path: Complex64| columns.feedback[k] * pair(path);
            for (n, x) in state.iter_mut().enumerate() {
                let of_unknown = |unit: Complex64| [increments, direct].map(|of| pair(unit * of[n / 2]));
                let [increment, direct] = match n {
                    0 => [
                        pair(increments[0]) - fed_back(columns.path[before]),
                        pair(direct[0] - record.departure[k]),
                    ],
                    1 => [-fed_back(linear[before]), -pair(linear[k])],
                    _ if n % 2 == 0 => of_unknown(Complex64::ONE),
                    _ => of_unknown(Complex64::i()),
                };
                let [_, innovation] = period.advance(x, increment, direct);
                if self.used[k] {
                    white.fixed_view_mut::<1, 2>(n, row).copy_from(&innovation.transpose());
                }
            }
            row += if self.used[k] { 2 } else { 0 };
        }
        white.rows_mut(0, 2).neg_mut();
        white
    }

    /// The response of each period that these unknowns explain best: the backward pass. As measured where a period is not used.
    pub fn smooth(&self, record: &Record, columns: &Columns, unknowns: &[Complex64]) -> Vec<Complex64> {
        let sum = |row: &[Complex64]| -> Complex64 {
            row[0] + row[1..].iter().zip(unknowns).map(|(a, b)| a * b).sum::<Complex64>()
        };
        let direct: Vec<Complex64> = columns.direct.iter().map(|row| sum(row)).collect();
        let mut state = Vector2::zeros();
        let mut states = Vec::new();
        for (k, step) in self.periods.iter().enumerate() {
            let known =
                pair(sum(&columns.increments[k])) - columns.feedback[k] * pair(columns.path[k.saturating_sub(1)]);
            let [predicted, _] = step.advance(&mut state, known, pair(direct[k] - record.departure[k]));
            states.push([predicted, state]);
        }
        let steps: Vec<&Step> = self.periods.iter().collect();
        let mut response = record.periods.response.clone();
        for (k, state) in smooth(&steps, &states).into_iter().enumerate() {
            if self.used[k] {
                response[k] = record.periods.linear[k] + Complex64::new(state[0], state[1]) + direct[k];
            }
        }
        response
    }
}
