//! Drive and frequency of phase resonance, from the force.
//!
//! At the amplitude A the base X that holds the response, `A (1 - w² + 2 i zeta w) = X (1 + 2 i zeta w) + S w^power` with the frequency w over
//! omega0, leads it by a quarter of a period at w = omega_R; then `X = i E_R`.

use nalgebra::{DMatrix, DVector};
use num_complex::Complex64;

use crate::interpolation::{Basis, CubicSpline};
use crate::linear::Linear;

/// Points of a curve by which its coefficients are determined, per function.
const POINTS: usize = 6;

/// The force over the amplitude, and all that follows from it.
#[derive(Debug, Clone)]
pub struct Curve {
    /// The linear response that belongs to the force.
    pub linear: Linear,
    /// Power of the frequency by which the force grows.
    pub power: i32,
    /// Functions of the force.
    pub basis: Basis,
    /// Their coefficients.
    pub coefficients: Vec<Complex64>,
    /// Covariance of their real and imaginary parts.
    pub covariance: DMatrix<f64>,
    /// Rows, of variance 1, of what the record says of the coefficients and of the factor of the lag, without any prior.
    pub information: DMatrix<f64>,
    /// The measured values of these rows.
    pub expected: DVector<f64>,
    /// Change of the measured values where the base reads too much, over the share of it.
    pub by_gain: DVector<f64>,
}

/// Drive and frequency of phase resonance at some amplitudes.
#[derive(Debug, Clone)]
pub struct Resonance {
    /// Amplitudes of the base, m.
    pub drive: Vec<f64>,
    /// Frequencies, rad/s.
    pub omega: Vec<f64>,
    /// Covariance: all drives first, then all frequencies.
    pub covariance: DMatrix<f64>,
}

/// Points (amplitude m, drive m, frequency rad/s) of a backbone, by rising amplitude.
pub type Backbone = Vec<[f64; 3]>;

impl Curve {
    /// The coefficients that fit a force given at logarithms of amplitudes best. `None` where these are too few.
    pub fn coefficients(basis: &Basis, force: &[(f64, Complex64)]) -> Option<Vec<Complex64>> {
        let mut matrix = DMatrix::zeros(force.len(), basis.size);
        for (row, (a, _)) in force.iter().enumerate() {
            let local = basis.at(*a);
            for (n, value) in local.values.iter().enumerate() {
                matrix[(row, local.first + n)] = *value;
            }
        }
        let right = DMatrix::from_fn(force.len(), 2, |row, part| {
            if part == 0 { force[row].1.re } else { force[row].1.im }
        });
        let factors = matrix.tr_mul(&matrix).cholesky()?;
        let found = factors.solve(&matrix.tr_mul(&right));
        Some(
            (0..basis.size)
                .map(|n| Complex64::new(found[(n, 0)], found[(n, 1)]))
                .collect(),
        )
    }

    /// The base that holds the response of an amplitude at a frequency under a force, relative to the response.
    fn base(&self, amplitude: f64, omega: f64, force: Complex64) -> Complex64 {
        let ratio = omega / self.linear.omega0;
        (amplitude * self.linear.taken(omega) - force * ratio.powi(self.power)) / self.linear.base(omega)
    }

    /// Drive and frequency at these amplitudes, m.
    pub fn at(&self, amplitudes: &[f64]) -> Resonance {
        let count = amplitudes.len();
        let h = 1e-5 * self.linear.omega0;
        let mut jacobian = DMatrix::zeros(2 * count, self.covariance.nrows());
        let (mut drive, mut frequency) = (Vec::new(), Vec::new());
        for (row, amplitude) in amplitudes.iter().enumerate() {
            let local = self.basis.at(amplitude.ln());
            let force = local.sum(&self.coefficients);
            let base = |omega: f64| self.base(*amplitude, omega, force);
            let slope = |omega: f64| (base(omega + h) - base(omega)) / h;
            let mut omega = self.linear.omega0;
            for _ in 0..30 {
                omega -= base(omega).re / slope(omega).re;
            }
            drive.push(base(omega).im);
            frequency.push(omega);
            // A change of the force moves the base by minus this gain; the frequency keeps its real part zero.
            let gain = (omega / self.linear.omega0).powi(self.power) / self.linear.base(omega);
            let slope = slope(omega);
            for (n, value) in local.values.iter().enumerate() {
                for (part, unit) in [gain, gain * Complex64::i()].into_iter().enumerate() {
                    let moved = unit.re / slope.re;
                    let column = 2 * (local.first + n) + part;
                    jacobian[(row, column)] = value * (slope.im * moved - unit.im);
                    jacobian[(count + row, column)] = value * moved;
                }
            }
        }
        let covariance = &jacobian * &self.covariance * jacobian.transpose();
        Resonance { drive, omega: frequency, covariance }
    }

