//! Fit of the five parameters to records themselves: the plant follows a record, and what it does not foresee is minimised.
//!
//! The plant is exact between events, so that no averaged equations, no held windows and no phase resonance are needed. It is driven by the measured
//! base, and predicts the response. Once in a period the first harmonic of the error of the prediction, the innovation, corrects both masses: an
//! extended Kalman filter (Åström, Introduction to Stochastic Control Theory, chapter 7), whose matrices are the plant's own derivatives, by plants
//! that start the period a little beside it. Noise of the base is the noise of the process: its first harmonic in a period moves the response by
//! `omega0 T/2 = pi` times itself. Noise of the response is the noise of the measurement: what the prediction leaves beside the first harmonic.
//! Velocities and accelerations of the response are predicted as such, so that their noise stays white; those of the base are integrated, without
//! what changes slowly, which moves the whole rig.
//! Innovations are white, and their covariance is known; so is the covariance of the parameters, except in the direction that the record determines
//! least: there the ratio of likelihoods gives the interval.
//!
//! Where a simulation changes the amplitude of the base, the base jumps at a sample, and the record does not show it. Its amplitude grows, and swings
//! twice in a period, so that the jumps have a first harmonic of up to 1e-4 of the base, always of one sign. They follow from the growth of the
//! recorded base and from its third harmonic. The share of them that the base makes is fitted. What is not a sine in the base is noise of the process
//! beside them: a floor of the uncertainty, which in simulations without noise exceeds the errors several times.
//!
//! The fit begins at the parameters of the points of the record. A piece of the record is left out where the plant has not two impacts per period,
//! where a deviation of the particle grows in spite of the corrections, where the response has a second harmonic, where the piece contradicts all
//! others, and where the innovations have no derivative by the parameters, because the motion is another one beside them. By the parameters that are
//! found more pieces belong: with all of them the search begins again, until no more do. Whether a part shows impacts by itself does not matter,
//! because that depends on the natural frequency of the scene: what is followed needs them if no linear structure follows it.

use std::f64::consts::{PI, TAU};

use lovines::{Cavity, Drive, Parameters, Plant, State};
use nalgebra::{DVector, Matrix2, Matrix2x4, Matrix4, Matrix4x2, Vector2, Vector4};
use num_complex::Complex64;
use serde::Serialize;
use statrs::distribution::{ChiSquared, ContinuousCDF};
use vines_model::numerics::{
    Estimate, HarmonicBasis, HarmonicFit, LeastSquares, Misfit, SIGNIFICANT, mean, mean_square,
};
use vines_model::orbit::{AfterImpact, Orbit, backbone_at_speed, exact_backbone};
use vines_model::regime::Regime;
use vines_model::theory::{BranchSide, Manifold};
use vines_model::{Definition, Dimensionless, Measurand, Sensor};

use super::recording::remove_drift;
use super::{
    ChannelTest, Covariance, Fit, Kind, Known, LIMITS, MeasuredPoint, Nearest, Part, Problem, Quantity, Recording,
    UNKNOWNS, Unknowns, fit, plant, probability, range_of, shifted, unknowns,
};
use crate::rig::derivative;

/// A stretch of a record: the number of the record, and the samples from which and to which it extends.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Stretch {
    record: usize,
    span: [usize; 2],
}

/// A stretch that does not belong to the motion.
#[derive(Clone, Copy)]
struct Cut {
    stretch: Stretch,
    /// Whether the record contradicts the plant there; otherwise it is the plant that has another motion, or has lost this one.
    contradicts: bool,
}

/// Periods of a piece: innovations are tested piece by piece.
const PIECE: usize = 16;
/// Periods by which stretches extend beyond the parts that have points: the tests of pieces say what belongs.
const STRETCH_MARGIN: usize = 16;
/// Most rounds of fits and tests.
const MOST_ROUNDS: usize = 30;
/// Prior standard deviations of both masses at the start of a stretch, over the response.
const PRIOR: [f64; 2] = [0.02, 0.1];
/// Error of the prediction, over the response, at which the plant has lost the motion.
const MOTION_LOST: f64 = 0.5;
/// Step of a difference, relative. A record without noise determines its best direction to 5e-8.
const RECORD_DIFFERENCE: f64 = 1e-7;
/// Step of a state, over the response: so small that hardly any impact lies between both states.
const STATE_DIFFERENCE: f64 = 1e-7;
/// Noise of the process, over the noise of the measurement, in the first fit, in which the plant stays near the record whatever the parameters.
const STRONG: f64 = 0.2;
/// Gain of a further step, relative to one and chi-square, at which the minimum counts as found.
const RECORD_GAIN: f64 = 1e-5;
/// Probability of a piece that belongs to the motion to be left out, for all pieces together.
const PIECE_FALSE_ALARM: f64 = 1e-3;
/// Standard uncertainties of what is expected of f0, zeta, b and epsilon, relative, and of r, where the search begins.
const EXPECTED: [f64; 5] = [0.01, 0.3, 0.2, 0.2, 0.3];
/// Share of the jumps that the base makes: all where a simulation changes its amplitude at each sample, none of a smooth base.
const JUMP: Estimate = Estimate { value: 0.5, uncertainty: 0.5 };
/// Square of the move of the parameters, in standard uncertainties, below which the filter need not be linearised again.
const STILL: f64 = 0.1;
/// Largest relative error of a derivative.
const ROUGH: f64 = 0.1;
/// Weight that holds a function of the unknowns, over its standard uncertainty.
const HOLD: f64 = 1e3;
/// Half-width of a cavity that no response fills, over the expected one.
const WIDE_CAVITY: f64 = 1e3;
/// Rounding of sums of squares, relative.
const SUM_ROUNDING: f64 = 1e-9;
/// Rise of chi-square at the end of an interval of three standard uncertainties.
const END: f64 = 9.0;

/// What a sample does not show of the base.
#[derive(Clone, Copy, Default)]
struct Base {
    /// First harmonic of the base over that of the polygon of its samples: it depends on the frequency.
    scale: f64,
    /// Jump of the base after the sample, m, if its amplitude changes only there.
    jump: f64,
    /// Variance of a sample by noise in this period, m²: it ends where the base comes to rest, whose jump counts as noise.
    noise: f64,
    /// Mean square of what is not a sine in this period, m².
    rest: f64,
    /// Variance of a sample by what is near the sine, if it is white, m².
    near: f64,
    /// Second and fourth harmonic of what is not a sine, m, turned by the phase of the sine.
    even: [Complex64; 2],
}

/// A record with its noise.
#[derive(Clone)]
struct Measured<'a> {
    recording: &'a Recording,
    /// Covariance of the first harmonic of the response in a period, m², in each piece of [`PIECE`] periods.
    response_noise: Vec<Matrix2<f64>>,
    /// The displacement of the base at each sample, m.
    drive: Vec<f64>,
    /// What the samples do not show of it.
    base: Vec<Base>,
    /// The frequency by which velocities and accelerations are scaled, rad/s.
    omega0: f64,
    /// Samples of a period of the natural frequency.
    period: usize,
}

