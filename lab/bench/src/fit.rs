//! Parameters of a rig from measured points of its backbone: natural frequency, damping ratio, restitution, half-width of the cavity and mass
//! ratio, with their covariance.
//!
//! The model is the exact symmetric 1:1 motion at the phase of each point ([`backbone_at_speed`]): a curve over the particle speed B, with the amplitude
//! `A = b C`, the frequency `omega = omega0 Omega` and the drive `E = b epsilon G`. A measured point has all three, each with a standard
//! uncertainty. For given parameters, the B of a point is where its weighted distance from the curve is smallest. The sum of the squared distances
//! is chi-square; the parameters minimise it (Levenberg and Marquardt). Half of its second derivative, with every B eliminated, is the inverse
//! of the covariance.

mod channels;
mod effects;
mod known;
mod record;
mod recording;

use std::cmp::Ordering;
use std::f64::consts::{FRAC_PI_2, TAU};

use lovines::Cavity;
use nalgebra::{DMatrix, SMatrix, SVector, Vector3};
use serde::Serialize;
use statrs::distribution::{ChiSquared, ContinuousCDF};
use thiserror::Error;
use vines_model::Definition;
use vines_model::numerics::{Estimate, LeastSquares, Misfit, Regression, SIGNIFICANT, equally_spaced, mean, range};
use vines_model::orbit::backbone_at_speed;
use vines_model::theory::{B_SYMMETRY_BREAKING, BranchSide, SlowFlow};

use crate::identification::ResonancePoint;
pub use vines_scene::scene::table::plain_table;
pub use vines_scene::scene::table::{Channel, Contents};
use vines_scene::scene::{Dimensionless, Parameters, Unit, Units};

pub use channels::Selection;
pub use effects::{Candidate, Effect, EffectReport, Explanation, Found, Measurements, decimals, explain, find};
pub use known::{Known, LinearVerdict, Quantity, linear_verdicts};
pub use record::{LeftOut, RecordFit, follow};
pub use recording::{Kind, LinearDecay, Part, Recording, RecordingError, parts};

/// A measured point of the backbone: of phase resonance, or at another phase target.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MeasuredPoint {
    /// Amplitude of the fundamental of the response, metres of the oscillator.
    pub response: Estimate,
    /// Angular frequency, rad/s.
    pub omega: Estimate,
    /// Amplitude of the base, metres of the oscillator.
    pub drive: Estimate,
    /// Phase of the response relative to the base at which it was measured, rad.
    pub phase: f64,
}

impl MeasuredPoint {
    /// A point that was measured in these units.
    pub fn of(at: &ResonancePoint, units: &Units) -> Self {
        let estimate = |value, uncertainty| Estimate { value, uncertainty };
        let measured = Self {
            response: estimate(at.a_m, at.u_a_m),
            omega: estimate(TAU * at.f_hz, TAU * at.u_f_hz),
            drive: at.drive(),
            phase: at.phase_target_deg.to_radians(),
        };
        measured.in_metres(units)
    }

    /// This point with response and drive, which are in these units, in metres of the oscillator.
    #[must_use]
    pub fn in_metres(self, units: &Units) -> Self {
        self.each(units, Unit::in_metres)
    }

    /// This point with response and drive in these units.
    #[must_use]
    pub fn in_units(self, units: &Units) -> Self {
        self.each(units, Unit::of_metres)
    }

    fn each(self, units: &Units, convert: fn(Unit, f64) -> f64) -> Self {
        let converted = |unit, Estimate { value, uncertainty }| Estimate {
            value: convert(unit, value),
            uncertainty: convert(unit, uncertainty),
        };
        Self {
            response: converted(units.response, self.response),
            drive: converted(units.reference, self.drive),
            ..self
        }
    }

    /// The point of phase resonance with this response, to first order: `E_R = E cos p` and `omega_R = omega + (omega/2) (E/A) sin p` for a phase of p
    /// beyond phase resonance.
    fn at_resonance(&self, definition: Definition) -> Self {
        let (sine, cosine) = definition.at_phase(self.phase).off_resonance().sin_cos();
        let turned = 0.5 * sine * self.drive.value / self.response.value * self.omega.value;
        let omega = Estimate { value: self.omega.value + turned, ..self.omega };
        Self {
            omega,
            drive: self.drive.scaled(cosine),
            phase: -FRAC_PI_2,
            ..*self
        }
    }
}

/// Number of unknowns.
const UNKNOWNS: usize = 7;
/// The unknowns: the logarithm of omega0 (rad/s), zeta, r, the logarithms of b (m), epsilon and M (kg), and the strength of an effect.
type Unknowns = SVector<f64, UNKNOWNS>;
type Covariance = SMatrix<f64, UNKNOWNS, UNKNOWNS>;

