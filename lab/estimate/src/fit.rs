//! Generalised least squares for the force, maximum likelihood for three variances.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn, SymmetricEigen};
use num_complex::Complex64;

use crate::columns::{Columns, Force};
use crate::curve::Curve;
use crate::filter::Filter;
use crate::interpolation::Basis;
use crate::record::{Element, Record};
use crate::search::simplex;

/// Functions of the spline: its prior decides how many of them count.
const FUNCTIONS: usize = 23;
/// Standard uncertainty of the factor of an element's lag, of each component: closed forms of first order are that good. Mixtures at 75 dB have
/// 1.00 ± 0.01.
const U_LAG: f64 = 0.02;
/// Information on u at the start: none, but for rounding.
const START_INFORMATION: f64 = 1e-30;
/// Uncertainty of the curvature of an element's own force, relative: what the uncertainties of a drawing move it by.
const SHAPE: f64 = 0.25;
/// Rounds of path, lag and variances.
const PATH_ROUNDS: usize = 3;
/// Limits of the three: 1 % to all of what is beyond the lag, as an amplitude; any curvature of S; noise from half to a
/// hundred times what the samples of a period show, as an amplitude: behind a filter they show little.
const VARIANCE_LIMITS: [[f64; 2]; 3] = [[1e-4, 1.0], [1e-5, 30.0], [0.2, 1e4]];

/// Share of the force beyond its lag, roughness of S over the scale of the force, and noise of the response over the measured one.
pub type Hyper = [f64; 3];

/// The force of an element, from a record.
pub struct Estimate<'a> {
    record: &'a Record,
    element: &'a dyn Element,
    /// Size of the force, m.
    scale: f64,
    /// The periods that count.
    pub used: Vec<bool>,
    basis: Basis,
    coefficients: Vec<Complex64>,
    /// Factor of the element's lag.
    pub lag: Complex64,
    hyper: Hyper,
    /// Coefficients of the element's own force: S has its curvature, and deviates from it by a random walk.
    own: Vec<Complex64>,
    /// Smallest roughness of the deviation, over the scale.
    least: f64,
    columns: Columns,
}

/// The unknowns: spline, lag, and u at the start, real and imaginary part of each.
pub struct Solution {
    /// Twice the negative logarithm of the likelihood, without constants.
    pub deviance: f64,
    /// Change of the lag's factor, beside the others.
    pub unknowns: DVector<f64>,
    /// The equations with the prior.
    normal: Cholesky<f64, Dyn>,
    /// The matrix and the right-hand side without priors, and how the latter changes with the gain of the base.
    information: (DMatrix<f64>, DMatrix<f64>),
}

impl<'a> Estimate<'a> {
    /// With the measured response as the path; the periods in which the element has no smooth force do not count. `None` where less than half of
    /// the functions' number of periods is left.
    pub fn new(record: &'a Record, element: &'a dyn Element, scale: f64, used: &[bool]) -> Option<Self> {
        let response = &record.periods.response;
        let is_smooth = |(used, z): (&bool, &Complex64)| *used && element.is_smooth(z.norm());
        let smooth: Vec<bool> = used.iter().zip(response).map(is_smooth).collect();
        let mut one = Self::of_periods(record, element, scale, &smooth)?;
        let kept: Vec<bool> = smooth
            .iter()
            .zip(&one.columns.lost)
            .map(|(used, lost)| *used && !lost)
            .collect();
        // The drift of a fundamental is known between two others of the same motion only.
        let has_neighbours = |k: usize| k > 0 && kept[k - 1] && kept[k] && kept.get(k + 1).is_some_and(|next| *next);
        one.used = (0..kept.len()).map(has_neighbours).collect();
        one.columns.keep_feedback(&one.used);
        one.has_enough().then_some(one)
    }

    fn has_enough(&self) -> bool {
        2 * self.used.iter().filter(|used| **used).count() >= FUNCTIONS
    }