/// What the filter does in a period of a record.
#[derive(Clone)]
struct Step {
    /// Its first sample, and that of the next one.
    begin: usize,
    end: usize,
    /// Turns the response to the real axis.
    turn: Complex64,
    /// Correction of the state at the end by the innovation.
    gain: Matrix4x2<f64>,
    /// Makes the innovation one of covariance 1.
    whitening: Matrix2<f64>,
    /// Impacts of the plant for which this is.
    impacts: u64,
    /// Covariance of the first harmonic of the response, m², by what the prediction leaves beside it, if that is white.
    noise: Matrix2<f64>,
    /// Variance of the second and fourth harmonic of what it leaves, m².
    near: f64,
    /// Variance of the first harmonic by the uncertainty of the state, m².
    of_state: f64,
    /// Square of the innovation over its standard deviations.
    innovation: f64,
    /// Second harmonic of what the prediction leaves, m.
    second: Complex64,
    /// Derivatives of the corrected state at the end over that at the begin.
    transition: Matrix4<f64>,
}

/// Chi-square (two degrees of freedom) of the second harmonic of a piece: impacts at uneven intervals have one, which lasts for many periods. The
/// innovations of wrong parameters have all harmonics: with `beside` they are the measure where they exceed their standard deviations.
fn unevenness(piece: &[Step], colour: f64, beside: bool) -> f64 {
    let innovations = 0.5 * mean(piece.iter().map(|step| step.innovation));
    let measure = if beside { innovations.max(1.0) } else { 1.0 };
    let deviation = |step: &Step| (step.of_state + 0.5 * colour * step.noise.trace()).sqrt();
    let sum: Complex64 = piece.iter().map(|step| step.second / deviation(step)).sum();
    sum.norm_sqr() / (piece.len() as f64 * measure)
}

/// The periods of a stretch, and the state at the first one, for plants of other parameters as well: it has its own uncertainty.
#[derive(Clone, Default)]
struct Course {
    start: State,
    steps: Vec<Step>,
}

impl Course {
    /// The periods that count: those after the first piece, because the error of the start is not linear.
    fn counted(&self) -> &[Step] {
        self.steps.get(PIECE..).unwrap_or_default()
    }
}

/// Records, of which some stretches are fitted, beside points.
#[derive(Clone)]
struct Followed<'a> {
    problem: &'a Problem<'a>,
    records: Vec<Measured<'a>>,
    stretches: Vec<Stretch>,
    /// The periods of each stretch.
    courses: Vec<Course>,
    /// Noise of the process, over the noise of the measurement, at least.
    least_noise: f64,
    /// A linear function of the unknowns, and the value at which the fit holds it.
    held: Option<(Unknowns, f64)>,
    /// Impacts in a period: two, or none of a structure that no particle touches.
    impacts: u64,
    /// Whether a second harmonic is measured beside the innovations.
    beside: bool,
    /// Fewest samples to be followed: half of those of parts that show 1:1 by themselves.
    fewest: usize,
}

/// Part of a record that does not belong to the motion.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LeftOut {
    /// The record.
    pub origin: String,
    /// Its begin and end, s since the first sample.
    pub seconds: [f64; 2],
}

/// The fit to records.
#[derive(Debug, Clone)]
pub struct RecordFit {
    /// The parameters; residuals of points are beside those of the records.
    pub fit: Fit,
    /// Periods that are fitted.
    pub periods: usize,
    /// What is left out.
    pub left_out: Vec<LeftOut>,
    /// Correlation of the innovations of neighbouring periods: 0 if they are white.
    pub colour: f64,
}

/// Variance of white noise on a smooth signal, from sixth differences, which leave 1e-7 of a sine that is sampled 100 times a period. The median of
/// their squares leaves out a jump.
fn noise(values: &[f64]) -> f64 {
    let difference = |v: &[f64]| 20.0 * v[3] - 15.0 * (v[2] + v[4]) + 6.0 * (v[1] + v[5]) - (v[0] + v[6]);
    let mut squares: Vec<f64> = values.windows(7).map(|seven| difference(seven).powi(2)).collect();
    squares.sort_by(f64::total_cmp);
    // White noise of variance 1 gives them the sum of the squares of the factors, and a normal square of mean 1 has this median.
    squares
        .get(squares.len() / 2)
        .map_or(0.0, |middle| middle / (924.0 * 0.4549))
}

/// First harmonic of the values of one period.
fn harmonic(values: &[f64]) -> Complex64 {
    harmonic_of(values, 1.0)
}

/// A harmonic of the values of one period.
fn harmonic_of(values: &[f64], order: f64) -> Complex64 {
    let step = order * TAU / values.len() as f64;
    let turned = |(n, value): (usize, &f64)| Complex64::from_polar(*value, -step * n as f64);
    let sum: Complex64 = values.iter().enumerate().map(turned).sum();
    sum * Complex64::new(0.0, 2.0 / values.len() as f64)
}

/// By how much noise is larger near the first harmonic than white noise of its variance is: behind an anti-alias filter. `ratios`: of the variances by
/// the second and fourth harmonic (four degrees of freedom) to those of white noise, of each period. What is larger by chance is white.
fn colour(ratios: impl Iterator<Item = f64>) -> f64 {
    let mut ratios: Vec<f64> = ratios.collect();
    ratios.sort_by(f64::total_cmp);
    // The mean of a chi-square of four degrees of freedom over its median, whose standard error is 1.25 times that of the mean.
    let colour = ratios.get(ratios.len() / 2).map_or(1.0, |middle| middle * 4.0 / 3.357);
    let error = 1.25 * (0.5 / ratios.len().max(1) as f64).sqrt();
    if colour > 1.0 + SIGNIFICANT * error {
        colour
    } else {
        1.0
    }
}

/// The second and fourth harmonic of the values of one period, in which the impulses of both impacts cancel, however a sensor shows them.
fn even_harmonics(values: &[f64]) -> [Complex64; 2] {
    [2.0, 4.0].map(|order| harmonic_of(values, order))
}

/// Variance of the first harmonic in a period by these next to it. It has four degrees of freedom.
fn variance_near(even: &[Complex64; 2]) -> f64 {
    0.5 * mean(even.iter().map(Complex64::norm_sqr))
}

/// The displacements, m, of a base whose velocities or accelerations are given, over omega0 or its square: their integrals, without what changes
/// slowly. `natural`: phase by which a sine of this frequency turns from sample to sample, rad.
fn displacements(values: &[f64], of: Measurand, period: usize, natural: f64) -> Vec<f64> {
    let mut values = values.to_vec();
    for _ in 0..of.order() {
        let (mut sum, mut before) = (0.0, 0.0);
        for value in &mut values {
            // The trapezoidal rule, exact for a sine of this frequency.
            sum += (0.5 * natural).tan() * (before + *value);
            (before, *value) = (*value, sum);
        }
        remove_drift(&mut values, period);
    }
    values
}

