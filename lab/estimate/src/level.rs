//! Drive and frequency of phase resonance from periods at about one amplitude: a held level, a leg of a search, a lock.
//!
//! The complex amplitude z of the response follows the drive X by
//!
//! ```text
//! z' = g X + Lambda z,    Lambda = Lambda0 + Lambda1 (a + lag a'),    a = ln(|z|/mean |z|),    measured z = z + ring + noise,
//! ```
//!
//! where g is known, and Lambda = `-g E_R/A + i (omega_R - omega of the frame)` is the force of what is inside the rig. Of the logarithm L of z this is
//! `L' = g X/z + Lambda`, linear in all that is unknown: L at the start, Lambda0, Lambda1, its product with the lag, what disturbs the drive, and an amplitude
//! for each other mode that rings with its known pole. The path of z is measured; its errors are a state of two real numbers, because X is the same
//! on the true path: `g X/z` has another value there. A Kalman filter over periods whitens both against noise of response and drive, and least
//! squares gives the unknowns with their covariance. Further passes run along the path without noise and rings that the one
//! before found, with its slope.

use nalgebra::{DMatrix, DVector, Matrix2};
use num_complex::Complex64;

use crate::filter::{Step, pair, rotation, smooth, whiten};

/// Periods of a motion, of about one amplitude.
#[derive(Debug, Clone)]
pub struct Motion {
    /// Mean times, s.
    pub time: Vec<f64>,
    /// Logarithm of the complex amplitude of the response in the frame, with a continuous phase.
    pub response: Vec<Complex64>,
    /// What the drive adds to it: `g X/z`, 1/s.
    pub drive: Vec<Complex64>,
    /// Variances of each component of the two by noise.
    pub noise: [f64; 2],
    /// What disturbs the drive.
    pub disturbances: Vec<Disturbance>,
    /// Poles of other modes that may ring in the response, relative to the frame, 1/s.
    pub rings: Vec<Complex64>,
    /// Expected components of Lambda1 and their standard deviations, 1/s, from neighbouring levels.
    pub slope: Option<[[f64; 2]; 2]>,
    /// Largest lag of the force behind the amplitude, s; 0 for a force that follows at once.
    pub lag: f64,
}

/// A part of the drive with an unknown real factor.
#[derive(Debug, Clone)]
pub struct Disturbance {
    /// What a factor of one adds to the drive of each period, 1/s.
    pub rates: Vec<Complex64>,
    /// Prior standard deviation of the factor, whose mean is 0.
    pub deviation: f64,
}

/// The force of the rig at the mean amplitude.
#[derive(Debug, Clone)]
pub struct Level {
    /// Mean logarithm of the amplitude of the response without rings, to which the force belongs.
    pub amplitude: f64,
    /// Variance of that mean by noise.
    noise: f64,
    /// Prior standard deviation of the components of Lambda1.
    deviations: [f64; 2],
    /// Largest change of the force by its lag, 1/s.
    late: f64,
    /// The last of them are the factors of the disturbances.
    unknowns: DVector<f64>,
    disturbances: usize,
    covariance: DMatrix<f64>,
    /// Whitened innovations, two of each period, of variance 1 if the model describes the periods.
    innovations: Vec<f64>,
    /// Sum of squares of the innovations and of the unknowns over their priors, and its degrees of freedom.
    chi_square: [f64; 2],
}

/// Standard deviation of the components of Lambda1, over the size of the force: vibro-impact rigs have slopes of `E_R` from -1 to 3 times `E_R/A`.
const SLOPE: f64 = 3.0;
/// Standard deviation of a ring over the response: a mode that rings more is the one that is measured.
const RING: f64 = 1.0;
/// Passes after the first one, along the path without noise and rings that the one before found.
const REPEATED: usize = 3;
/// Standard deviations of normal noise that are exceeded with a probability of 1e-3.
pub(crate) const SURE: f64 = 3.09;
/// Places of Lambda0, of Lambda1 and of its product with a lag among the unknowns; a complex one has two.
const FORCE: usize = 2;
const SLOPES: usize = 4;
const LAG: usize = 6;