/// Step of a difference, relative or, of zeta and r, absolute: the curve is exact to 1e-13, and smooth.
const CURVE_DIFFERENCE: f64 = 1e-6;
/// Restitution coefficients from which the minimisation begins: chi-square may have several minima.
const FIRST_RESTITUTIONS: [f64; 4] = [0.3, 0.5, 0.7, 0.9];
/// Number of half-widths that are tried at the start of a search.
const WIDTHS: usize = 8;
/// Relative error of first-order theory: of the drive, and of the detuning.
const THEORY: f64 = 0.04;
/// Gain of a further step, relative to one and chi-square, at which a minimum counts as found.
const CURVE_GAIN: f64 = 1e-9;
/// Smallest and largest values of the unknowns.
const LIMITS: [[f64; 2]; UNKNOWNS] = {
    let mut limits = [[f64::NEG_INFINITY, f64::INFINITY]; UNKNOWNS];
    limits[1] = [0.0, 1.0];
    limits[2] = [1e-3, 1.0];
    limits
};
/// Numbers of the largest or the smallest responses without which the fit is tried.
const TRIMMED: [usize; 4] = [1, 2, 4, 8];
/// Probability at which points that belong to the motion are left out, for all choices together.
const POINT_FALSE_ALARM: f64 = 1e-3;
/// Relative gain of the squared distance from the curve at which the nearest place on it counts as found.
const NEAREST: f64 = 1e-12;
/// Fewest points: two equations each for five parameters, and one to spare.
const FEWEST_POINTS: usize = 3;
/// Probability of a larger chi-square below which the model is rejected.
const REJECTED: f64 = 0.01;
/// The share of the points that may be left out is the inverse of this.
const LEFT_OUT: usize = 5;

fn unknowns(plant: &Parameters) -> Unknowns {
    Unknowns::from([
        plant.natural_frequency().ln(),
        0.5 * plant.damping / (plant.stiffness * plant.primary_mass).sqrt(),
        plant.restitution,
        plant.half_width.ln(),
        plant.mass_ratio().ln(),
        plant.primary_mass.ln(),
        0.0,
    ])
}

/// The plant of some unknowns.
fn plant(x: &Unknowns, cavity: Cavity) -> Parameters {
    Parameters {
        primary_mass: Quantity::PrimaryMass.of(x),
        stiffness: Quantity::Stiffness.of(x),
        damping: Quantity::Damping.of(x).max(0.0),
        particle_mass: Quantity::ParticleMass.of(x),
        half_width: Quantity::B.of(x),
        restitution: Quantity::R.of(x),
        cavity,
    }
}

/// The dimensionless numbers of some unknowns.
fn model(x: &Unknowns, definition: Definition) -> Dimensionless {
    let epsilon = x[4].exp();
    Dimensionless {
        definition,
        ..Dimensionless::new(epsilon, 2.0 * x[1] / epsilon, x[2], 0.0)
    }
}

/// Smallest and largest responses of the 1:1 motion, m: at the fold, and at the loss of symmetry.
fn range_of(x: &Unknowns, definition: Definition) -> Option<[f64; 2]> {
    let manifold = SlowFlow::new(0.0, x[2]).manifold;
    let [fold, loss] = [manifold.b_min(), B_SYMMETRY_BREAKING]
        .map(|speed| Some(x[3].exp() * backbone_at_speed(&model(x, definition), speed)?[1]));
    Some([fold?, loss?])
}

/// The gradient of a quantity.
fn gradient(x: &Unknowns, of: impl Fn(&Unknowns) -> f64) -> Unknowns {
    Unknowns::from_fn(|i, _| {
        // The strength of an effect may be small, and is not negative.
        let step = if i == 6 && x[6] != 0.0 {
            CURVE_DIFFERENCE * x[6]
        } else {
            CURVE_DIFFERENCE
        };
        let [below, above] = [-step, step].map(|step| of(&shifted(x, i, step)));
        (above - below) / (2.0 * step)
    })
}

/// Derivative by a step.
fn slope(at: impl Fn(f64) -> Option<Vector3<f64>>) -> Option<Vector3<f64>> {
    Some((at(CURVE_DIFFERENCE)? - at(-CURVE_DIFFERENCE)?) / (2.0 * CURVE_DIFFERENCE))
}

fn shifted(x: &Unknowns, i: usize, step: f64) -> Unknowns {
    let mut x = *x;
    x[i] += step;
    x
}