/// The base in a quarter of a period of its samples, from sample `from` on, by the period around it.
fn quarter_of_base(drive: &[f64], from: usize, period: usize) -> Vec<Base> {
    let quarter = from..drive.len().min(from + period.div_ceil(4));
    let begin = (from + period / 8).saturating_sub(period / 2);
    let begin = begin.min(drive.len().saturating_sub(period));
    let values = &drive[begin..drive.len().min(begin + period)];
    let around = &drive[begin.saturating_sub(period)..drive.len().min(begin + 2 * period)];
    let harmonics: Vec<Complex64> = around.chunks_exact(period).map(harmonic).collect();
    let turned: Complex64 = harmonics.windows(2).map(|pair| pair[1] * pair[0].conj()).sum();
    let step = (TAU + turned.arg()) / period as f64;
    let scale = (0.5 * step / (0.5 * step).sin()).powi(2);
    let phases: Vec<f64> = (0..values.len()).map(|i| i as f64 * step).collect();
    let basis = HarmonicBasis::new(&phases, 0, &[Some(1), None, Some(0)]);
    let vector = DVector::from_column_slice(values);
    let noise = noise(values);
    let is_moving = |fit: &HarmonicFit| values.len() == period && fit.harmonic(1).norm() > 0.0;
    let Some(fit) = basis.fit(&vector).filter(is_moving) else {
        return vec![Base { scale, noise, ..Base::default() }; quarter.len()];
    };
    let residual = basis.residual(&vector, &fit);
    let even = even_harmonics(residual.as_slice());
    let near = variance_near(&even) * values.len() as f64 / 2.0;
    // The part of a sine that a polygon lacks, `scale - 1`, is known to the first order only.
    let polygon = 0.5 * ((scale - 1.0) * fit.harmonic(1).norm()).powi(2);
    let rest = residual.norm_squared() / (values.len() - basis.terms()) as f64 + polygon;
    // The amplitude E0 + E1 n + Re(E2 exp(2i phase)) has a third harmonic.
    let [first, growth, third] = [fit.harmonic(1), fit.drift(1), fit.harmonic(3)];
    let turn = first.conj() / first.norm();
    let even = [even[0] * turn.powi(2), even[1] * turn.powi(4)];
    let growth = (growth * turn).re * 2.0 / (values.len() - 1) as f64;
    let swing = 2.0 * third * turn.powi(3);
    let jump = |n: usize| {
        let angle = phases[n - begin] + first.arg();
        let rate = growth - 2.0 * step * (swing * Complex64::from_polar(1.0, 2.0 * angle + step)).im;
        Base { scale, jump: rate * angle.sin(), noise, rest, near, even }
    };
    quarter.map(jump).collect()
}

/// Number of samples.
fn samples(stretches: impl Iterator<Item = Stretch>) -> usize {
    stretches.map(|one| one.span[1] - one.span[0]).sum()
}

impl<'a> Measured<'a> {
    fn new(recording: &'a Recording, omega: f64, omega0: f64) -> Self {
        let period = (TAU / omega / recording.sample_time).round() as usize;
        let of_harmonic = |piece: &[f64]| Matrix2::from_diagonal_element(2.0 * noise(piece) / period as f64);
        let mut response_noise: Vec<Matrix2<f64>> =
            recording.response.chunks(PIECE * period).map(of_harmonic).collect();
        // The last piece may have few samples.
        if let [.., whole, last] = &mut response_noise[..] {
            *last = *whole;
        }
        let of_base = recording.measurands[1];
        let drive = displacements(&recording.drive, of_base, period, omega0 * recording.sample_time);
        let bases = |drive: &[f64]| -> Vec<Base> {
            let starts = (0..drive.len()).step_by(period.div_ceil(4));
            starts.flat_map(|from| quarter_of_base(drive, from, period)).collect()
        };
        let mut base = bases(&drive);
        let size = PIECE * period;
        if of_base == Measurand::Displacement {
            // By the changes from period to period: a harmonic that stays is no noise.
            let ratios = base.chunks(size).flat_map(|piece| {
                let white = 2.0 * mean(piece.iter().map(|one| one.noise)) / period as f64;
                let periods = piece.iter().step_by(period).map(|one| one.even);
                let changes = periods.clone().zip(periods.skip(1));
                let square = |(one, next): (Complex64, Complex64)| (one - next).norm_sqr();
                changes.map(move |(one, next)| one.into_iter().zip(next).map(square).sum::<f64>() / 8.0 / white)
            });
            let colour = colour(ratios);
            base.iter_mut().for_each(|one| one.noise *= colour);
        } else {
            // Differences show every jump of the base as well.
            for (base, measured) in base.chunks_mut(size).zip(bases(&recording.drive).chunks(size)) {
                let near = mean(measured.iter().map(|one| one.near));
                for (one, measured) in base.iter_mut().zip(measured) {
                    one.noise = measured.noise.min(near);
                }
            }
        }
        Self { recording, response_noise, drive, base, omega0, period }
    }

    fn piece(&self, sample: usize) -> usize {
        (sample / (PIECE * self.period)).min(self.response_noise.len() - 1)
    }

    /// Variance of the first harmonic of the base in a period, m², by noise, and by what the base may do between two samples: what is no sine in
    /// it changes in half a sample as the sine does.
    fn base_variance(&self, begin: usize, end: usize) -> f64 {
        let [noise, rest] =
            [|one: &Base| one.noise, |one: &Base| one.rest].map(|of| mean(self.base[begin..end].iter().map(of)));
        let n = (end - begin) as f64;
        2.0 * noise / n + (rest - noise).max(0.0) * (PI / n).powi(2)
    }

    /// The signal of the base from a sample to the next, a straight line, from `late` seconds after the sample on.
    fn line(&self, n: usize, late: f64, share: f64) -> Drive {
        let (drive, sample_time) = (&self.drive, self.recording.sample_time);
        let Base { scale, jump, .. } = self.base[n];
        let from = scale * (drive[n] + share * jump);
        let slope = (scale * drive[n + 1] - from) / sample_time;
        let signal = [from + slope * late, slope, 0.0, 0.0];
        Drive { signal, ..Drive::default() }
    }
}

/// A plant that follows a record.
#[derive(Clone)]
struct Follower<'a> {
    record: &'a Measured<'a>,
    plant: Plant,
    /// The sample at which it is.
    n: usize,
    /// Displacement of the response at the sample before, m.
    before: f64,
    omega: f64,
    /// What the sensor reads of the particle.
    share: f64,
    /// Share of the jumps that the base makes.
    jump: f64,
}

