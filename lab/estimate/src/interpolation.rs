//! Cubic splines: through given values, and as a basis for an unknown function.

use num_complex::Complex64;

/// The cubic spline through given values, whose third derivative is continuous at the second and the last but one ("not a knot").
#[derive(Debug, Clone)]
pub struct CubicSpline {
    x: Vec<f64>,
    y: Vec<Complex64>,
    slopes: Vec<Complex64>,
}

impl CubicSpline {
    /// Through `y` at at least four rising `x`.
    pub fn new(x: Vec<f64>, y: Vec<Complex64>) -> Self {
        let slopes = slopes(&x, &y);
        Self { x, y, slopes }
    }

    /// Values, and derivatives, at `x`; beyond the ends the last cubics continue.
    pub fn at(&self, x: f64) -> [Complex64; 2] {
        let last = self.x.len() - 2;
        let i = self.x.partition_point(|knot| *knot <= x).saturating_sub(1).min(last);
        let h = self.x[i + 1] - self.x[i];
        let (t, rise) = (x - self.x[i], (self.y[i + 1] - self.y[i]) / h);
        let [a, b] = [self.slopes[i], self.slopes[i + 1]];
        let third = (a + b - rise * 2.0) / (h * h);
        let second = (rise - a) / h - third * h;
        [
            self.y[i] + (a + (second + third * t) * t) * t,
            a + (second * 2.0 + third * (3.0 * t)) * t,
        ]
    }
}

/// Slopes of the spline at its knots, from a system of three diagonals.
fn slopes(x: &[f64], y: &[Complex64]) -> Vec<Complex64> {
    let n = x.len();
    let h: Vec<f64> = x.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let rise: Vec<Complex64> = (0..n - 1).map(|i| (y[i + 1] - y[i]) / h[i]).collect();
    // Rows (below, on, above, right) of the equations.
    let end = |h: [f64; 2], rise: [Complex64; 2]| {
        let d = h[0] + h[1];
        (rise[0] * ((h[0] + 2.0 * d) * h[1]) + rise[1] * (h[0] * h[0])) / d
    };
    let mut rows = vec![(0.0, h[1], h[0] + h[1], end([h[0], h[1]], [rise[0], rise[1]]))];
    rows.extend((1..n - 1).map(|i| {
        let right = (rise[i - 1] * h[i] + rise[i] * h[i - 1]) * 3.0;
        (h[i], 2.0 * (h[i - 1] + h[i]), h[i - 1], right)
    }));
    let [p, q] = [n - 2, n - 3];
    rows.push((h[p] + h[q], h[q], 0.0, end([h[p], h[q]], [rise[p], rise[q]])));
    for i in 1..n {
        let (_, on, above, right) = rows[i - 1];
        let factor = rows[i].0 / on;
        rows[i].1 -= factor * above;
        rows[i].3 -= right * factor;
    }
    let mut slopes = vec![Complex64::ZERO; n];
    for i in (0..n).rev() {
        let (_, on, above, right) = rows[i];
        let next = slopes.get(i + 1).copied().unwrap_or_default();
        slopes[i] = (right - next * above) / on;
    }
    slopes
}

/// The four cubic B-splines that are not zero at a point: the number of the first, their values, and their derivatives.
#[derive(Debug, Clone, Copy)]
pub struct Local {
    /// The first of them.
    pub first: usize,
    /// Their values.
    pub values: [f64; 4],
    /// Their derivatives by the variable of the basis.
    pub slopes: [f64; 4],
}

impl Local {
    /// The sum of the functions with these coefficients.
    pub fn sum(&self, coefficients: &[Complex64]) -> Complex64 {
        self.by(&self.values, coefficients)
    }

    /// The derivative of the sum.
    pub fn slope(&self, coefficients: &[Complex64]) -> Complex64 {
        self.by(&self.slopes, coefficients)
    }