/// Why there is no fit.
#[derive(Debug, Error)]
#[expect(missing_docs, reason = "the messages explain the variants")]
pub enum FitError {
    #[error(
        "{0} points are too few for the five parameters: at least {FEWEST_POINTS} at different amplitudes are needed"
    )]
    TooFew(usize),
    #[error("point {number}: {what} = {value} ± {uncertainty}: both must be finite, and above 0")]
    NotPositive {
        number: usize,
        what: &'static str,
        value: f64,
        uncertainty: f64,
    },
    #[error(
        "no symmetric 1:1 motion has these points, whatever the parameters: are amplitudes in m, frequencies in Hz or rad/s as stated?"
    )]
    NoMotion,
    #[error(
        "the points do not determine the five parameters: measure at further amplitudes, or give a parameter that is known"
    )]
    Undetermined,
    #[error(transparent)]
    Recording(#[from] RecordingError),
}

/// The fitted rig.
#[derive(Debug, Clone)]
pub struct Fit {
    x: Unknowns,
    covariance: Covariance,
    has_scale: bool,
    /// Chi-square.
    pub chi_square: f64,
    /// Its degrees of freedom.
    pub degrees: usize,
    /// Residuals of the points over their standard uncertainties: response, frequency, drive.
    pub residuals: Vec<[f64; 3]>,
    /// Numbers, from 0, of the points that contradict the others and are left out.
    pub left_out: Vec<usize>,
    /// Particle speeds B of the points.
    speeds: Vec<f64>,
    /// Chi-square of response, frequency and drive.
    pub channels: [ChannelTest; 3],
}

/// Chi-square of one channel: whether its uncertainties have the right size.
#[derive(Debug, Clone, Copy, Default, Serialize)]
pub struct ChannelTest {
    /// Sum of the squares of the residuals over their standard uncertainties.
    pub chi_square: f64,
    /// Its mean if the model and the uncertainties are right.
    pub expected: f64,
    /// Probability of a larger one; absent if the points say nothing about this channel.
    pub p_value: Option<f64>,
}

impl ChannelTest {
    /// The test of a channel, from the part of the residuals' covariance that belongs to it (Satterthwaite's approximation: a multiple of a
    /// chi-square with the same mean and variance).
    fn new(chi_square: f64, covariance: &DMatrix<f64>) -> Self {
        let (expected, squares) = (covariance.trace(), covariance.norm_squared());
        let p_value = probability(chi_square * expected / squares, expected * expected / squares);
        Self { chi_square, expected, p_value }
    }

    /// The test of a sum of the squares of independent residuals.
    fn of(chi_square: f64, expected: f64) -> Self {
        let p_value = probability(chi_square, expected);
        Self { chi_square, expected, p_value }
    }

    /// What its size says about the uncertainties of this channel, at a probability of 1 % for all channels and both sides.
    #[must_use]
    pub fn verdict(&self) -> Option<Ordering> {
        let limit = REJECTED / 6.0;
        match self.p_value? {
            p if p < limit => Some(Ordering::Less),
            p if p > 1.0 - limit => Some(Ordering::Greater),
            _ => None,
        }
    }
}

/// The test of each channel. `covariance`: that of the unknowns.
fn channels<T: Clone>(
    fit: &LeastSquares<UNKNOWNS, T>,
    places: &[Nearest],
    covariance: &Covariance,
) -> [ChannelTest; 3] {
    std::array::from_fn(|channel| {
        // The covariance of the residuals is what remains of the unit matrix beside the directions that the fit can follow.
        let row = |n: usize| fit.derivatives[3 * n + channel];
        let remaining = DMatrix::from_fn(places.len(), places.len(), |n, m| {
            let beside = 1.0 - places[n].along.normalize()[channel].powi(2);
            f64::from(u8::from(n == m)) * beside - (row(n).transpose() * covariance * row(m))[0]
        });
        let residuals = (0..places.len()).map(|n| fit.residuals[3 * n + channel]);
        ChannelTest::new(residuals.map(|one| one * one).sum(), &remaining)
    })
}

impl Fit {
    /// A quantity; `None` for a mass, a stiffness or a damping if none of them is known.
    #[must_use]
    pub fn estimate(&self, quantity: Quantity) -> Option<Estimate> {
        let gradient = quantity.gradient(&self.x);
        let variance = (gradient.transpose() * self.covariance * gradient)[0];
        (self.has_scale || !quantity.needs_a_scale())
            .then(|| Estimate { value: quantity.of(&self.x), uncertainty: variance.sqrt() })
    }

    /// Correlation of two quantities.
    #[must_use]
    pub fn correlation(&self, first: Quantity, second: Quantity) -> f64 {
        let [a, b] = [first, second].map(|quantity| quantity.gradient(&self.x));
        let covariance = |a: &Unknowns, b: &Unknowns| (a.transpose() * self.covariance * b)[0];
        covariance(&a, &b) / (covariance(&a, &a) * covariance(&b, &b)).sqrt()
    }

    /// The probability of a larger chi-square if the model is right; `None` without a degree of freedom.
    #[must_use]
    pub fn p_value(&self) -> Option<f64> {
        probability(self.chi_square, self.degrees as f64)
    }