impl Follower<'_> {
    /// The sensor's reading, of which the plant goes on to the next sample.
    fn sample(&mut self) -> Option<f64> {
        let Recording { sample_time, measurands: [of, _], .. } = self.record.recording;
        let here = self.response();
        let drive = self.record.line(self.n, 0.0, self.jump);
        self.plant.advance(drive, *sample_time).ok()?;
        let (three, omega0) = ([self.before, here, self.response()], self.record.omega0);
        (self.n, self.before) = (self.n + 1, here);
        Some(derivative(*of, three, [*sample_time; 2], omega0) * omega0.powi(-of.order()))
    }

    /// Displacement of the response, m.
    fn response(&self) -> f64 {
        let State { q1, q2, .. } = self.plant.state();
        q1 + self.share * q2
    }

    /// The readings up to the first sample, from the earliest to the latest one, at which the particle has crossed the middle of its cavity upwards.
    fn crossing(&mut self, [earliest, latest]: [usize; 2], last: usize) -> Option<Vec<f64>> {
        let mut readings = Vec::new();
        let mut before = self.plant.relative_displacement();
        while self.n < last {
            readings.push(self.sample()?);
            let now = self.plant.relative_displacement();
            if self.n >= latest || self.n >= earliest && before < 0.0 && now >= 0.0 {
                return Some(readings);
            }
            before = now;
        }
        None
    }

    /// The readings up to a sample.
    fn to(&mut self, end: usize) -> Option<Vec<f64>> {
        (self.n..end).map(|_| self.sample()).collect()
    }

    /// Displacements and velocities over omega, m.
    fn state(&self) -> Vector4<f64> {
        let State { q1, dq1, q2, dq2 } = self.plant.state();
        Vector4::new(q1, dq1 / self.omega, q2, dq2 / self.omega)
    }

    fn moved(&mut self, by: &Vector4<f64>) -> Option<()> {
        let [q1, v1, q2, v2] = <[f64; 4]>::from(self.state() + by);
        let state = State { q1, dq1: v1 * self.omega, q2, dq2: v2 * self.omega };
        let [position, velocity] = [0, 1].map(|i| by[i] + self.share * by[i + 2]);
        self.before += position - velocity * self.omega * self.record.recording.sample_time;
        self.plant.set_state(state).ok()
    }

    /// What the prediction of a period leaves of the response.
    fn errors(&self, begin: usize, readings: &[f64]) -> Vec<f64> {
        let response = &self.record.recording.response[begin..begin + readings.len()];
        response.iter().zip(readings).map(|(one, other)| one - other).collect()
    }

    /// The innovation of a period: the first harmonic of the errors.
    fn innovation(&self, begin: usize, readings: &[f64], turn: Complex64) -> Vector2<f64> {
        let first = harmonic(&self.errors(begin, readings)) * turn;
        Vector2::new(first.re, first.im)
    }
}

/// Covariance of the first harmonic of a period by independent errors of its samples, whose variance may differ: these are what the errors are
/// without their mean and their harmonic.
fn noise_of(errors: &[f64], turn: Complex64) -> Matrix2<f64> {
    let (n, middle, first) = (errors.len() as f64, mean(errors.iter().copied()), harmonic(errors));
    let square = |(i, error): (usize, &f64)| {
        let wave = Complex64::from_polar(1.0, -TAU * i as f64 / n);
        let rest = error - middle - (first * wave.conj()).im;
        let turned = wave * Complex64::new(0.0, 2.0 / n) * turn * rest;
        let turned = Vector2::new(turned.re, turned.im);
        turned * turned.transpose()
    };
    errors.iter().enumerate().map(square).sum::<Matrix2<f64>>() * (n / (n - 3.0))
}

impl Followed<'_> {
    /// The plant on the exact motion, or without impacts on that of the structure, whose response has the amplitude and phase of the first period of
    /// a stretch, at a sample soon after.
    fn start(&self, x: &Unknowns, stretch: &Stretch) -> Option<Follower<'_>> {
        let record = &self.records[stretch.record];
        let Recording { response, sample_time, .. } = record.recording;
        let from = stretch.span[0];
        let measured = harmonic(response.get(from..from + record.period)?);
        let phase = measured.arg() - record.recording.measurands[0].lead();
        if self.impacts == 0 {
            let (q1, velocity) = (measured.norm() * phase.sin(), measured.norm() * phase.cos());
            let state = State { q1, dq1: velocity * x[0].exp(), ..State::default() };
            return self.follower(x, stretch, state, from);
        }
        let d = Dimensionless {
            definition: self.problem.definition,
            ..Dimensionless::of(&plant(x, Cavity::IDEAL), 0.0)
        };
        let manifold = Manifold::new(d.r);
        let by_theory = manifold.b(measured.norm() / d.b, BranchSide::Right);
        let [omega, c, _] = backbone_at_speed(&d, by_theory.unwrap_or(1.02 * manifold.b_min()))?;
        let distance = |orbit: &Orbit| (orbit.c - c).abs();
        let orbits = exact_backbone(&d, omega);
        let orbit = orbits
            .iter()
            .min_by(|one, other| distance(one).total_cmp(&distance(other)))?;
        // Phase of the response at the impact, less that at the sample.
        let rest = orbit.start.phase + orbit.gamma - phase;
        let time = rest.rem_euclid(TAU) / TAU * record.period as f64 * sample_time;
        let AfterImpact { q1, dq1, q2, dq2, .. } = orbit.start;
        let ([q1, q2], [dq1, dq2]) = (
            [q1, q2].map(|one| one * d.b),
            [dq1, dq2].map(|one| one * d.b * d.omega0),
        );
        let n = from + (time / sample_time) as usize;
        let mut one = self.follower(x, stretch, State { q1, dq1, q2, dq2 }, n + 1)?;
        let late = time - (n - from) as f64 * sample_time;
        one.plant.advance(record.line(n, late, x[6]), sample_time - late).ok()?;
        Some(one)
    }

    /// The periods of a stretch for a plant, up to the one in which it loses the motion; `None` if none counts.
    fn linearised(&self, x: &Unknowns, stretch: &Stretch) -> Option<Course> {
        let mut one = self.start(x, stretch)?;
        let Measured { recording: Recording { response, .. }, period, .. } = one.record;
        let end = stretch.span[1].min(response.len() - 1);
        one.crossing([1, 3].map(|periods| stretch.span[0] + periods * period), end)?;
        let amplitude = harmonic(&response[one.n - period..one.n]).norm();
        let [masses, particle] = PRIOR.map(|prior| (prior * amplitude).powi(2));
        let mut covariance = Matrix4::from_diagonal(&Vector4::new(masses, masses, particle, particle));
        let start = one.plant.state();
        let steps: Vec<Step> = std::iter::from_fn(|| self.step(&mut one, &mut covariance, end)).collect();
        Some(Course { start, steps })
    }

    /// Follows a period, if it ends before the sample `last`, and corrects the state, whose covariance is given; `None` where the motion is lost.
    fn step(&self, one: &mut Follower, covariance: &mut Matrix4<f64>, last: usize) -> Option<Step> {
        let (begin, from, record) = (one.n, one.clone(), one.record);
        let readings = one.crossing([3, 5].map(|quarters| begin + quarters * record.period / 4), last)?;
        let (end, state) = (one.n, one.state());
        let there = harmonic(&record.recording.response[begin..end]);
        let (amplitude, turn) = (there.norm(), there.conj() / there.norm());
        let innovation = one.innovation(begin, &readings, turn);
        if innovation.norm() > MOTION_LOST * amplitude {
            return None;
        }
        let (mut transition, mut reading) = (Matrix4::zeros(), Matrix2x4::zeros());
        for i in 0..4 {
            let mut beside = from.clone();
            beside.moved(&Vector4::ith(i, STATE_DIFFERENCE * amplitude))?;
            let others = beside.to(end)?;
            transition.set_column(i, &((beside.state() - state) / (STATE_DIFFERENCE * amplitude)));
            let change = innovation - beside.innovation(begin, &others, turn);
            reading.set_column(i, &(change / (STATE_DIFFERENCE * amplitude)));
        }
        let noise = record.response_noise[record.piece(begin)];
        let process = PI * PI * record.base_variance(begin, end) + self.least_noise * self.least_noise * noise.trace();
        let process = Matrix4::from_diagonal(&Vector4::new(process, process, 0.0, 0.0));
        // Half of it has come before the middle of the period.
        let before = *covariance + process * 0.5;
        let total = reading * before * reading.transpose() + noise;
        let gain = before * reading.transpose() * total.try_inverse()?;
        let rest = Matrix4::identity() - gain * reading;
        let kept = rest * before * rest.transpose() + gain * noise * gain.transpose();
        // What is not linear in a correction.
        let square = ((gain * innovation).norm_squared() / amplitude).powi(2);
        *covariance =
            transition * kept * transition.transpose() + process * 0.5 + Matrix4::from_diagonal_element(square);
        let gain = transition * gain;
        let transition = transition - gain * reading;
        let errors = one.errors(begin, &readings);
        let even = even_harmonics(&errors);
        let near = variance_near(&even);
        let left = match record.recording.measurands[0] {
            Measurand::Displacement => noise_of(&errors, turn),
            // The inverse of the mean over a piece is that of the variance on average.
            _ => Matrix2::from_diagonal_element(near * PIECE as f64 / (PIECE as f64 - 0.5)),
        };
        one.moved(&(gain * innovation))?;
        let whitening = total.cholesky()?.l().try_inverse()?;
        Some(Step {
            begin,
            end,
            turn,
            gain,
            whitening,
            innovation: (whitening * innovation).norm_squared(),
            impacts: one.plant.totals().impacts - from.plant.totals().impacts,
            noise: left,
            near,
            of_state: 0.5 * (total - noise).trace(),
            second: even[0] * turn * turn,
            transition,
        })
    }

    /// The innovations of a plant along the steps of a stretch, over their standard deviations, up to the step that it cannot take.
    fn innovations(&self, x: &Unknowns, stretch: &Stretch, course: &Course) -> Vec<Vector2<f64>> {
        let Course { start, steps } = course;
        let begin = steps.first().map_or(0, |step| step.begin);
        let mut one = self.follower(x, stretch, *start, begin);
        let period = |step: &Step| {
            let follower = one.as_mut()?;
            let readings = follower.to(step.end)?;
            let innovation = follower.innovation(step.begin, &readings, step.turn);
            follower.moved(&(step.gain * innovation))?;
            Some(step.whitening * innovation)
        };
        let innovations: Vec<Vector2<f64>> = steps.iter().map_while(period).collect();
        innovations
            .get(course.steps.len() - course.counted().len()..)
            .unwrap_or_default()
            .to_vec()
    }

    /// A plant in a state at a sample of a stretch.
    fn follower(&self, x: &Unknowns, stretch: &Stretch, state: State, n: usize) -> Option<Follower<'_>> {
        let parameters = plant(x, Cavity::IDEAL);
        let share = match self.problem.definition.sensor {
            Sensor::V if self.impacts > 0 => parameters.mass_ratio(),
            _ => 0.0,
        };
        let record = &self.records[stretch.record];
        Some(Follower {
            record,
            plant: Plant::new(parameters, state).ok()?,
            n,
            before: state.q1 + share * state.q2 - (state.dq1 + share * state.dq2) * record.recording.sample_time,
            omega: parameters.natural_frequency(),
            share,
            jump: x[6],
        })
    }
}

