//! Numerical methods that several modules share: roots and minima, statistics, linear and nonlinear least squares with uncertainties.

use std::cell::RefCell;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use nalgebra::linalg::{SVD, Schur};
use nalgebra::{Complex, Const, DMatrix, DVector, DimMin, Dyn, RowSVector, SMatrix, SVector};

/// Standard errors from which on a difference is not noise: 0.3 % of normal noise is beyond.
pub const SIGNIFICANT: f64 = 3.0;
/// Standard errors up to which a difference counts as noise, as 95 % of normal noise does; the excess becomes a part of an uncertainty.
pub const RANDOM: f64 = 2.0;

/// Roots of `a x^2 + b x + c`, without cancellation; each is a continuous function of the coefficients, also through
/// `a = 0`, where one of them becomes infinite.
pub fn quadratic(a: f64, b: f64, c: f64) -> Option<[f64; 2]> {
    let discriminant = b * b - 4.0 * a * c;
    if discriminant.is_nan() || discriminant < 0.0 {
        return None;
    }
    let root = discriminant.sqrt();
    if b >= 0.0 {
        let q = -(b + root) / 2.0;
        Some([q / a, c / q])
    } else {
        let q = (root - b) / 2.0;
        Some([c / q, q / a])
    }
}

thread_local! {
    static STOP: RefCell<Option<Arc<AtomicBool>>> = const { RefCell::new(None) };
}

/// Lets `stop` end this thread: once it is true, the next iteration of a search unwinds the thread, without a message.
pub fn stop_thread_with(stop: &Arc<AtomicBool>) {
    STOP.set(Some(Arc::clone(stop)));
}

/// An iteration of a search.
fn iteration() {
    let stop = STOP.with_borrow(|stop| stop.as_ref().is_some_and(|stop| stop.load(Ordering::Relaxed)));
    if stop {
        std::panic::resume_unwind(Box::new("stopped"));
    }
}

/// As many equations as unknowns.
pub trait Equations<const N: usize> {
    /// The residuals at `x` and their derivatives by the unknowns; `None` where there are none.
    fn at(&mut self, x: &SVector<f64, N>) -> Option<(SVector<f64, N>, SMatrix<f64, N, N>)>;

    /// Other unknowns for the same solution, if they serve better from here on. Called after full steps.
    fn restarted(&mut self, _x: &SVector<f64, N>) -> Option<SVector<f64, N>> {
        None
    }
}

/// Size of the last correction of an iteration, and width to which places on a curve are located; where rounding lets a correction fall no further,
/// its largest size. The unknowns are numbers of order one.
pub(crate) const CONVERGED: f64 = 1e-12;
const CORRECTION_ROUNDING: f64 = 1e-10;
/// Largest number of steps of an iteration, of the QR algorithm for each eigenvalue: far more than one that converges needs.
pub(crate) const MOST_STEPS: usize = 100;
/// Largest number of halvings of a correction that does not reduce the residuals.
const HALVINGS: usize = 6;

/// The solution near `x` by Newton's method, in steps that reduce the norm of the residuals. Where the equations leave a direction free, the
/// correction is the smallest one.
pub fn newton<const N: usize>(equations: &mut impl Equations<N>, mut x: SVector<f64, N>) -> Option<SVector<f64, N>>
where
    Const<N>: DimMin<Const<N>, Output = Const<N>>,
{
    let (mut residual, mut jacobian) = equations.at(&x)?;
    let mut last = f64::INFINITY;
    for _ in 0..MOST_STEPS {
        let correction = solve(jacobian, &residual)?;
        let size = correction.norm();
        if size < CONVERGED || size < CORRECTION_ROUNDING && size > 0.5 * last {
            return Some(x - correction);
        }
        let shares = std::iter::successors(Some(1.0), |share| Some(0.5 * share)).take(HALVINGS);
        let next = shares.into_iter().find_map(|share| {
            let next = x - correction * share;
            let at = equations.at(&next)?;
            (at.0.norm() < residual.norm()).then_some((share, next, at))
        });
        let Some((share, next, at)) = next else {
            return (size < CORRECTION_ROUNDING).then_some(x);
        };
        (x, (residual, jacobian), last) = (next, at, size);
        if share == 1.0
            && let Some(other) = equations.restarted(&x)
        {
            x = other;
            (residual, jacobian) = equations.at(&x)?;
        }
    }
    None
}

