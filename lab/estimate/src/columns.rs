//! What each unknown of the force does to the envelope, along a path.
//!
//! ```text
//! u' = (pole - i omega0) u + gain (psi'/omega0)^power d exp(i psi),      lag d' + d = S(A)
//! ```
//!
//! with the path `A exp(i psi)`. The unknowns are the coefficients of the spline S, a factor of the lag, and u at the start. An error of the path
//! turns and changes the force, which moves u: `feedback` contains it to first order, with the force following at once.

use nalgebra::{Matrix2, Vector2};
use num_complex::Complex64;

use crate::interpolation::{Basis, Local, gradient};
use crate::record::{Element, Path, Record};

/// Parts of a period for the integrals; Simpson's rule, because the trapezoidal one costs eight standard uncertainties at zeta = 0.03.
const PARTS: usize = 4;
/// A part, periods.
const STEP: f64 = 1.0 / PARTS as f64;
const SIMPSON: [f64; PARTS + 1] = [1.0 / 12.0, 4.0 / 12.0, 2.0 / 12.0, 4.0 / 12.0, 1.0 / 12.0];

/// Columns of the model of a record: the known force, and a unit of each unknown.
#[derive(Debug, Clone)]
pub struct Columns {
    /// Growth of u from the period before: of each period the known part, then a unit of each unknown.
    pub increments: Vec<Vec<Complex64>>,
    /// What the measured departure has beside u, by the other pole: of each period the known part, then a unit of each unknown.
    pub direct: Vec<Vec<Complex64>>,
    /// Growth of u by an error of u at the period before.
    pub feedback: Vec<Matrix2<f64>>,
    /// u on the path.
    pub path: Vec<Complex64>,
    /// Mean square of the force beyond its lag, m², from each period to the next one.
    pub beyond: Vec<f64>,
    /// Periods in which the element has lost its motion.
    pub lost: Vec<bool>,
}

/// What the columns are made of.
pub struct Force<'a> {
    /// The element.
    pub element: &'a dyn Element,
    /// Functions of S.
    pub basis: Basis,
    /// Coefficients of S.
    pub coefficients: &'a [Complex64],
    /// Factor of the element's lag.
    pub lag: Complex64,
}

/// A point of the path.
struct Place {
    time: f64,
    amplitude: f64,
    turn: Complex64,
    /// Frequency over omega0.
    speed: f64,
    local: Local,
    lag: Complex64,
}

/// Weights of the force before, of S before and of S here in the force here.
type Weights = [Complex64; 3];

/// Weights of `lag d' + d = S` over a step, with S a straight line.
fn weights(step: f64, lag: Complex64) -> Weights {
    if lag == Complex64::ZERO {
        return [0.0, 0.0, 1.0].map(Complex64::from);
    }
    let h = step / lag;
    let decay = (-h).exp();
    let mean = (1.0 - decay) / h;
    [decay, mean - decay, 1.0 - mean]
}

/// The force of a steady one that varies along the path.
fn follow(weights: &[Weights], steady: impl Fn(usize) -> Complex64) -> Vec<Complex64> {
    let (mut before, mut force) = (steady(0), steady(0));
    let mut forces = vec![force];
    for (k, [decay, then, now]) in weights.iter().enumerate().skip(1) {
        let here = steady(k);
        force = decay * force + then * before + now * here;
        before = here;
        forces.push(force);
    }
    forces
}

/// Points of a path, [`PARTS`] from period to period.
fn places(record: &Record, force: &Force, path: &Path) -> Vec<Place> {
    let time = &record.periods.time;
    let phases: Vec<Complex64> = time.iter().map(|t| path.at(*t)[0].im.into()).collect();
    let rates = crate::interpolation::CubicSpline::new(time.clone(), gradient(&phases, time));
    let parts = |k: usize| (0..PARTS).map(move |part| (k, part));
    let last = [(time.len() - 1, 0)];
    let at = |(k, part): (usize, usize)| {
        let time = time[k]
            + if part == 0 {
                0.0
            } else {
                record.steps[k] * part as f64 / PARTS as f64
            };
        let logarithm = path.at(time)[0];
        let amplitude = logarithm.re.exp();
        Place {
            time,
            amplitude,
            turn: Complex64::cis(logarithm.im),
            speed: 1.0 + rates.at(time)[0].re / record.linear.omega0,
            local: force.basis.at(logarithm.re),
            lag: force.element.lag(amplitude),
        }
    };
    (0..time.len() - 1).flat_map(parts).chain(last).map(at).collect()
}

/// Force of the element's motion along the path less its steady force with its own lag; `None` where the motion is lost.
fn beyond_lag(record: &Record, force: &Force, path: &Path, places: &[Place]) -> Vec<Option<Complex64>> {
    let Some(stretches) = force.element.along(path) else {
        return vec![Some(Complex64::ZERO); places.len()];
    };
    let weights: Vec<Weights> = places.iter().map(|place| weights(STEP, place.lag)).collect();
    let own = follow(&weights, |k| force.element.steady(places[k].amplitude));
    let mut beyond = vec![None; places.len()];
    for stretch in stretches {
        let first = places.partition_point(|place| place.time < stretch[0].0);
        let mut next = 1;
        for (k, place) in places.iter().enumerate().skip(first) {
            while next < stretch.len() && stretch[next].0 < place.time {
                next += 1;
            }
            if next == stretch.len() {
                break;
            }
            let [(t0, f0), (t1, f1)] = [stretch[next - 1], stretch[next]];
            let moving = f0 + (f1 - f0) * ((place.time - t0) / (t1 - t0));
            beyond[k] = Some(moving / (place.speed * place.speed) - own[k]);
        }
    }
    debug_assert_eq!(beyond.len(), (record.steps.len()) * PARTS + 1);
    beyond
}