/// How an unknown, or what is known, acts.
struct Column {
    /// On the logarithm, from the period before to each period, on the first one as well; and on the measured logarithm alone.
    acts: Vec<[Complex64; 2]>,
    /// Expected value and its standard deviation.
    expected: [f64; 2],
}

/// What a pass assumes.
struct Assumed {
    /// Logarithm of the response without rings and noise, what is measured relative to it, and the drive along it.
    path: Vec<Complex64>,
    measured: Vec<Complex64>,
    drive: Vec<Complex64>,
    /// Logarithm of the amplitude along it, relative to its mean.
    changes: Vec<f64>,
    /// Expected components of Lambda1, and their standard deviations.
    slope: [[f64; 2]; 2],
    /// Prior standard deviation of its product with the lag.
    lag: f64,
}

impl Assumed {
    /// Along this path; `None` where a ring would be larger than the response.
    fn along(motion: &Motion, path: Vec<Complex64>, slope: [[f64; 2]; 2], lag: f64) -> Option<Self> {
        let apart: Vec<Complex64> = motion
            .response
            .iter()
            .zip(&path)
            .map(|(z, path)| (z - path).exp())
            .collect();
        let mean = mean_amplitude(&path);
        let is_near = apart.iter().all(|apart| (1.0 / apart - 1.0).norm() <= RING);
        is_near.then(|| Self {
            changes: path.iter().map(|z| z.re - mean).collect(),
            drive: motion
                .drive
                .iter()
                .zip(&apart)
                .map(|(rate, apart)| rate * apart)
                .collect(),
            measured: apart.iter().map(|apart| apart - 1.0).collect(),
            path,
            slope,
            lag,
        })
    }
}

impl Level {
    /// From periods; `None` for fewer than three, or where the unknowns cannot be told apart.
    pub fn of(motion: &Motion) -> Option<Self> {
        let size = motion.drive.iter().map(|rate| rate.norm()).sum::<f64>() / motion.drive.len() as f64;
        let slope = motion.slope.unwrap_or([[0.0, SLOPE * size]; 2]);
        // Noise of the response would look like a change of the force.
        let first = Assumed {
            changes: vec![0.0; motion.response.len()],
            ..Assumed::along(motion, motion.response.clone(), slope, SLOPE * size * motion.lag)?
        };
        let (mut level, mut path) = Self::pass(motion, &first)?;
        for _ in 0..REPEATED {
            let largest = [SLOPES, SLOPES + 1].map(|i| level.unknowns[i].hypot(level.covariance[(i, i)].sqrt()));
            let assumed = Assumed::along(motion, path, slope, largest[0].hypot(largest[1]) * motion.lag)?;
            (level, path) = Self::pass(motion, &assumed)?;
        }
        Some(level)
    }