/// The smallest solution of `matrix x = right`; `None` without [`singular_values`].
fn solve<const N: usize>(matrix: SMatrix<f64, N, N>, right: &SVector<f64, N>) -> Option<SVector<f64, N>>
where
    Const<N>: DimMin<Const<N>, Output = Const<N>>,
{
    if !matrix.iter().all(|one| one.is_finite()) {
        return None;
    }
    let lu = matrix.lu();
    let pivots = lu.lu_internal().diagonal().abs();
    // The factors show a free direction as a pivot that is rounding.
    if pivots.min() > SINGULAR * pivots.max() {
        return lu.solve(right);
    }
    let right = DVector::from_column_slice(right.as_slice());
    let factors = singular_values(DMatrix::from_column_slice(N, N, matrix.as_slice()))?;
    let least = factors.solve(&right, SINGULAR * factors.singular_values.max()).ok()?;
    Some(SVector::from_column_slice(least.as_slice()))
}

/// Singular values, in no order, and their vectors; `None` if the matrix contains NaN or infinity, or if rounding turns a singular value into one.
pub fn singular_values(matrix: DMatrix<f64>) -> Option<SVD<f64, Dyn, Dyn>> {
    let steps = MOST_STEPS * matrix.nrows();
    // With NaN or infinity the iteration does not converge.
    let is_finite = matrix.iter().all(|one| one.is_finite());
    let found = is_finite.then(|| SVD::try_new_unordered(matrix, true, true, f64::EPSILON, steps))??;
    found.singular_values.iter().all(|one| one.is_finite()).then_some(found)
}

/// Eigenvalues of a square matrix; NaN if it contains one, or where the QR algorithm does not converge: some matrices it turns for ever.
pub fn eigenvalues(matrix: DMatrix<f64>) -> Vec<Complex<f64>> {
    let size = matrix.nrows();
    let found = Schur::try_new(matrix, f64::EPSILON, MOST_STEPS * size);
    found.map_or_else(
        || vec![Complex::new(f64::NAN, f64::NAN); size],
        |schur| schur.complex_eigenvalues().as_slice().to_vec(),
    )
}

/// Pivots and singular values over the largest that are rounding.
const SINGULAR: f64 = 1e-14;

/// The root of `f` near two guesses by the secant method, whose last step is at most `tolerance`; the error is far below that. `None` where the
/// steps do not become as small, or where `f` is `None`.
pub fn secant(mut f: impl FnMut(f64) -> Option<f64>, [mut before, mut here]: [f64; 2], tolerance: f64) -> Option<f64> {
    let mut at_before = f(before)?;
    for _ in 0..MOST_STEPS {
        iteration();
        let at_here = f(here)?;
        let step = if at_here == 0.0 {
            0.0
        } else {
            at_here * (here - before) / (at_here - at_before)
        };
        (before, at_before, here) = (here, at_here, here - step);
        if step.abs() <= tolerance {
            return Some(here);
        }
    }
    None
}

/// Neighbouring doubles between `a` and `b` at which `f` differs; the first keeps the value that `f` has at `a`.
pub fn bisection(a: f64, b: f64, mut f: impl FnMut(f64) -> bool) -> (f64, f64) {
    let at_a = f(a);
    try_bisection(a, b, 0.0, |x| Some(f(x) == at_a)).unwrap_or((a, b))
}

/// Ends of an interval, at most `width` wide or of neighbouring doubles, at which `like_a` changes; it is true at `a`. `None` where it has no value.
pub fn try_bisection(
    mut a: f64,
    mut b: f64,
    width: f64,
    mut like_a: impl FnMut(f64) -> Option<bool>,
) -> Option<(f64, f64)> {
    while (b - a).abs() > width {
        iteration();
        let middle = a + (b - a) / 2.0;
        if middle <= a.min(b) || middle >= a.max(b) {
            break;
        }
        if like_a(middle)? {
            a = middle;
        } else {
            b = middle;
        }
    }
    Some((a, b))
}