    /// Whether the points contradict the model.
    #[must_use]
    pub fn is_rejected(&self) -> bool {
        self.p_value().is_some_and(|p| p < REJECTED)
    }

    /// The fitted quantities that the points do not determine: the interval of three standard uncertainties contains 0.
    #[must_use]
    pub fn undetermined(&self) -> Vec<Quantity> {
        let is_determined = |estimate: Estimate| estimate.value.abs() > SIGNIFICANT * estimate.uncertainty;
        let fitted = Quantity::FITTED.iter().copied();
        fitted
            .filter(|quantity| !self.estimate(*quantity).is_some_and(is_determined))
            .collect()
    }

    /// The plant of the fit; without a known mass, stiffness or damping, its primary mass is that of `scene`.
    #[must_use]
    pub fn plant(&self, scene: &Parameters) -> Parameters {
        let mut x = self.x;
        if !self.has_scale {
            x[5] = scene.primary_mass.ln();
        }
        plant(&x, scene.cavity)
    }
}

/// Fits the parameters to `points`. The rig `expected` is where the search begins; the points show resonance as `definition` says.
///
/// Points without which the rest fits significantly better are left out, as `Problem::without_strangers` finds them. If that does not make the
/// model describe the others, the fit is that of all points, and rejected.
///
/// # Errors
/// Too few points, numbers that are not positive, and points that no symmetric 1:1 motion has, or that do not determine the parameters.
pub fn fit(
    points: &[MeasuredPoint],
    definition: Definition,
    expected: &Parameters,
    known: &[Known],
) -> Result<Fit, FitError> {
    let problem = Problem::new(checked(points)?, definition, known);
    let all = problem.fit(expected)?;
    let (mut kept, mut fit): (Vec<usize>, _) = ((0..points.len()).collect(), all.clone());
    while let Some(rest) = problem.without_strangers(&kept, &fit) {
        (kept, fit) = rest;
    }
    if fit.is_rejected() {
        return Ok(all);
    }
    fit.left_out = (0..points.len()).filter(|n| !kept.contains(n)).collect();
    Ok(fit)
}

/// Probability that a chi-square with this number of degrees of freedom is larger; `None` without a degree of freedom.
fn probability(chi_square: f64, degrees: f64) -> Option<f64> {
    let p = ChiSquared::new(degrees).ok()?.sf(chi_square.max(0.0));
    p.is_finite().then_some(p)
}

/// The points, if they are enough and their numbers are positive.
fn checked(points: &[MeasuredPoint]) -> Result<Vec<MeasuredPoint>, FitError> {
    if points.len() < FEWEST_POINTS {
        return Err(FitError::TooFew(points.len()));
    }
    for (n, point) in points.iter().enumerate() {
        let estimates = [point.response, point.omega, point.drive];
        for (what, Estimate { value, uncertainty }) in ["response", "frequency", "drive"].into_iter().zip(estimates) {
            let is_positive = |number: f64| number > 0.0 && number.is_finite();
            if !(is_positive(value) && is_positive(uncertainty)) {
                return Err(FitError::NotPositive { number: n + 1, what, value, uncertainty });
            }
        }
    }
    Ok(points.to_vec())
}

/// As [`fit`], with the parameters held at those of `plant`: its chi-square and residuals say whether the points belong to the plant, and its
/// uncertainties are the Cramér–Rao bound of the points. `None` where the plant has no such motion.
#[must_use]
pub fn at(points: &[MeasuredPoint], definition: Definition, plant: &Parameters, known: &[Known]) -> Option<Fit> {
    let problem = Problem::new(points.to_vec(), definition, known);
    let here = LeastSquares::at(&problem, unknowns(plant), &Vec::new())?;
    Some(Fit {
        degrees: problem.equations(),
        ..problem.found(&here, &here.trace)
    })
}

/// How points contradict the rig that is expected.
#[derive(Debug, Clone)]
pub struct Contradiction {
    /// Number of points.
    pub points: usize,
    /// Their chi-square at the expected rig.
    pub chi_square: f64,
    /// Its degrees of freedom.
    pub degrees: usize,
    /// The parameters of an ideal cavity that differ significantly; absent if none describes the points, or these are too few for a fit.
    pub parameters: Option<Vec<FittedParameter>>,
}