    /// The filter and least squares, and the path that they find.
    fn pass(motion: &Motion, assumed: &Assumed) -> Option<(Self, Vec<Complex64>)> {
        let count = motion.time.len();
        let amplitude = mean_amplitude(&assumed.path);
        let columns = columns(motion, assumed, amplitude);
        let n = columns.len();
        let (steps, implicit): (Vec<Step>, Vec<_>) = steps(motion, assumed).into_iter().unzip();
        let before = |k: usize| assumed.path[k.saturating_sub(1)] - assumed.path[k];
        let driven = integrals(&motion.time, &assumed.drive).into_iter().enumerate();
        let known: Vec<_> = driven.map(|(k, by)| [by + before(k), -assumed.measured[k]]).collect();
        let acts = |k: usize, [increment, direct]: [Complex64; 2]| [implicit[k] * pair(increment), pair(direct)];
        let of_row = |k: usize, row: usize| row.checked_sub(1).map_or(known[k], |j| columns[j].acts[k]);
        let white = whiten(&steps, 1 + n, |k, row| acts(k, of_row(k, row)));
        // Columns of very different size make the equations ill-conditioned; with a diagonal of 1 they are not.
        let products = &white * white.transpose();
        let information = |j: usize| columns[j].expected[1].powi(-2);
        let expected = |j: usize| columns[j].expected[0];
        let scale = DVector::from_fn(n, |j, _| (products[(1 + j, 1 + j)] + information(j)).sqrt().recip());
        let normal = DMatrix::from_fn(n, n, |i, j| {
            let own = if i == j { information(i) } else { 0.0 };
            (products[(1 + i, 1 + j)] + own) * scale[i] * scale[j]
        });
        let inverse = normal.cholesky()?.inverse();
        let covariance = DMatrix::from_fn(n, n, |i, j| inverse[(i, j)] * scale[i] * scale[j]);
        let right = DVector::from_fn(n, |j, _| expected(j) * information(j) - products[(1 + j, 0)]);
        let unknowns = &covariance * right;
        let innovations = white.row(0).transpose() + white.rows(1, n).tr_mul(&unknowns);
        let of_priors = (0..n).map(|j| (unknowns[j] - expected(j)).powi(2) * information(j));
        let free = columns.iter().filter(|column| column.expected[1].is_infinite()).count();
        let degrees = (2 * count).checked_sub(free).filter(|degrees| *degrees > 0)?;
        let sum = innovations.norm_squared() + of_priors.sum::<f64>();
        let whole = |k: usize| {
            let with = |sum: [Complex64; 2], j: usize| [0, 1].map(|i| sum[i] + columns[j].acts[k][i] * unknowns[j]);
            (0..n).fold(known[k], with)
        };
        let moved = smooth(&steps, |k| acts(k, whole(k)));
        let path = assumed
            .path
            .iter()
            .zip(moved)
            .map(|(z, by)| z + Complex64::new(by[0], by[1]))
            .collect();
        let changes = &assumed.changes;
        // As much as it is found to be, if that is more.
        let lag = if assumed.lag > 0.0 {
            assumed.lag.hypot(unknowns[LAG]).hypot(unknowns[LAG + 1])
        } else {
            0.0
        };
        let level = Self {
            amplitude,
            noise: motion.noise[0] / count as f64,
            deviations: assumed.slope.map(|[_, deviation]| deviation),
            late: lag * (changes[count - 1] - changes[0]) / (motion.time[count - 1] - motion.time[0]),
            unknowns,
            disturbances: motion.disturbances.len(),
            covariance,
            innovations: innovations.as_slice().to_vec(),
            chi_square: [sum, degrees as f64],
        };
        sum.is_finite().then_some((level, path))
    }

    /// Lambda at the mean logarithm of the amplitude.
    pub fn force(&self) -> Complex64 {
        Complex64::new(self.unknowns[FORCE], self.unknowns[FORCE + 1])
    }

    /// The factors of the disturbances.
    pub fn disturbances(&self) -> &[f64] {
        &self.unknowns.as_slice()[self.unknowns.len() - self.disturbances..]
    }

    /// Standard uncertainty of the sum of the components of Lambda with these weights, and of disturbances with these.
    pub fn uncertainty(&self, force: Complex64, disturbances: &[f64]) -> f64 {
        let mut weights = DVector::zeros(self.unknowns.len());
        for (part, weight) in [force.re, force.im].into_iter().enumerate() {
            weights[FORCE + part] = weight;
        }
        let first = weights.len() - self.disturbances;
        weights
            .rows_mut(first, disturbances.len())
            .copy_from_slice(disturbances);
        let variance = weights.dot(&(&self.covariance * &weights));
        // The product of the errors of slope and amplitude is not linear in the unknowns: a level that rests says nothing of its slope. What the lag
        // moves the force by is known to its first order only.
        let products = [force.re, force.im].into_iter().enumerate().map(|(part, weight)| {
            let slope = self.unknowns[SLOPES + part].powi(2) + self.deviations[part].powi(2);
            weight * weight * (slope * self.noise + self.late * self.late)
        });
        (variance.max(0.0) + products.sum::<f64>()).sqrt() * self.scatter().max(1.0)
    }

    /// Root mean square of the innovations, 1 of noise.
    pub fn scatter(&self) -> f64 {
        (self.chi_square[0] / self.chi_square[1]).sqrt()
    }

    /// Whether the innovations are as large as noise (chi-square, by Wilson and Hilferty's approximation).
    pub fn is_noise(&self) -> bool {
        let [sum, degrees] = self.chi_square;
        let variance = 2.0 / (9.0 * degrees);
        (sum / degrees).cbrt() <= 1.0 - variance + SURE * variance.sqrt()
    }