/// Minimum of `f` between `a` and `b` by golden-section search; `f` has one minimum there.
pub fn golden_section(mut a: f64, mut b: f64, f: impl Fn(f64) -> f64) -> f64 {
    let ratio = (5f64.sqrt() - 1.0) / 2.0;
    let (mut x, mut y) = (b - ratio * (b - a), a + ratio * (b - a));
    let (mut fx, mut fy) = (f(x), f(y));
    // 60 steps shrink the interval by 3e-13: beyond that a minimum is flat in doubles.
    for _ in 0..60 {
        if fx <= fy {
            (b, y, fy) = (y, x, fx);
            x = b - ratio * (b - a);
            fx = f(x);
        } else {
            (a, x, fx) = (x, y, fy);
            y = a + ratio * (b - a);
            fy = f(y);
        }
    }
    a + (b - a) / 2.0
}

/// Arithmetic mean; NaN for no values.
pub fn mean(values: impl IntoIterator<Item = f64>) -> f64 {
    let (mut sum, mut count) = (0.0, 0_usize);
    for value in values {
        sum += value;
        count += 1;
    }
    sum / count as f64
}

/// Mean of the squares; NaN for no values.
pub fn mean_square(values: impl IntoIterator<Item = f64>) -> f64 {
    mean(values.into_iter().map(|value| value * value))
}

/// Standard deviation of the values themselves (divided by n), not of a population they stand for; NaN for no values.
pub fn standard_deviation(values: &[f64]) -> f64 {
    let mean = mean(values.iter().copied());
    mean_square(values.iter().map(|value| value - mean)).sqrt()
}

/// Smallest and largest of `start` and the values.
pub fn range(start: (f64, f64), values: impl IntoIterator<Item = f64>) -> (f64, f64) {
    values
        .into_iter()
        .fold(start, |(low, high), value| (low.min(value), high.max(value)))
}

/// `count` values from `from` to `to` at equal distances, both ends included.
pub fn equally_spaced(from: f64, to: f64, count: usize) -> impl Iterator<Item = f64> + Clone {
    let steps = count.saturating_sub(1).max(1) as f64;
    (0..count).map(move |n| from + (to - from) * n as f64 / steps)
}

/// Standard deviation of the white noise on a smooth signal, from third differences; 0 for fewer than six values.
pub fn noise(values: &[f64]) -> f64 {
    noise_at(values, 1, [0.0; 3])
}

/// As [`noise`], of values `stride` apart, and of noise whose correlation over one, two and three strides is this.
pub fn noise_at(values: &[f64], stride: usize, [one, two, three]: [f64; 3]) -> f64 {
    let windows = values.windows(3 * stride + 1);
    if windows.len() < 3 {
        return 0.0;
    }
    let differences = windows.map(|v| v[3 * stride] - 3.0 * v[2 * stride] + 3.0 * v[stride] - v[0]);
    // White noise of variance 1 gives them the variance 1 + 9 + 9 + 1.
    let variance = 20.0 - 30.0 * one + 12.0 * two - 2.0 * three;
    (mean_square(differences) / variance).sqrt()
}

/// Weights of the values at some places in the polynomial through all of them (Lagrange), at `x`.
pub fn lagrange(places: &[f64], x: f64) -> impl Iterator<Item = f64> {
    places.iter().enumerate().map(move |(i, place)| {
        let others = places.iter().enumerate().filter(|(j, _)| *j != i);
        others.map(|(_, other)| (x - other) / (place - other)).product()
    })
}

/// Slope of the straight line that fits equally spaced values best, from a value to the next.
pub fn slope(values: &[f64]) -> f64 {
    let n = values.len() as f64;
    let middle = 0.5 * (n - 1.0);
    let mean = mean(values.iter().copied());
    let spread = n * (n * n - 1.0) / 12.0;
    let moment = |(i, value): (usize, &f64)| (i as f64 - middle) * (value - mean);
    values.iter().enumerate().map(moment).sum::<f64>() / spread
}

/// Coefficients, and the inverse of the matrix of the normal equations.
pub type ComplexFit<const N: usize> = (SVector<Complex<f64>, N>, SMatrix<Complex<f64>, N, N>);