/// How the points contradict the rig `expected`. `None` where they do not, or cannot tell, or where the rig has effects of a real cavity, which
/// the model has not. What is systematic in the uncertainties of points is alike from point to point. Where no parameter differs, it may be one error,
/// whose square all of chi-square repeats.
#[must_use]
pub fn contradiction(points: &[MeasuredPoint], definition: Definition, expected: &Parameters) -> Option<Contradiction> {
    let scene = Some(expected).filter(|expected| expected.cavity == Cavity::IDEAL)?;
    let Fit { chi_square, degrees, .. } = at(points, definition, scene, &[]).filter(Fit::is_rejected)?;
    let fitted = match fit(points, definition, expected, &[]) {
        Err(FitError::TooFew(_)) => None,
        fitted => Some(fitted.ok()?).filter(|fit| !fit.is_rejected()),
    };
    let differs = |one: &FittedParameter| (one.value - one.expected).abs() > SIGNIFICANT * one.uncertainty;
    let parameters: Option<Vec<_>> =
        fitted.map(|fit| fit.report(expected).parameters.into_iter().filter(differs).collect());
    let may_be_one = || probability(chi_square / degrees as f64, 1.0).is_none_or(|p| p >= REJECTED);
    if parameters.as_ref().is_some_and(Vec::is_empty) && may_be_one() {
        return None;
    }
    Some(Contradiction { points: points.len(), chi_square, degrees, parameters })
}

/// What is minimised.
#[derive(Clone)]
struct Problem<'a> {
    points: Vec<MeasuredPoint>,
    definition: Definition,
    known: &'a [Known],
    has_scale: bool,
    /// Whether the strength of the effect is unknown.
    free: bool,
}

/// Where the curve is nearest to a point: the particle speed, and the direction of the curve in the space of the residuals.
#[derive(Debug, Clone, Copy)]
struct Nearest {
    speed: f64,
    along: Vector3<f64>,
}

/// A search for the place of the curve that is nearest to a point.
struct Distance<'a> {
    problem: &'a Problem<'a>,
    x: &'a Unknowns,
    point: usize,
}

impl Misfit<1> for Distance<'_> {
    type Trace = ();

    fn residuals(&self, speed: &SVector<f64, 1>, (): &()) -> Option<(Vec<f64>, ())> {
        let residual = self.problem.residual(self.x, self.point, speed[0])?;
        Some((residual.as_slice().to_vec(), ()))
    }

    fn derivatives(&self, speed: &SVector<f64, 1>, (): &()) -> Option<Vec<SVector<f64, 1>>> {
        let slope = slope(|step| self.problem.residual(self.x, self.point, speed[0] + step))?;
        Some(slope.iter().map(|one| SVector::from([*one])).collect())
    }
}

impl Misfit<UNKNOWNS> for Problem<'_> {
    type Trace = Vec<Nearest>;

    fn residuals(&self, x: &Unknowns, near: &Vec<Nearest>) -> Option<(Vec<f64>, Vec<Nearest>)> {
        let (mut residuals, mut places) = (Vec::new(), Vec::new());
        for n in 0..self.points.len() {
            let (residual, place) = self.nearest(x, n, near.get(n).map(|one| one.speed))?;
            residuals.extend(across(&place.along, &residual).iter());
            places.push(place);
        }
        residuals.extend(self.known_residuals(x));
        Some((residuals, places))
    }

    /// The speed follows the parameters: only what is perpendicular to the curve counts.
    fn derivatives(&self, x: &Unknowns, at: &Vec<Nearest>) -> Option<Vec<Unknowns>> {
        self.rows(x, at.iter().map(|place| place.along), |n, i| {
            slope(|step| self.residual(&shifted(x, i, step), n, at[n].speed))
        })
    }

    fn limits(&self) -> [[f64; 2]; UNKNOWNS] {
        LIMITS
    }
}

/// What is perpendicular to a direction.
fn across(along: &Vector3<f64>, value: &Vector3<f64>) -> Vector3<f64> {
    let along = along.normalize();
    value - along * along.dot(value)
}

impl<'a> Problem<'a> {
    fn new(points: Vec<MeasuredPoint>, definition: Definition, known: &'a [Known]) -> Self {
        let has_scale = known.iter().any(Known::needs_a_scale);
        Self { points, definition, known, has_scale, free: false }
    }

    /// Derivatives of the residuals: those of the points perpendicular to the direction of the curve, `along`, and those of what is known.
    /// `derivative`: that of the residual of a point by an unknown.
    fn rows(
        &self,
        x: &Unknowns,
        along: impl Iterator<Item = Vector3<f64>>,
        derivative: impl Fn(usize, usize) -> Option<Vector3<f64>>,
    ) -> Option<Vec<Unknowns>> {
        let mut rows = Vec::new();
        for (n, along) in along.enumerate() {
            let mut columns = [Vector3::zeros(); UNKNOWNS];
            for i in (0..UNKNOWNS).filter(|i| *i < 5 || *i == 6 && self.free) {
                columns[i] = across(&along, &derivative(n, i)?);
            }
            rows.extend([0, 1, 2].map(|channel| Unknowns::from_fn(|i, _| columns[i][channel])));
        }
        rows.extend(self.known_rows(x));
        Some(rows)
    }