impl Followed<'_> {
    /// The innovations of each stretch, up to where the plant cannot follow.
    fn each(&self, x: &Unknowns) -> Vec<Vec<Vector2<f64>>> {
        let stretches = self.stretches.iter().zip(&self.courses);
        stretches
            .map(|(stretch, course)| self.innovations(x, stretch, course))
            .collect()
    }

    /// The innovations of all periods; `None` where the plant cannot follow them.
    fn all(&self, x: &Unknowns) -> Option<Vec<f64>> {
        let each = self.each(x);
        let is_whole = each
            .iter()
            .zip(&self.courses)
            .all(|(one, course)| one.len() == course.counted().len());
        is_whole.then(|| each.iter().flatten().flat_map(|one| [one.x, one.y]).collect())
    }

    /// Lets the plant follow the stretches, without the pieces in which it has another motion. Returns what is left out.
    fn linearise(&mut self, x: &Unknowns) -> Vec<Cut> {
        let mut left_out = Vec::new();
        loop {
            let courses = self
                .stretches
                .iter()
                .map(|one| self.linearised(x, one).unwrap_or_default());
            self.courses = courses.collect();
            let pieces = self
                .courses
                .iter()
                .map(|one| one.counted().chunks(PIECE).len())
                .sum::<usize>();
            let limit = -2.0 * (PIECE_FALSE_ALARM / pieces.max(1) as f64).ln();
            let colours: Vec<f64> = (0..self.records.len()).map(|record| self.colour(record)).collect();
            let contradicts = |piece: &[Step], colour: f64| {
                let moved = piece
                    .iter()
                    .fold(Vector4::ith(3, 1.0), |moved, step| step.transition * moved);
                let grows = self.impacts > 0 && moved.norm() >= 1.0;
                let is_uneven = self.impacts > 0 && unevenness(piece, colour, self.beside) > limit;
                let is_another = grows || piece.iter().any(|step| step.impacts != self.impacts);
                (is_another || is_uneven).then_some(!is_another)
            };
            let courses = self.stretches.iter().zip(&self.courses);
            let flags: Vec<Vec<Option<bool>>> = courses
                .map(|(stretch, course)| {
                    let pieces = course.counted().chunks(PIECE);
                    pieces
                        .map(|piece| contradicts(piece, colours[stretch.record]))
                        .collect()
                })
                .collect();
            let more = self.cut(&flags);
            if more.is_empty() {
                break;
            }
            left_out.extend(more);
        }
        self.measure_noise();
        left_out
    }

    /// The colour of the noise of the response in a record; that of velocities and accelerations is measured near the harmonic anyway.
    fn colour(&self, record: usize) -> f64 {
        let courses = self.stretches.iter().zip(&self.courses);
        let of_record = courses.filter(|(stretch, _)| stretch.record == record);
        let steps = of_record.flat_map(|(_, course)| course.counted());
        match self.records[record].recording.measurands[0] {
            Measurand::Displacement => colour(steps.map(|step| step.near / (0.5 * step.noise.trace()))),
            _ => 1.0,
        }
    }

    /// The noise of the response in each piece of the records.
    fn measure_noise(&mut self) {
        let colours: Vec<f64> = (0..self.records.len()).map(|record| self.colour(record)).collect();
        for (number, record) in self.records.iter_mut().enumerate() {
            let mut sums = vec![(Matrix2::zeros(), 0.0); record.response_noise.len()];
            let of_record = self
                .stretches
                .iter()
                .zip(&self.courses)
                .filter(|(stretch, _)| stretch.record == number);
            for step in of_record.flat_map(|(_, course)| course.counted()) {
                let (sum, count) = &mut sums[record.piece(step.begin)];
                (*sum, *count) = (*sum + step.noise, *count + 1.0);
            }
            for (noise, (sum, count)) in record.response_noise.iter_mut().zip(sums) {
                if count > 0.0 {
                    *noise = sum * (colours[number] / count);
                }
            }
        }
    }

    /// Cuts the flagged pieces, and what the plant did not reach, out of the stretches; returns them. `flags`: [`Cut::contradicts`] of pieces that do
    /// not belong.
    fn cut(&mut self, flags: &[Vec<Option<bool>>]) -> Vec<Cut> {
        let (mut kept, mut left_out) = (Vec::new(), Vec::new());
        for ((Stretch { record, span: [from, to] }, course), flags) in
            self.stretches.iter().zip(&self.courses).zip(flags)
        {
            let period = self.records[*record].period;
            let of = |from: usize, to: usize| Stretch { record: *record, span: [from, to] };
            if course.counted().is_empty() && course.steps.len() > PIECE {
                left_out.push(Cut { stretch: of(*from, *to), contradicts: false });
                continue;
            }
            let (mut begin, mut reached) = (*from, *from);
            for (piece, flag) in course.counted().chunks(PIECE).zip(flags) {
                let [first, last] = [piece[0].begin, piece[piece.len() - 1].end];
                if let Some(contradicts) = *flag {
                    kept.push(of(begin, first));
                    left_out.push(Cut { stretch: of(first, last), contradicts });
                    begin = last;
                }
                reached = last;
            }
            if reached + 2 * period < *to {
                // Lost: what follows may be another motion, or the same again.
                kept.push(of(begin, reached));
                let again = (reached + PIECE * period).min(*to);
                left_out.push(Cut { stretch: of(reached, again), contradicts: false });
                begin = again;
            }
            kept.push(of(begin, *to));
        }
        let is_long = |stretch: &Stretch| {
            let [from, to] = stretch.span;
            to.saturating_sub(from) > 2 * PIECE * self.records[stretch.record].period
        };
        kept.retain(is_long);
        self.stretches = kept;
        left_out
    }

    /// The pieces whose innovations have no derivative by a parameter, up to [`ROUGH`]: beside these parameters, the plant has another motion there.
    fn rough(&self, x: &Unknowns) -> Vec<Vec<Option<bool>>> {
        let unknowns = (0..UNKNOWNS).filter(|i| *i != 5);
        let beside: Vec<_> = unknowns
            .map(|i| [RECORD_DIFFERENCE, -RECORD_DIFFERENCE].map(|step| self.each(&shifted(x, i, step))))
            .collect();
        let flags = |(stretch, here): (usize, &Vec<Vector2<f64>>)| {
            let pieces = here.chunks(PIECE).enumerate().map(|(n, piece)| {
                let is_rough = |[up, down]: &[Vec<Vec<Vector2<f64>>>; 2]| {
                    let [up, down] = [up, down].map(|one| one[stretch].iter().skip(n * PIECE));
                    let (mut even, mut odd, mut count) = (0.0, 0.0, 0);
                    for ((here, up), down) in piece.iter().zip(up).zip(down) {
                        even += (up + down - here * 2.0).norm_squared();
                        odd += (up - down).norm_squared();
                        count += 1;
                    }
                    count < piece.len() || even > ROUGH * ROUGH * odd
                };
                beside.iter().any(is_rough).then_some(false)
            });
            pieces.collect()
        };
        self.each(x).iter().enumerate().map(flags).collect()
    }

    /// The pieces that contradict the others: chi-square would fall too far without them, and with parameters fitted to the rest. A piece that does
    /// not belong bends the fit, so that its own innovations are small and others seem not to belong: the worst ones come first.
    fn contradicting(&self, minimum: &Minimum) -> Vec<Vec<Option<bool>>> {
        let counts: Vec<usize> = self.courses.iter().map(|one| one.counted().len()).collect();
        let first = minimum.residuals.len() - 2 * counts.iter().sum::<usize>();
        let (normal, gradient) = minimum.equations();
        let step = normal.cholesky().map_or(Unknowns::zeros(), |one| one.solve(&gradient));
        // What chi-square falls by: the innovations, and what all others gain by the step of the parameters to their own minimum.
        let fall = |rows: std::ops::Range<usize>| -> f64 {
            let (mut rest, mut pull, mut own) = (normal * (1.0 + SUM_ROUNDING), Unknowns::zeros(), 0.0);
            for (residual, row) in minimum.residuals[rows.clone()].iter().zip(&minimum.derivatives[rows]) {
                let residual = residual - row.dot(&step);
                rest.ger(-1.0, row, row, 1.0);
                (pull, own) = (pull + row * residual, own + residual * residual);
            }
            own + rest.cholesky().map_or(0.0, |one| one.solve(&pull).dot(&pull))
        };
        let mut from = first;
        let pieces = |count: &usize| -> Vec<f64> {
            let begin = from;
            from += 2 * count;
            let starts = (begin..from).step_by(2 * PIECE);
            starts.map(|start| fall(start..from.min(start + 2 * PIECE))).collect()
        };
        let falls: Vec<Vec<f64>> = counts.iter().map(pieces).collect();
        let most = falls.iter().flatten().copied().fold(0.0, f64::max);
        let p = PIECE_FALSE_ALARM / falls.concat().len().max(1) as f64;
        let limit = ChiSquared::new(2.0 * PIECE as f64).map_or(f64::INFINITY, |one| one.inverse_cdf(1.0 - p));
        let flag = |fall: &f64| (*fall > limit.max(0.5 * most)).then_some(true);
        let flags = |one: &Vec<f64>| one.iter().map(flag).collect();
        falls.iter().map(flags).collect()
    }
}