/// Linear least squares of complex numbers, from rows and their values. `None` where the rows do not determine the coefficients.
pub fn complex_fit<const N: usize>(
    rows: impl Iterator<Item = (RowSVector<Complex<f64>, N>, Complex<f64>)>,
) -> Option<ComplexFit<N>> {
    let (mut normal, mut right) = (SMatrix::zeros(), SVector::zeros());
    for (row, value) in rows {
        normal += row.adjoint() * row;
        right += row.adjoint() * value;
    }
    let inverse = normal.try_inverse()?;
    Some((inverse * right, inverse))
}

/// Residuals over their standard uncertainties, whose sum of squares is to be minimised.
pub trait Misfit<const N: usize> {
    /// What an evaluation leaves for the next one nearby: where inner searches ended.
    type Trace: Clone;

    /// The residuals at `x`; `None` where the model does not exist.
    fn residuals(&self, x: &SVector<f64, N>, near: &Self::Trace) -> Option<(Vec<f64>, Self::Trace)>;

    /// Derivatives of the residuals by the unknowns. `at`: the trace of the residuals at `x`.
    fn derivatives(&self, x: &SVector<f64, N>, at: &Self::Trace) -> Option<Vec<SVector<f64, N>>>;

    /// Smallest and largest values of the unknowns.
    fn limits(&self) -> [[f64; 2]; N] {
        [[f64::NEG_INFINITY, f64::INFINITY]; N]
    }
}

/// A least-squares fit of a nonlinear model.
#[derive(Debug, Clone)]
pub struct LeastSquares<const N: usize, T> {
    /// The unknowns.
    pub x: SVector<f64, N>,
    /// Sum of the squares of the residuals.
    pub chi_square: f64,
    /// Residuals over their standard uncertainties, and their derivatives.
    pub residuals: Vec<f64>,
    /// Derivatives of the residuals by the unknowns.
    pub derivatives: Vec<SVector<f64, N>>,
    /// What the last evaluation left.
    pub trace: T,
}