    /// Number of independent residuals.
    fn equations(&self) -> usize {
        2 * self.points.len() + self.known.iter().map(Known::equations).sum::<usize>()
    }

    /// The problem of some of the points, in their order.
    fn of(&self, kept: &[usize]) -> Self {
        let points = (0..self.points.len()).filter(|n| kept.contains(n));
        let points = points.map(|n| self.points[n]).collect();
        Self { points, ..self.clone() }
    }

    /// Whether `count` points are enough for a fit, and the points left out are at most a fifth of all.
    fn may_keep(&self, count: usize) -> bool {
        count >= FEWEST_POINTS && (self.points.len() - count) * LEFT_OUT <= self.points.len()
    }

    /// The points of `kept` that remain without those that do not belong to them, and their fit; `None` where all belong.
    ///
    /// Without k points, chi-square falls by a chi-square of 2 k degrees of freedom if all belong to one motion. The points whose fall is the least
    /// probable are left out, if that is significant: k of the largest or of the smallest responses, because the 1:1 motion exists between two
    /// unknown amplitudes, or, where the model is rejected, the one that contradicts it most. By the fit of the others, the 1:1 motion must
    /// have ended at the outermost response of several: a model that is wrong everywhere shows most at both ends.
    fn without_strangers(&self, kept: &[usize], fit: &Fit) -> Option<(Vec<usize>, Fit)> {
        let mut order = self.by_falling_response();
        order.retain(|n| kept.contains(n));
        let ends = TRIMMED.iter().flat_map(|k| [(*k, 0), (0, *k)]);
        let ends = ends.filter(|(high, low)| self.may_keep(order.len().saturating_sub(high + low)));
        let ends = ends.filter_map(|(high, low)| {
            let (rest, next) = self.rest(&order[high..order.len() - low], fit)?;
            let MeasuredPoint { response: outermost, phase, .. } =
                self.points[if high > 0 { order[0] } else { order[order.len() - 1] }];
            let [smallest, largest] = range_of(&next.x, self.definition.at_phase(phase))?;
            let aside = SIGNIFICANT * outermost.uncertainty;
            let has_ended = match high {
                0 => outermost.value - aside < smallest,
                _ => outermost.value + aside > largest,
            };
            let p = Self::gain(fit, &next, 2 * TRIMMED.len());
            has_ended.then_some((p, rest, next))
        });
        let size = |n: usize| fit.residuals[n].iter().map(|part| part * part).sum::<f64>();
        let worst = (0..kept.len()).max_by(|first, second| size(*first).total_cmp(&size(*second)))?;
        let worst = Some(worst).filter(|_| fit.is_rejected() && self.may_keep(kept.len() - 1));
        let worst = worst.and_then(|worst| {
            let (rest, next) = self.rest(&[&kept[..worst], &kept[worst + 1..]].concat(), fit)?;
            let p = Self::gain(fit, &next, self.points.len());
            Some((p, rest, next))
        });
        let (p, rest, next) = ends.chain(worst).min_by(|first, second| first.0.total_cmp(&second.0))?;
        (p < POINT_FALSE_ALARM).then_some((rest, next))
    }

    /// Bound of the probability that, if all points belong to the motion, leaving out as many of them lowers chi-square by more in any of `choices`
    /// choices (Bonferroni).
    fn gain(more: &Fit, fewer: &Fit, choices: usize) -> f64 {
        let left_out = more.speeds.len() - fewer.speeds.len();
        probability(more.chi_square - fewer.chi_square, 2.0 * left_out as f64).unwrap_or(1.0) * choices as f64
    }

    /// Some of the points, in their order, and their fit from that of more points.
    fn rest(&self, kept: &[usize], fit: &Fit) -> Option<(Vec<usize>, Fit)> {
        let mut kept = kept.to_vec();
        kept.sort_unstable();
        let problem = self.of(&kept);
        let next = problem.fit_from(std::iter::once(fit.x)).ok()?;
        Some((kept, next))
    }

    /// The numbers of the points, from the largest response on.
    fn by_falling_response(&self) -> Vec<usize> {
        let mut order: Vec<usize> = (0..self.points.len()).collect();
        let response = |n: usize| self.points[n].response.value;
        order.sort_by(|first, second| response(*second).total_cmp(&response(*first)));
        order
    }

    /// The smallest of the minima that are reached from several restitution coefficients.
    fn fit(&self, expected: &Parameters) -> Result<Fit, FitError> {
        self.fit_from(
            FIRST_RESTITUTIONS
                .into_iter()
                .filter_map(|restitution| self.start(&Parameters { restitution, ..*expected })),
        )
    }