    fn by(&self, values: &[f64; 4], coefficients: &[Complex64]) -> Complex64 {
        let local = &coefficients[self.first..self.first + 4];
        local.iter().zip(values).map(|(c, value)| c * value).sum()
    }
}

/// Cubic B-splines over the logarithm of an amplitude, uniform in `sqrt(ln(A/A_lowest) + 0.1)`: the force of a motion that ends in a fold is a
/// square root there, and in this variable its curvature is even.
#[derive(Debug, Clone, Copy)]
pub struct Basis {
    /// Logarithms of the lowest and the highest amplitude.
    pub ends: [f64; 2],
    /// Number of functions.
    pub size: usize,
}

/// Shift that keeps the variable of the basis regular at the lowest amplitude.
const SHIFT: f64 = 0.1;

impl Basis {
    /// The functions at the logarithm `a` of an amplitude; constant beyond the ends.
    pub fn at(&self, a: f64) -> Local {
        let [low, high] = self.ends;
        let variable = |a: f64| (a - low + SHIFT).sqrt();
        let [from, to] = [low, high].map(variable);
        let (root, steps) = (variable(a.clamp(low, high)), (self.size - 3) as f64);
        let scale = steps / (to - from);
        let place = ((root - from) * scale).clamp(0.0, steps * (1.0 - 1e-12));
        let (first, u) = (place.floor(), place.fract());
        let v = 1.0 - u;
        let values = [
            v.powi(3),
            (3.0 * u - 6.0) * u * u + 4.0,
            (3.0 * v - 6.0) * v * v + 4.0,
            u.powi(3),
        ];
        let slopes = [-v * v, u * (3.0 * u - 4.0), v * (4.0 - 3.0 * v), u * u];
        let inside = if (low..=high).contains(&a) { 1.0 } else { 0.0 };
        Local {
            first: first as usize,
            values: values.map(|value| value / 6.0),
            slopes: slopes.map(|slope| inside * slope / 2.0 * scale / (2.0 * root)),
        }
    }

    /// `count` logarithms of amplitudes, evenly spaced in the variable of the basis.
    pub fn spread(&self, count: usize) -> impl Iterator<Item = f64> + use<> {
        let [low, high] = self.ends;
        let [from, to] = [SHIFT.sqrt(), (high - low + SHIFT).sqrt()];
        (0..count).map(move |n| {
            let root = from + (to - from) * n as f64 / (count - 1) as f64;
            low + root * root - SHIFT
        })
    }
}

/// Derivatives of values at rising `x` by differences of second order, of first order at the ends.
pub fn gradient(y: &[Complex64], x: &[f64]) -> Vec<Complex64> {
    let n = x.len();
    let rise = |i: usize| (y[i + 1] - y[i]) / (x[i + 1] - x[i]);
    let at = |i: usize| match i {
        0 => rise(0),
        i if i == n - 1 => rise(n - 2),
        i => {
            let [before, after] = [x[i] - x[i - 1], x[i + 1] - x[i]];
            (rise(i - 1) * after + rise(i) * before) / (before + after)
        }
    };
    (0..n).map(at).collect()
}

/// Second derivatives of values at rising `x` by second differences, at the ends those next to them.
pub fn curvature(y: &[Complex64], x: &[f64]) -> Vec<Complex64> {
    let rise = |i: usize| (y[i + 1] - y[i]) / (x[i + 1] - x[i]);
    let at = |i: usize| {
        let i = i.clamp(1, x.len() - 2);
        (rise(i) - rise(i - 1)) * (2.0 / (x[i + 1] - x[i - 1]))
    };
    (0..x.len()).map(at).collect()
}

/// Continuous angles, from those between -pi and pi.
pub fn unwrapped(angles: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut before = None;
    angles
        .map(|angle| {
            let turns = before.map_or(0.0, |before: f64| ((before - angle) / std::f64::consts::TAU).round());
            let angle = angle + turns * std::f64::consts::TAU;
            before = Some(angle);
            angle
        })
        .collect()
}