    /// Correlation of neighbouring periods over what noise would have: beyond three standard deviations, the motion does something else than the model.
    pub fn correlation(&self) -> f64 {
        let pairs = self.innovations.iter().zip(&self.innovations[2..]);
        pairs.map(|(a, b)| a * b).sum::<f64>() / (self.innovations.len() as f64).sqrt()
    }

    /// Whether the innovations do not follow from each other.
    pub fn is_white(&self) -> bool {
        self.correlation().abs() <= SURE
    }
}

/// Mean logarithm of the amplitude.
fn mean_amplitude(path: &[Complex64]) -> f64 {
    path.iter().map(|z| z.re).sum::<f64>() / path.len() as f64
}

/// Integrals of rates from each period to the next one, and 0 up to the first: the drive of a period is constant.
fn integrals(time: &[f64], rates: &[Complex64]) -> Vec<Complex64> {
    let step = |k: usize| 0.5 * (time[k] - time[k - 1]) * (rates[k - 1] + rates[k]);
    std::iter::once(Complex64::ZERO)
        .chain((1..time.len()).map(step))
        .collect()
}

/// The unknowns in their order.
fn columns(motion: &Motion, assumed: &Assumed, amplitude: f64) -> Vec<Column> {
    const NONE: [[f64; 2]; 2] = [[0.0, f64::INFINITY]; 2];
    let (count, time) = (motion.time.len(), &motion.time);
    let changes: Vec<Complex64> = assumed.changes.iter().map(|change| (*change).into()).collect();
    let mut columns = Vec::new();
    let mut complex = |acts: &dyn Fn(usize) -> [Complex64; 2], expected: [[f64; 2]; 2]| {
        for (part, expected) in [Complex64::ONE, Complex64::i()].into_iter().zip(expected) {
            let acts = (0..count).map(|k| acts(k).map(|of| part * of)).collect();
            columns.push(Column { acts, expected });
        }
    };
    let [constant, changing] = [vec![Complex64::ONE; count], changes.clone()].map(|rates| integrals(time, &rates));
    complex(
        &|k| [if k == 0 { Complex64::ONE } else { Complex64::ZERO }, Complex64::ZERO],
        NONE,
    );
    complex(&|k| [constant[k], Complex64::ZERO], NONE);
    complex(&|k| [changing[k], Complex64::ZERO], assumed.slope);
    if assumed.lag > 0.0 {
        let step = |k: usize| changes[k] - changes[k.saturating_sub(1)];
        complex(&|k| [step(k), Complex64::ZERO], [[0.0, assumed.lag]; 2]);
    }
    for pole in &motion.rings {
        // Of amplitude one over the mean amplitude.
        let ring = |k: usize| (pole * (time[k] - time[0]) + amplitude - assumed.path[k]).exp();
        complex(&|k| [Complex64::ZERO, ring(k)], [[0.0, RING]; 2]);
    }
    columns.extend(motion.disturbances.iter().map(|one| {
        let acts = integrals(time, &one.rates).into_iter().map(|by| [by, Complex64::ZERO]);
        Column { acts: acts.collect(), expected: [0.0, one.deviation] }
    }));
    columns
}

/// The filter at each period, and the matrix by which increments act on its state.
fn steps(motion: &Motion, assumed: &Assumed) -> Vec<(Step, Matrix2<f64>)> {
    let feedback = |k: usize| -rotation(assumed.drive[k]);
    let mut covariance = Matrix2::zeros();
    let step = |k: usize| {
        let (mut transition, mut implicit, mut process) = (Matrix2::identity(), Matrix2::identity(), Matrix2::zeros());
        if k > 0 {
            let half = 0.5 * (motion.time[k] - motion.time[k - 1]);
            implicit = (Matrix2::identity() - feedback(k) * half)
                .try_inverse()
                .unwrap_or_default();
            transition = implicit * (Matrix2::identity() + feedback(k - 1) * half);
            process = implicit * implicit.transpose() * (motion.noise[1] * 4.0 * half * half);
        }
        let step = Step::new(transition, process, covariance, Some(motion.noise[0]));
        covariance = step.corrected;
        (step, implicit)
    };
    (0..motion.time.len()).map(step).collect()
}