    /// The smallest of the minima that are reached from these starts.
    fn fit_from(&self, starts: impl Iterator<Item = Unknowns>) -> Result<Fit, FitError> {
        let minima = starts.filter_map(|x| LeastSquares::minimum(self, x, &Vec::new(), CURVE_GAIN));
        let minimum = minima
            .min_by(|first, second| first.chi_square.total_cmp(&second.chi_square))
            .ok_or(FitError::NoMotion)?;
        let fit = self.found(&minimum, &minimum.trace);
        let is_determined = |estimate: Estimate| estimate.uncertainty.is_finite() && estimate.uncertainty > 0.0;
        let mut estimates = Quantity::ALL.iter().filter_map(|quantity| fit.estimate(*quantity));
        estimates
            .all(is_determined)
            .then_some(fit)
            .ok_or(FitError::Undetermined)
    }

    /// The start of a search at a restitution coefficient: by first-order theory, drive and frequency are linear in zeta, epsilon and f0 if the
    /// half-width is known. Half-widths are tried from that at which the motion of the largest response loses its symmetry to that at which
    /// the smallest response is at the fold.
    fn start(&self, expected: &Parameters) -> Option<Unknowns> {
        let r = expected.restitution;
        let undamped = SlowFlow::new(0.0, r);
        let manifold = undamped.manifold;
        let (low, high) = range(
            (f64::INFINITY, 0.0),
            self.points.iter().map(|point| point.response.value),
        );
        let [from, to] = [
            high / manifold.c(B_SYMMETRY_BREAKING),
            low / manifold.c(manifold.b_min()),
        ];
        let omega = mean(self.points.iter().map(|point| point.omega.value));
        let fits = equally_spaced(from.ln(), to.ln(), WIDTHS).filter_map(|width| {
            let b = width.exp();
            let mut rows = Vec::new();
            for point in &self.points {
                let MeasuredPoint { response, omega: at, drive, .. } = point.at_resonance(self.definition);
                let c = (response.value / b).max(manifold.c(manifold.b_min()));
                let motion = undamped.backbone_at(manifold.b(c, BranchSide::Right)?);
                let [u_omega, u_drive] = [expected.mass_ratio() * omega, drive.value].map(|one| THEORY * one);
                let of_omega =
                    [1.0, 0.0, omega * motion.sigma, at.value].map(|one| one / at.uncertainty.hypot(u_omega));
                let of_drive = [0.0, 2.0 * response.value, b * motion.g, drive.value]
                    .map(|one| one / drive.uncertainty.hypot(u_drive));
                rows.extend([of_omega, of_drive]);
            }
            let [first, second, third, values] =
                [0, 1, 2, 3].map(|n| rows.iter().map(|row| row[n]).collect::<Vec<f64>>());
            let columns = [first, second, third];
            let fit = Regression::fit(&columns, &values, None, 1.0)?;
            let [omega0, zeta, epsilon] = [0, 1, 2].map(|n| fit.coefficient(n));
            let at = [omega0, zeta, r, b, epsilon];
            let is_physical = omega0 > 0.0 && zeta > 0.0 && epsilon > 0.0;
            is_physical.then_some((fit.excess, at))
        });
        let (_, [omega0, zeta, r, b, epsilon]) = fits.min_by(|first, second| first.0.total_cmp(&second.0))?;
        let mass = expected.primary_mass.ln();
        Some(Unknowns::from([omega0.ln(), zeta, r, b.ln(), epsilon.ln(), mass, 0.0]))
    }

    /// The fit of a minimum.
    fn found<T: Clone>(&self, minimum: &LeastSquares<UNKNOWNS, T>, places: &[Nearest]) -> Fit {
        let covariance = minimum.covariance();
        Fit {
            x: minimum.x,
            covariance,
            channels: channels(minimum, places, &covariance),
            has_scale: self.has_scale,
            chi_square: minimum.chi_square,
            degrees: self
                .equations()
                .saturating_sub(5 + usize::from(self.has_scale) + usize::from(self.free)),
            residuals: minimum.residuals.as_chunks().0[..self.points.len()].to_vec(),
            left_out: Vec::new(),
            speeds: places.iter().map(|place| place.speed).collect(),
        }
    }

    /// What is known from elsewhere. Unknowns on which nothing depends, the mass without a scale and the strength without an effect, keep their
    /// values, with a standard uncertainty of 1.
    fn known_residuals(&self, x: &Unknowns) -> Vec<f64> {
        let known = self.known.iter().flat_map(|known| known.residuals(x));
        known.chain([0.0; 2]).collect()
    }

    fn known_rows(&self, x: &Unknowns) -> Vec<Unknowns> {
        let held = |i: usize, is_free: bool| Unknowns::ith(i, f64::from(u8::from(!is_free)));
        let held = [held(5, self.has_scale), held(6, self.free)];
        self.known.iter().flat_map(|known| known.rows(x)).chain(held).collect()
    }