impl Misfit<UNKNOWNS> for Followed<'_> {
    type Trace = Vec<Nearest>;

    fn residuals(&self, x: &Unknowns, near: &Vec<Nearest>) -> Option<(Vec<f64>, Vec<Nearest>)> {
        let (mut residuals, places) = self.problem.residuals(x, near)?;
        residuals.push((x[6] - JUMP.value) / JUMP.uncertainty);
        residuals.extend(self.held.map(|(function, value)| HOLD * (function.dot(x) - value)));
        residuals.extend(self.all(x)?);
        Some((residuals, places))
    }

    fn derivatives(&self, x: &Unknowns, at: &Vec<Nearest>) -> Option<Vec<Unknowns>> {
        let mut rows = self.problem.derivatives(x, at)?;
        let here = self.all(x)?;
        let column = |i: usize| {
            if i == 5 {
                Some(here.clone())
            } else {
                self.all(&shifted(x, i, RECORD_DIFFERENCE))
            }
        };
        let columns: Option<Vec<Vec<f64>>> = (0..UNKNOWNS).map(column).collect();
        let columns = columns?;
        let row = |n: usize| Unknowns::from_fn(|i, _| (columns[i][n] - here[n]) / RECORD_DIFFERENCE);
        rows.push(Unknowns::ith(6, 1.0 / JUMP.uncertainty));
        rows.extend(self.held.map(|(function, _)| HOLD * function));
        rows.extend((0..here.len()).map(row));
        Some(rows)
    }

    fn limits(&self) -> [[f64; 2]; UNKNOWNS] {
        LIMITS
    }
}

type Minimum = LeastSquares<UNKNOWNS, Vec<Nearest>>;