impl Columns {
    /// Along the path through the amplitudes `response`, one of each period.
    pub fn new(record: &Record, force: &Force, response: &[Complex64]) -> Self {
        let path = Path::new(&record.periods.time, response, record.linear.omega0);
        let places = places(record, force, &path);
        let beyond = beyond_lag(record, force, &path, &places);
        let size = force.basis.size;
        let weights: Vec<Weights> = places
            .iter()
            .map(|place| weights(STEP, place.lag * force.lag))
            .collect();
        let forces: Vec<Vec<Complex64>> = (0..size)
            .map(|n| follow(&weights, |k| value(&places[k].local, n).into()))
            .collect();
        let sum = |k: usize| -> Complex64 { (0..size).map(|n| force.coefficients[n] * forces[n][k]).sum() };
        let sums: Vec<Complex64> = (0..places.len()).map(sum).collect();
        let lags = follow(&weights, |k| match places[k].lag {
            Complex64::ZERO => Complex64::ZERO,
            _ => -(places[k].local.sum(force.coefficients) - sums[k]) / force.lag,
        });
        // Known, spline, lag: as forces in the frame.
        let row = |k: usize| -> Vec<Complex64> {
            let turn = places[k].turn * places[k].speed.powi(record.power);
            let known = std::iter::once(beyond[k].unwrap_or_default());
            let spline = forces.iter().map(|force| force[k]);
            known.chain(spline).chain([lags[k]]).map(|force| force * turn).collect()
        };
        let rows: Vec<Vec<Complex64>> = (0..places.len()).map(row).collect();
        let total = |k: usize| rows[k][0] + places[k].turn * places[k].speed.powi(record.power) * sums[k];
        let far = |k: usize| record.linear.far(record.periods.omega[k]);
        let count = record.periods.time.len();
        let mut columns = Self {
            increments: vec![vec![Complex64::ZERO; size + 3]],
            direct: Vec::new(),
            feedback: vec![Matrix2::zeros()],
            path: (0..count)
                .map(|k| response[k] - record.periods.linear[k] - far(k) * total(k * PARTS))
                .collect(),
            beyond: Vec::new(),
            lost: Vec::new(),
        };
        columns.increments[0][size + 2] = Complex64::ONE;
        for k in 0..count {
            let mut direct: Vec<Complex64> = rows[k * PARTS].iter().map(|force| force * far(k)).collect();
            direct.push(Complex64::ZERO);
            columns.direct.push(direct);
        }
        for k in 0..count - 1 {
            let span = k * PARTS..=(k + 1) * PARTS;
            columns.step(record, force, k, [&rows[span.clone()], &[sums[span].to_vec()]], &places);
            let parts = &beyond[k * PARTS..(k + 1) * PARTS];
            columns.lost.push(parts.iter().any(Option::is_none));
            columns
                .beyond
                .push(parts.iter().flatten().map(|force| force.norm_sqr()).sum::<f64>() / PARTS as f64);
        }
        // Nothing says how the last one ends.
        columns.lost.push(true);
        columns
    }

    /// Forgets the feedback of periods that do not count: nothing is known of their force, and at rest its phase has no meaning.
    pub fn keep_feedback(&mut self, used: &[bool]) {
        for k in 1..used.len() {
            if !used[k - 1] || !used[k] {
                self.feedback[k].fill(0.0);
            }
        }
    }

    /// The increments from period `k` to the next one, and their derivatives by u at `k`.
    fn step(
        &mut self,
        record: &Record,
        force: &Force,
        k: usize,
        [rows, sums]: [&[Vec<Complex64>]; 2],
        places: &[Place],
    ) {
        let (duration, power) = (record.steps[k], record.power);
        let mut increments = vec![Complex64::ZERO; rows[0].len() + 1];
        let mut derivatives = [Complex64::ZERO; 2];
        for (part, weight) in SIMPSON.iter().enumerate() {
            let left = 1.0 - part as f64 / PARTS as f64;
            let kick = record.transition(duration * left) * record.linear.gain() * (weight * duration);
            for (sum, force) in increments.iter_mut().zip(&rows[part]) {
                *sum += kick * force;
            }
            let place = &places[k * PARTS + part];
            let slope = place.local.slope(force.coefficients);
            let turn = place.turn * place.speed.powi(power);
            for (sum, error) in derivatives.iter_mut().zip([Complex64::ONE, Complex64::i()]) {
                // Change of ln A and of the phase.
                let change = error * place.turn.conj() / place.amplitude;
                *sum += kick * turn * (slope * change.re + Complex64::i() * sums[0][part] * change.im);
            }
        }
        let [real, imaginary] = derivatives.map(|one| Vector2::new(one.re, one.im));
        self.increments.push(increments);
        self.feedback.push(Matrix2::from_columns(&[real, imaginary]));
    }
}

/// The value of a function of the basis.
fn value(local: &Local, n: usize) -> f64 {
    n.checked_sub(local.first)
        .and_then(|k| local.values.get(k))
        .copied()
        .unwrap_or(0.0)
}