    /// With exactly these periods.
    pub fn of_periods(record: &'a Record, element: &'a dyn Element, scale: f64, used: &[bool]) -> Option<Self> {
        let (response, used) = (&record.periods.response, used.to_vec());
        let logarithms = used
            .iter()
            .zip(response)
            .filter(|(used, _)| **used)
            .map(|(_, z)| z.norm().ln());
        let ends = logarithms.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], a| {
            [low.min(a), high.max(a)]
        });
        let basis = Basis { ends, size: FUNCTIONS };
        if ends[1] <= ends[0] {
            return None;
        }
        let steady: Vec<(f64, Complex64)> = (0..200)
            .map(|n| ends[0] + (ends[1] - ends[0]) * f64::from(n) / 199.0)
            .map(|a| (a, element.steady(a.exp())))
            .collect();
        let coefficients = Curve::coefficients(&basis, &steady)?;
        let lag = Complex64::ONE;
        let force = Force { element, basis, coefficients: &coefficients, lag };
        let mut columns = Columns::new(record, &force, response);
        columns.keep_feedback(&used);
        let seconds = coefficients.windows(3).map(|c| (c[0] - 2.0 * c[1] + c[2]).norm_sqr());
        let least = SHAPE * (seconds.sum::<f64>() / (FUNCTIONS - 2) as f64).sqrt() / scale;
        let own = coefficients.clone();
        let hyper = [0.03, 0.1, 1.0];
        let one = Self {
            record,
            element,
            scale,
            used,
            basis,
            coefficients,
            lag,
            hyper,
            own,
            least,
            columns,
        };
        one.has_enough().then_some(one)
    }

    /// The path as given, without the errors of it, and no curvature expected of the force: for comparison.
    pub fn with_given_path(mut self) -> Self {
        self.own.fill(Complex64::ZERO);
        self.columns.feedback.iter_mut().for_each(|one| one.fill(0.0));
        self
    }

    fn filter(&self, hyper: Hyper) -> Filter {
        let variances = [hyper[0], hyper[2]];
        Filter::new(self.record, &self.columns, &self.used, variances)
    }

    /// The unknowns for given variances; `None` where these leave no equations.
    pub fn solve(&self, hyper: Hyper) -> Option<Solution> {
        let filter = self.filter(hyper);
        let white = filter.whiten(self.record, &self.columns);
        let products = &white * white.transpose();
        let n = products.nrows() - 2;
        let information = products.view((2, 2), (n, n)).into_owned();
        let right = products.view((2, 0), (n, 2)).into_owned();
        let m = self.basis.size;
        let (mut normal, mut known) = (information.clone(), right.column(0).into_owned());
        for (part, change) in [1.0 - self.lag.re, -self.lag.im].into_iter().enumerate() {
            normal[(2 * m + part, 2 * m + part)] += U_LAG.powi(-2);
            known[2 * m + part] += change * U_LAG.powi(-2);
            normal[(2 * m + 2 + part, 2 * m + 2 + part)] += START_INFORMATION;
        }
        let constant = self.expect(&mut normal, &mut known, hyper[1]);
        let normal = normal.cholesky()?;
        let unknowns = normal.solve(&known);
        let without = filter.logarithms + products[(0, 0)];
        let deviance =
            without + constant - known.dot(&unknowns) + normal.ln_determinant() + 4.0 * (m - 2) as f64 * hyper[1].ln();
        deviance.is_finite().then_some(Solution {
            deviance,
            unknowns,
            normal,
            information: (information, right),
        })
    }

    /// Adds what is expected of the spline: second differences of its coefficients as those of the element's own force, with a variance. Returns the
    /// constant term.
    fn expect(&self, normal: &mut DMatrix<f64>, known: &mut DVector<f64>, roughness: f64) -> f64 {
        // Half of the variance for each component.
        let weight = 2.0 / (roughness * self.scale).powi(2);
        let mut constant = 0.0;
        for (first, own) in self.own.windows(3).enumerate() {
            let second = own[0] - 2.0 * own[1] + own[2];
            for (part, expected) in [second.re, second.im].into_iter().enumerate() {
                let place = |i: usize| 2 * (first + i) + part;
                for (i, a) in [1.0, -2.0, 1.0].into_iter().enumerate() {
                    for (j, b) in [1.0, -2.0, 1.0].into_iter().enumerate() {
                        normal[(place(i), place(j))] += a * b * weight;
                    }
                    known[place(i)] += a * expected * weight;
                }
                constant += expected * expected * weight;
            }
        }
        constant
    }

    /// Maximum likelihood of the three variances; path and lag follow in between.
    pub fn fit(mut self) -> Option<(Self, Solution)> {
        for round in 0..PATH_ROUNDS {
            let mut limits = VARIANCE_LIMITS;
            limits[1][0] = limits[1][0].max(self.least);
            let inside =
                |p: &[f64; 3]| -> Hyper { std::array::from_fn(|i| p[i].exp().clamp(limits[i][0], limits[i][1])) };
            let outside = |p: &[f64; 3]| -> f64 { p.iter().zip(inside(p)).map(|(p, q)| (p - q.ln()).powi(2)).sum() };
            let cost = |p: &[f64; 3]| {
                self.solve(inside(p))
                    .map_or(f64::INFINITY, |one| one.deviance + outside(p))
            };
            let (steps, most) = if round == 0 {
                ([2.0, 1.0, 0.2], 100)
            } else {
                ([0.7, 0.33, 0.07], 40)
            };
            self.hyper = inside(&simplex(self.hyper.map(f64::ln), steps, cost, [0.02, 0.05], most));
            let solution = self.solve(self.hyper)?;
            let unknowns = complex(&solution.unknowns);
            let (m, lag) = (self.basis.size, self.lag);
            self.coefficients.copy_from_slice(&unknowns[..m]);
            if round + 1 == PATH_ROUNDS {
                return Some((self, solution));
            }
            let path = self.smooth(self.hyper, &solution);
            // At most a fifth at a time: the force is linear in the factor for small changes only.
            self.lag = lag + unknowns[m] / (unknowns[m].norm() / 0.2).max(1.0);
            let force = Force {
                element: self.element,
                basis: self.basis,
                coefficients: &self.coefficients,
                lag: self.lag,
            };
            self.columns = Columns::new(self.record, &force, &path);
            self.columns.keep_feedback(&self.used);
        }
        None
    }

    /// The response of each period by a solution for given variances.
    pub fn smooth(&self, hyper: Hyper, solution: &Solution) -> Vec<Complex64> {
        self.filter(hyper)
            .smooth(self.record, &self.columns, &complex(&solution.unknowns))
    }

    /// The curve of phase resonance of a solution.
    pub fn curve(&self, solution: &Solution) -> Option<Curve> {
        let n = 2 * self.basis.size;
        let covariance = solution.normal.inverse().view((0, 0), (n, n)).into_owned();
        let (information, mut values) = solution.of_the_force(n + 2)?;
        for (part, lag) in [self.lag.re, self.lag.im].into_iter().enumerate() {
            let moved = values.column(0) + information.column(n + part) * lag;
            values.set_column(0, &moved);
        }
        let errors = DVector::from_fn(n + 2, |i, _| if i < n { 0.0 } else { U_LAG * U_LAG });
        Curve {
            linear: self.record.linear,
            power: self.record.power,
            basis: self.basis,
            coefficients: complex(&solution.unknowns)[..self.basis.size].to_vec(),
            covariance,
            information,
            expected: values.column(0).into_owned(),
            by_gain: values.column(1).into_owned(),
        }
        .with_errors(errors)
    }
}