impl Followed<'_> {
    /// The minimum that is reached from these parameters, and what is left out; `None` where too little belongs, or too much contradicts it.
    fn search(&mut self, mut x: Unknowns) -> Option<(Minimum, Vec<Cut>)> {
        let mut out = self.linearise(&x);
        for _ in 0..MOST_ROUNDS {
            out.extend(self.linearise(&x));
            if self.impacts == 0 && !out.is_empty() {
                return None;
            }
            let minimum = Minimum::minimum(self, x, &Vec::new(), RECORD_GAIN)?;
            if self.impacts == 0 && Self::contradicts(&minimum) {
                return None;
            }
            let moved = minimum.x - x;
            x = minimum.x;
            let is_first = self.least_noise > 0.0;
            self.least_noise = 0.0;
            let moves = minimum.derivatives.iter().map(|row| row.dot(&moved).powi(2));
            if is_first || moves.sum::<f64>() >= STILL {
                continue;
            }
            let rough = self.cut(&self.rough(&x));
            if !rough.is_empty() {
                out.extend(rough);
                continue;
            }
            let more = self.cut(&self.contradicting(&minimum));
            if more.is_empty() {
                let is_found = self.followed() >= self.fewest && !self.is_contradicted(&out, &x);
                return Some((minimum, out)).filter(|_| is_found);
            }
            out.extend(more);
        }
        None
    }

    /// Whether a third of what lies in the range of the fitted motion contradicts it: then the model is wrong, and the rest only looks like it. Beyond
    /// this range it is another motion, which says nothing about the model.
    fn is_contradicted(&self, left_out: &[Cut], x: &Unknowns) -> bool {
        let Some([fold, loss]) = range_of(x, self.problem.definition) else {
            return false;
        };
        let is_within = |Stretch { record, span: [from, _] }: &Stretch| {
            let Measured { recording, period, .. } = &self.records[*record];
            let first = recording.response.get(*from..from + period);
            first.is_some_and(|first| (fold..loss).contains(&harmonic(first).norm()))
        };
        let cut = left_out.iter().filter(|cut| cut.contradicts).map(|cut| cut.stretch);
        2 * samples(cut.filter(is_within)) > self.followed()
    }

    /// The search from other parameters, with all stretches.
    fn again(&self, all: &[Stretch], x: Unknowns) -> Option<(Self, (Minimum, Vec<Cut>))> {
        let mut again = Self { stretches: all.to_vec(), ..self.clone() };
        let found = again.search(x)?;
        Some((again, found))
    }

    /// The search again, with all stretches, until it ends where it began: by better parameters more belongs, and a narrow valley ends it early.
    fn completed(self, found: (Minimum, Vec<Cut>), all: &[Stretch]) -> (Self, Minimum, Vec<Cut>, Covariance) {
        let (mut followed, (mut minimum, mut out)) = (self, found);
        loop {
            let again = Some(minimum.x).filter(|_| followed.stretches != all);
            let again = again.and_then(|x| followed.again(all, x));
            if let Some(found) = again.filter(|(again, _)| again.followed() > followed.followed()) {
                (followed, (minimum, out)) = found;
                continue;
            }
            let (covariance, lower) = followed.covariance(&minimum);
            let again = lower.and_then(|lower| followed.again(all, lower));
            let each = |minimum: &Minimum| minimum.chi_square / minimum.residuals.len() as f64;
            let is_better = |(again, (next, _)): &(Followed, (Minimum, _))| {
                let more = again.followed().cmp(&followed.followed());
                more.is_gt() || more.is_eq() && each(next) < each(&minimum)
            };
            let Some(found) = again.filter(is_better) else {
                return (followed, minimum, out, covariance);
            };
            (followed, (minimum, out)) = found;
        }
    }

    /// The fit at a minimum, with the tests of its innovations. `None` with fewer equations than unknowns.
    fn fit(&self, minimum: &Minimum, covariance: Covariance, left_out: Vec<LeftOut>) -> Option<RecordFit> {
        let innovations: Vec<Vector2<f64>> = self.each(&minimum.x).concat();
        let count = innovations.len();
        let mut fit = self.problem.found(minimum, &minimum.trace);
        fit.covariance = covariance;
        fit.degrees = (2 * count + self.problem.equations()).checked_sub(5 + usize::from(self.problem.has_scale))?;
        let channel = |i: usize| innovations.iter().map(move |one| one[i]);
        let free = minimum.covariance();
        let rows = &minimum.derivatives[minimum.derivatives.len() - 2 * count..];
        for i in 0..2 {
            // Degrees of freedom that the parameters take of the channel.
            let taken: f64 = rows.iter().skip(i).step_by(2).map(|row| row.dot(&(free * row))).sum();
            fit.channels[i] = ChannelTest::of(channel(i).map(|one| one * one).sum(), count as f64 - taken);
        }
        let neighbours =
            |i: usize| mean(innovations.windows(2).map(|pair| pair[0][i] * pair[1][i])) / mean_square(channel(i));
        let colour = 0.5 * (neighbours(0) + neighbours(1));
        // Sums of coloured innovations vary more, by this factor if each is a part of the one before and new noise.
        fit.covariance *= ((1.0 + colour) / (1.0 - colour)).max(1.0);
        Some(RecordFit { fit, periods: count, left_out, colour })
    }

    /// Samples that are followed.
    fn followed(&self) -> usize {
        samples(self.stretches.iter().copied())
    }

    /// Covariance of the unknowns, by the likelihood ratio in the direction that is determined least: chi-square may be far from a parabola there, as
    /// after a short decay, which hardly tells b and epsilon apart. From the minimum on, steps to both sides are doubled and the other unknowns
    /// fitted, until chi-square has risen by [`END`]. The largest displacement over the square root of its rise (where that is above 1) takes the
    /// place of the standard deviation. Where chi-square falls by more than 1 on the way, another minimum is near: returns the place as well.
    fn covariance(&mut self, minimum: &Minimum) -> (Covariance, Option<Unknowns>) {
        let covariance = minimum.covariance();
        let scale = covariance.diagonal().map(f64::sqrt);
        if !scale.iter().all(|one| one.is_normal()) {
            return (covariance, None);
        }
        let eigen = covariance.component_div(&(scale * scale.transpose())).symmetric_eigen();
        let weakest = eigen.eigenvalues.imax();
        let (direction, length) = (eigen.eigenvectors.column(weakest), eigen.eigenvalues[weakest].sqrt());
        let deviation = direction.component_mul(&scale) * length;
        // In standard deviations.
        let function = direction.component_div(&scale) / length;
        let mut reached = Vec::new();
        for side in [-1.0, 1.0] {
            let (mut step, mut moved) = (side, deviation * side);
            loop {
                self.held = Some((function, function.dot(&minimum.x) + step));
                let Some(found) = Minimum::minimum(self, minimum.x + moved, &minimum.trace, RECORD_GAIN) else {
                    break;
                };
                moved = found.x - minimum.x;
                reached.push((moved, found.chi_square - minimum.chi_square));
                if found.chi_square > minimum.chi_square + END {
                    break;
                }
                (step, moved) = (2.0 * step, 2.0 * moved);
            }
        }
        self.held = None;
        let lowest = reached.iter().min_by(|one, other| one.1.total_cmp(&other.1));
        let fall = lowest.map_or(0.0, |(_, rise)| -rise.min(0.0));
        let lower = lowest.filter(|_| fall > 1.0).map(|(moved, _)| minimum.x + moved);
        let steps = reached
            .iter()
            .map(|(moved, rise)| moved / (rise + fall).max(1.0).sqrt());
        let length = |step: &Unknowns| function.dot(step).abs();
        let widest = steps.fold(
            deviation,
            |widest, step| {
                if length(&step) > length(&widest) { step } else { widest }
            },
        );
        let covariance = covariance - deviation * deviation.transpose() + widest * widest.transpose();
        (covariance, lower)
    }
}