    /// The residual where the curve is nearest to a point.
    fn nearest(&self, x: &Unknowns, point: usize, start: Option<f64>) -> Option<(Vector3<f64>, Nearest)> {
        let (b, epsilon) = (x[3].exp(), x[4].exp());
        let manifold = SlowFlow::new(2.0 * x[1] / epsilon, x[2]).manifold;
        let by_theory = || {
            let c = self.points[point].response.value / b;
            manifold.b(c, BranchSide::Right).unwrap_or(1.02 * manifold.b_min())
        };
        let start = SVector::from([start.unwrap_or_else(by_theory)]);
        let found = LeastSquares::minimum(&Distance { problem: self, x, point }, start, &(), NEAREST)?;
        let along = Vector3::from_fn(|i, _| found.derivatives[i][0]);
        Some((
            Vector3::from_column_slice(&found.residuals),
            Nearest { speed: found.x[0], along },
        ))
    }

    /// The curve of the ideal cavity, with a cubic stiffness ([`Effect::Hardening`]), at a speed less a point, over its standard uncertainties.
    fn residual(&self, x: &Unknowns, point: usize, speed: f64) -> Option<Vector3<f64>> {
        let (omega0, b, epsilon) = (x[0].exp(), x[3].exp(), x[4].exp());
        let definition = self.definition.at_phase(self.points[point].phase);
        let [omega, c, g] = backbone_at_speed(&model(x, definition), speed)?;
        let hardening = 1.0 + 0.375 * x[6] * c * c;
        Some(self.over_u(point, b * c, omega0 * omega * hardening, b * epsilon * g))
    }

    /// A response, m, a frequency, rad/s, and a drive, m, less those of a point, over its standard uncertainties.
    fn over_u(&self, point: usize, response: f64, omega: f64, drive: f64) -> Vector3<f64> {
        let point = &self.points[point];
        let over = |value: f64, measured: Estimate| (value - measured.value) / measured.uncertainty;
        Vector3::new(
            over(response, point.response),
            over(omega, point.omega),
            over(drive, point.drive),
        )
    }
}

/// A fit in numbers, for programs.
#[derive(Debug, Clone, Serialize)]
pub struct FitReport {
    /// Whether the points do not contradict the model.
    pub describes: bool,
    /// Symbols of the first five that the points do not determine.
    pub undetermined: Vec<&'static str>,
    /// Chi-square.
    pub chi_square: f64,
    /// Its degrees of freedom.
    pub degrees: usize,
    /// Probability of a larger chi-square; absent without a degree of freedom.
    pub p_value: Option<f64>,
    /// The parameters: first f0, zeta, r, b and epsilon, then, with a known scale, M, m, k and c.
    pub parameters: Vec<FittedParameter>,
    /// Chi-square of response, frequency and drive.
    pub channels: [ChannelTest; 3],
    /// Correlations of the first five.
    pub correlations: Vec<[f64; 5]>,
    /// Residuals over their standard uncertainties: response, frequency, drive.
    pub residuals: Vec<[f64; 3]>,
    /// Numbers, from 1, of the points that contradict the others.
    pub left_out: Vec<usize>,
}

/// A parameter of a fit.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct FittedParameter {
    /// Its symbol.
    pub symbol: &'static str,
    /// Its unit; empty for a pure number.
    pub unit: &'static str,
    /// Its value.
    pub value: f64,
    /// Its standard uncertainty.
    pub uncertainty: f64,
    /// The value that was expected.
    pub expected: f64,
}

impl Fit {
    /// The numbers of the fit, beside those of the rig that was expected.
    #[must_use]
    pub fn report(&self, expected: &Parameters) -> FitReport {
        let parameter = |quantity: Quantity| {
            let (Estimate { value, uncertainty }, [symbol, unit]) = (self.estimate(quantity)?, quantity.symbol());
            let expected = quantity.of_plant(expected);
            Some(FittedParameter { symbol, unit, value, uncertainty, expected })
        };
        let correlations = |row: &Quantity| std::array::from_fn(|n| self.correlation(*row, Quantity::FITTED[n]));
        FitReport {
            describes: !self.is_rejected(),
            undetermined: self.undetermined().into_iter().map(|one| one.symbol()[0]).collect(),
            chi_square: self.chi_square,
            degrees: self.degrees,
            p_value: self.p_value(),
            channels: self.channels,
            parameters: Quantity::ALL.into_iter().filter_map(parameter).collect(),
            correlations: Quantity::FITTED.iter().map(correlations).collect(),
            residuals: self.residuals.clone(),
            left_out: self.left_out.iter().map(|n| n + 1).collect(),
        }
    }
}