impl<const N: usize, T: Clone> LeastSquares<N, T>
where
    Const<N>: DimMin<Const<N>, Output = Const<N>>,
{
    /// The fit at `x`, without a search.
    pub fn at(model: &impl Misfit<N, Trace = T>, x: SVector<f64, N>, near: &T) -> Option<Self> {
        Self::of(model, x, model.residuals(&x, near)?)
    }

    fn of(model: &impl Misfit<N, Trace = T>, x: SVector<f64, N>, (residuals, trace): (Vec<f64>, T)) -> Option<Self> {
        let derivatives = model.derivatives(&x, &trace)?;
        let chi_square = squares(&residuals).filter(|sum| sum.is_finite())?;
        Some(Self { x, chi_square, residuals, derivatives, trace })
    }

    /// The minimum near `x` by the method of Levenberg and Marquardt, within the limits. It is reached where a further step would reduce the sum
    /// of squares by less than `tolerance`, relative to one and the sum.
    ///
    /// A step that does not reduce the sum is corrected by what the residuals there are not linear in, as long as that reduces the sum (second-order
    /// correction; Nocedal and Wright, Numerical Optimization, section 18.3). Where some unknowns are determined a thousand times better than others,
    /// the valley is narrow and curved, and only such steps are long.
    pub fn minimum(model: &impl Misfit<N, Trace = T>, x: SVector<f64, N>, near: &T, tolerance: f64) -> Option<Self> {
        let mut here = Self::at(model, x, near)?;
        let limits = model.limits();
        let mut damping = 1e-3;
        for _ in 0..MOST_STEPS {
            let least = tolerance * (1.0 + here.chi_square);
            let (normal, gradient, is_free) = here.free(&limits);
            // Where the matrix is singular some direction is free, and has no step.
            if normal
                .cholesky()
                .is_some_and(|one| one.solve(&gradient).dot(&gradient) < least)
            {
                break;
            }
            let next = loop {
                let mut damped = normal;
                for i in 0..N {
                    damped[(i, i)] *= 1.0 + damping;
                }
                let factors = damped.cholesky()?;
                let straight = -factors.solve(&gradient);
                let (mut step, mut last) = (straight, f64::INFINITY);
                let better = loop {
                    iteration();
                    let next = SVector::from_fn(|i, _| (here.x[i] + step[i]).clamp(limits[i][0], limits[i][1]));
                    let Some((values, trace)) = model.residuals(&next, &here.trace) else {
                        break None;
                    };
                    let sum = squares(&values).unwrap_or(f64::INFINITY);
                    if sum <= here.chi_square {
                        break Some((next, (values, trace)));
                    }
                    if sum >= last {
                        break None;
                    }
                    last = sum;
                    let bend = here.nonlinear(&(next - here.x), &values);
                    step = straight - factors.solve(&bend.component_mul(&is_free));
                };
                if let Some((next, better)) = better {
                    damping *= 0.1;
                    break Self::of(model, next, better);
                }
                // A step that rounding hides.
                if damping > 1e12 {
                    break None;
                }
                damping *= 10.0;
            };
            let Some(next) = next else { break };
            let gained = here.chi_square - next.chi_square;
            here = next;
            if gained.abs() < 1e-3 * least {
                break;
            }
        }
        Some(here)
    }

    /// What the residuals after a step are not linear in, times the derivatives.
    fn nonlinear(&self, step: &SVector<f64, N>, there: &[f64]) -> SVector<f64, N> {
        let mut sum = SVector::zeros();
        for ((there, here), row) in there.iter().zip(&self.residuals).zip(&self.derivatives) {
            sum += row * (there - here - row.dot(step));
        }
        sum
    }

    /// Matrix and gradient of the normal equations, and which unknowns are free (1): one that its limit holds has the equation "no step".
    fn free(&self, limits: &[[f64; 2]; N]) -> (SMatrix<f64, N, N>, SVector<f64, N>, SVector<f64, N>) {
        let (mut normal, mut gradient) = self.equations();
        let mut is_free = SVector::from_element(1.0);
        for i in 0..N {
            let [low, high] = limits[i];
            if self.x[i] <= low && gradient[i] > 0.0 || self.x[i] >= high && gradient[i] < 0.0 {
                normal.row_mut(i).fill(0.0);
                normal.column_mut(i).fill(0.0);
                (normal[(i, i)], gradient[i], is_free[i]) = (1.0, 0.0, 0.0);
            }
        }
        (normal, gradient, is_free)
    }

    /// Matrix and right-hand side of the normal equations; their solution is the step to the minimum, with the opposite sign.
    pub fn equations(&self) -> (SMatrix<f64, N, N>, SVector<f64, N>) {
        let (mut normal, mut gradient) = (SMatrix::<f64, N, N>::zeros(), SVector::zeros());
        for (residual, row) in self.residuals.iter().zip(&self.derivatives) {
            normal.ger(1.0, row, row, 1.0);
            gradient += row * *residual;
        }
        (normal, gradient)
    }

    /// Covariance of the unknowns: NaN where the residuals do not determine them.
    pub fn covariance(&self) -> SMatrix<f64, N, N> {
        let (normal, _) = self.equations();
        normal
            .cholesky()
            .map_or(SMatrix::from_element(f64::NAN), |matrix| matrix.inverse())
    }
}

/// Sum of the squares; `None` if it is not finite.
fn squares(values: &[f64]) -> Option<f64> {
    let sum: f64 = values.iter().map(|value| value * value).sum();
    sum.is_finite().then_some(sum)
}

/// A value and its standard uncertainty: the value ± 1.96 uncertainties is a 95 % interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate {
    /// The value.
    pub value: f64,
    /// Its standard uncertainty, in the same unit.
    pub uncertainty: f64,
}

/// Quantile of the normal distribution for a two-sided interval of 95 %.
const NORMAL: f64 = 1.959_964;

impl Estimate {
    /// An estimate from a value and the independent parts of its uncertainty.
    pub fn new(value: f64, parts: &[f64]) -> Self {
        let uncertainty = parts.iter().map(|part| part * part).sum::<f64>().sqrt();
        Self { value, uncertainty }
    }

    /// The mean of independent values, with Student's distribution.
    pub fn mean(values: &[f64]) -> Self {
        let (count, value) = (values.len() as f64, mean(values.iter().copied()));
        let scatter = standard_deviation(values) * (count / (count - 1.0)).sqrt();
        let uncertainty = scatter * student_factor(count - 1.0) / count.sqrt();
        Self { value, uncertainty }
    }

    /// In another unit.
    pub fn scaled(self, factor: f64) -> Self {
        Self {
            value: self.value * factor,
            uncertainty: self.uncertainty * factor.abs(),
        }
    }
}