impl Solution {
    /// Rows of what the record says of the first `n` unknowns without their prior, with variance 1, and their values, with their change by the gain of the
    /// base: the equations, without the other unknowns.
    fn of_the_force(&self, n: usize) -> Option<(DMatrix<f64>, DMatrix<f64>)> {
        let (all, right) = &self.information;
        let rest = all.nrows() - n;
        // The others keep their prior, which the equations with it contain.
        let lower = self.normal.l();
        let with_prior = (&lower * lower.transpose()).view((n, n), (rest, rest)).into_owned();
        let inverse = with_prior.cholesky()?;
        let cross = all.view((n, 0), (rest, n)).into_owned();
        let matrix = all.view((0, 0), (n, n)) - cross.tr_mul(&inverse.solve(&cross));
        let known = right.rows(0, n) - cross.tr_mul(&inverse.solve(&right.rows(n, rest).into_owned()));
        let eigen = SymmetricEigen::try_new(matrix, f64::EPSILON, 30 * n)?;
        let largest = eigen.eigenvalues.max();
        let kept: Vec<usize> = (0..n).filter(|i| eigen.eigenvalues[*i] > ROUNDING * largest).collect();
        let row = |i: &usize| eigen.eigenvectors.column(*i).transpose() * eigen.eigenvalues[*i].sqrt();
        let value = |i: &usize| eigen.eigenvectors.column(*i).tr_mul(&known) / eigen.eigenvalues[*i].sqrt();
        let [rows, values]: [Vec<_>; 2] = [kept.iter().map(row).collect(), kept.iter().map(value).collect()];
        Some((DMatrix::from_rows(&rows), DMatrix::from_rows(&values)))
    }
}

/// Information over the largest that is rounding.
const ROUNDING: f64 = 1e-9;

/// Complex numbers from their parts.
fn complex(parts: &DVector<f64>) -> Vec<Complex64> {
    parts
        .as_slice()
        .chunks_exact(2)
        .map(|pair| Complex64::new(pair[0], pair[1]))
        .collect()
}