    /// The curve as it is stated: beside noise, drive and amplitude have a relative standard uncertainty of `share`, and the frequency that share of the
    /// half-power bandwidth. The errors of the functions are independent. `None` where rounding leaves no covariance.
    pub fn resolved(mut self, share: f64) -> Option<Self> {
        // The amplitude at which each function counts most.
        let amplitudes: Vec<f64> = self.basis.spread(self.basis.size).map(f64::exp).collect();
        let at = self.at(&amplitudes);
        let variance = |n: usize| {
            let (amplitude, drive) = (amplitudes[n / 2], at.drive[n / 2]);
            let of = match n % 2 {
                // The force that moves the frequency: A (1 - w²).
                0 => 4.0 * self.linear.zeta * amplitude,
                _ => std::f64::consts::SQRT_2 * drive,
            };
            (share * of).powi(2)
        };
        let n = self.covariance.nrows();
        let floor = DVector::from_fn(self.information.ncols(), |i, _| if i < n { variance(i) } else { 0.0 });
        self.covariance += DMatrix::from_diagonal(&floor.rows(0, n).into_owned());
        self.with_errors(floor)
    }

    /// With independent errors of these variances, of the functions and of the factor of the lag. `None` where rounding leaves no covariance.
    pub(crate) fn with_errors(mut self, variances: DVector<f64>) -> Option<Self> {
        let floor = DMatrix::from_diagonal(&variances);
        let rows = self.information.nrows();
        let of_rows = DMatrix::identity(rows, rows) + &self.information * floor * self.information.transpose();
        let whitened = of_rows.cholesky()?.l();
        self.information = whitened.solve_lower_triangular(&self.information)?;
        for values in [&mut self.expected, &mut self.by_gain] {
            *values = whitened.solve_lower_triangular(values)?;
        }
        Some(self)
    }

    /// What the record contradicts in a backbone, if the lag of its element has this factor and its base reads the share `gain` too much: residuals of
    /// variance 1. Beyond its ends the backbone's force continues as it ends. `None` for fewer than four points, and for points that do not rise.
    pub fn residuals(&self, backbone: &[[f64; 3]], lag: Complex64, gain: f64) -> Option<DVector<f64>> {
        let logarithms: Vec<f64> = backbone.iter().map(|point| point[0].ln()).collect();
        let (first, last) = (*logarithms.first()?, *logarithms.last()?);
        // No number rises.
        if logarithms.len() < 4 || !logarithms.windows(2).all(|pair| pair[0] < pair[1]) {
            return None;
        }
        let spline = CubicSpline::new(
            logarithms,
            backbone
                .iter()
                .map(|point| self.linear.force_at_resonance(*point, self.power))
                .collect(),
        );
        let at = |a: f64| (a, spline.at(a.clamp(first, last))[0]);
        let force: Vec<(f64, Complex64)> = self.basis.spread(POINTS * self.basis.size).map(at).collect();
        let coefficients = Self::coefficients(&self.basis, &force)?;
        let parts: Vec<f64> = coefficients.iter().chain([&lag]).flat_map(|c| [c.re, c.im]).collect();
        Some(&self.information * DVector::from_vec(parts) - &self.expected - &self.by_gain * gain)
    }
}