impl Followed<'_> {
    /// Whether a structure that no particle touches, with its own frequency and damping, contradicts what is followed. `expected`: about which rig it
    /// is. A free particle and one that is carried along differ in frequency and damping only.
    fn needs_impacts(&self, expected: &Parameters) -> bool {
        // The particle rests in the middle of a cavity that no response fills.
        let wide = Parameters { half_width: WIDE_CAVITY * expected.half_width, ..*expected };
        let (known, x) = (expectations(&wide), start_at(&wide));
        let problem = Problem {
            free: true,
            known: &known,
            points: Vec::new(),
            ..self.problem.clone()
        };
        let mut linear = Followed {
            problem: &problem,
            impacts: 0,
            least_noise: STRONG,
            fewest: 0,
            ..self.clone()
        };
        linear.search(x).is_none()
    }

    /// Whether the innovations are too large for what is followed, at the probability [`PIECE_FALSE_ALARM`].
    fn contradicts(minimum: &Minimum) -> bool {
        let degrees = minimum.residuals.len() as f64 - 2.0;
        probability(minimum.chi_square, degrees).is_none_or(|p| p < PIECE_FALSE_ALARM)
    }
}

/// Neighbouring parts of a record that may be 1:1, as stretches, with what is near them.
fn stretches_of(record: usize, parts: &[Part], measured: &Measured) -> Vec<Stretch> {
    let mut spans: Vec<[usize; 2]> = Vec::new();
    let gap = STRETCH_MARGIN * measured.period;
    for part in parts
        .iter()
        .filter(|part| part.candidate.is_some() || part.kind == Kind::Decay)
    {
        let [from, to] = part
            .seconds
            .map(|time| (time / measured.recording.sample_time) as usize);
        match spans.last_mut() {
            Some([_, last]) if from < *last + 2 * gap => *last = to,
            _ => spans.push([from, to]),
        }
    }
    let wider = |[from, to]: [usize; 2]| {
        [
            from.saturating_sub(gap),
            (to + gap).min(measured.recording.response.len()),
        ]
    };
    spans
        .into_iter()
        .map(|span| Stretch { record, span: wider(span) })
        .collect()
}

/// What is expected of a rig.
fn expectations(expected: &Parameters) -> Vec<Known> {
    let wide = Quantity::FITTED.iter().zip(EXPECTED).map(|(quantity, range)| {
        let value = quantity.of_plant(expected);
        let uncertainty = range * if *quantity == Quantity::R { 1.0 } else { value };
        Known::Value {
            quantity: *quantity,
            estimate: Estimate { value, uncertainty },
        }
    });
    wide.collect()
}

/// Where the search begins: at the fit of points and of what is expected.
fn start(points: &[MeasuredPoint], definition: Definition, expected: &Parameters, known: &[Known]) -> Option<Unknowns> {
    let known: Vec<Known> = known.iter().copied().chain(expectations(expected)).collect();
    // With what is expected, one point is enough.
    let of_few = |_| Problem::new(points.to_vec(), definition, &known).fit_from(std::iter::once(unknowns(expected)));
    let fit = fit(points, definition, expected, &known).or_else(of_few).ok()?;
    Some(start_at(&fit.plant(expected)))
}

/// The unknowns of a plant.
fn start_at(plant: &Parameters) -> Unknowns {
    let mut x = unknowns(plant);
    x[6] = JUMP.value;
    x
}

/// Fits the five parameters to records and points. `recordings`: prepared records ([`Recording::prepared`]) with their parts; `expected`: about
/// which rig it is. `None` where the plant does not follow half of the stretches.
#[must_use]
pub fn follow(
    recordings: &[Recording],
    parts: &[Vec<Part>],
    points: &[MeasuredPoint],
    definition: Definition,
    expected: &Parameters,
    known: &[Known],
) -> Option<RecordFit> {
    // In place of the strength of an effect: the share of the jumps.
    let problem = Problem {
        free: true,
        ..Problem::new(points.to_vec(), definition, known)
    };
    let mut all = points.to_vec();
    all.extend(parts.iter().flatten().filter_map(|part| part.candidate));
    let u = |point: &MeasuredPoint| point.drive.uncertainty / point.drive.value;
    all.sort_by(|one, other| u(one).total_cmp(&u(other)));
    // Points of another motion may lead all of them astray: the best one alone follows.
    let starts = [&all[..], &all[..all.len().min(1)]].map(|points| start(points, definition, expected, known));
    let omega = starts.iter().flatten().next()?[0].exp();
    let records: Vec<Measured> = recordings
        .iter()
        .map(|recording| Measured::new(recording, omega, expected.natural_frequency()))
        .collect();
    let numbered = records.iter().zip(parts).enumerate();
    let stretches = numbered
        .flat_map(|(n, (one, parts))| stretches_of(n, parts, one))
        .collect();
    let shown = recordings.iter().zip(parts).flat_map(|(one, parts)| {
        let shown = parts.iter().filter(|part| part.point.is_some());
        shown.map(|part| (part.seconds[1] - part.seconds[0]) / one.sample_time)
    });
    let followed = Followed {
        problem: &problem,
        records,
        stretches,
        courses: Vec::new(),
        least_noise: STRONG,
        held: None,
        impacts: 2,
        beside: false,
        fewest: (0.5 * shown.sum::<f64>()) as usize,
    };
    let all = followed.stretches.clone();
    // Without noise, a second harmonic shows wrong parameters first.
    let tried = [false, true].map(|beside| starts.into_iter().flatten().map(move |x| (x, beside)));
    let mut searched = tried.into_iter().flatten().map(|(x, beside)| {
        let mut followed = Followed { beside, ..followed.clone() };
        followed.search(x).map(|found| (followed, found))
    });
    let (followed, found) = searched.find_map(|found| found)?;
    let (followed, minimum, out, covariance) = followed.completed(found, &all);
    // A particle that slides looks like one in another cavity: without a third harmonic of impacts, the rig must be about the expected one.
    let is_shown = parts.iter().flatten().any(|part| part.regime == Regime::Symmetric);
    let strange = expectations(expected)
        .iter()
        .flat_map(|one| one.residuals(&minimum.x))
        .map(|one| one * one)
        .sum();
    let is_strange = probability(strange, 5.0).is_none_or(|p| p < PIECE_FALSE_ALARM);
    if !is_shown && is_strange || !followed.needs_impacts(expected) {
        return None;
    }
    let left_out = out.iter().map(|Cut { stretch: Stretch { record, span }, .. }| {
        let Recording { origin, sample_time, .. } = &recordings[*record];
        LeftOut {
            origin: origin.clone(),
            seconds: span.map(|n| n as f64 * sample_time),
        }
    });
    followed.fit(&minimum, covariance, left_out.collect())
}