/// Half width of a 95 % interval of Student's distribution over the half width of a normal distribution's (Cornish and Fisher's expansion;
/// within 1 % from 4 degrees of freedom on).
pub fn student_factor(degrees: f64) -> f64 {
    let (z, n) = (NORMAL, degrees.max(1.0));
    let first = (z.powi(3) + z) / (4.0 * n);
    let second = (5.0 * z.powi(5) + 16.0 * z.powi(3) + 3.0 * z) / (96.0 * n * n);
    let third = (3.0 * z.powi(7) + 19.0 * z.powi(5) + 17.0 * z.powi(3) - 15.0 * z) / (384.0 * n * n * n);
    1.0 + (first + second + third) / z
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_matrix_without_eigenvalues_or_a_solution_ends_the_search_for_them() {
        let nothing = DMatrix::from_element(4, 4, f64::NAN);
        assert!(eigenvalues(nothing).iter().all(|one| one.re.is_nan()));
        let mut one = DMatrix::identity(4, 4);
        one[(2, 1)] = f64::INFINITY;
        assert!(eigenvalues(one).iter().all(|one| one.re.is_nan()));
        let matrix = SMatrix::<f64, 4, 4>::from_element(f64::NAN);
        assert_eq!(solve(matrix, &SVector::from_element(1.0)), None);
        // Its elements are 200 orders of magnitude apart: nalgebra finds NaN for a singular value.
        let (far, near) = (4.397322051532504e85, 1.396306947894183e-119);
        let matrix = SMatrix::<f64, 4, 4>::from_row_slice(
            &[
                [-far, -far, 3.9327393867238056e-45, 0.0],
                [0.0, 0.0, 0.0, 6.77073453386716e-61],
                [0.0; 4],
                [near, near, 0.0, -4.922498105141392e99],
            ]
            .concat(),
        );
        assert_eq!(solve(matrix, &SVector::from_element(1.0)), None);
    }

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

    /// The valley of Rosenbrock, whose minimum is at (1, 1): the limits, and how narrow it is (10 in his example).
    struct Valley([[f64; 2]; 2], f64);

    impl Misfit<2> for Valley {
        type Trace = ();

        fn residuals(&self, x: &SVector<f64, 2>, (): &()) -> Option<(Vec<f64>, ())> {
            // There is no model where the first unknown is below -2.
            (x[0] > -2.0).then_some((vec![self.1 * (x[1] - x[0] * x[0]), 1.0 - x[0]], ()))
        }

        fn derivatives(&self, x: &SVector<f64, 2>, (): &()) -> Option<Vec<SVector<f64, 2>>> {
            Some(vec![
                SVector::from([-2.0 * self.1 * x[0], self.1]),
                SVector::from([-1.0, 0.0]),
            ])
        }

        fn limits(&self) -> [[f64; 2]; 2] {
            self.0
        }
    }

    #[test]
    fn least_squares_follow_a_curved_valley_and_stay_within_the_limits() {
        let free = [[f64::NEG_INFINITY, f64::INFINITY]; 2];
        let found = |valley| LeastSquares::minimum(&valley, SVector::from([-1.2, 1.0]), &(), 1e-14).unwrap();
        // Straight steps alone take 23, 717 and several thousand.
        for narrow in [10.0, 1e3, 1e5] {
            let x = found(Valley(free, narrow)).x;
            assert!((x - SVector::from([1.0, 1.0])).norm() < 1e-6, "{narrow:e}: {x}");
        }
        // The inverse of J^T J at (1, 1).
        let covariance = found(Valley(free, 10.0)).covariance();
        assert!((covariance - SMatrix::from([[1.0, 2.0], [2.0, 4.01]])).norm() < 1e-4);
        // With x at most 0.5 the minimum is on the limit: y = x².
        let limited = [[f64::NEG_INFINITY, 0.5], free[1]];
        let x = found(Valley(limited, 10.0)).x;
        assert!((x - SVector::from([0.5, 0.25])).norm() < 1e-6, "{x}");
        assert!(LeastSquares::minimum(&Valley(free, 10.0), SVector::from([-3.0, 1.0]), &(), 1e-12).is_none());
    }
}
