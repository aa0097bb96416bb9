//! Every hypothesis fitted to the same data, side by side.
//!
//! A hypothesis is a curve of phase resonance ([`crate::branch`]) with named parameters. A measured point counts by its distance from the curve, over
//! its standard uncertainties; a record by the rows of what it says of the curve ([`Curve::residuals`]); what is known from elsewhere by a row of its
//! own. The parameters minimise the sum of squares, chi-square (Levenberg and Marquardt), and its second derivative is the inverse of their covariance.
//!
//! A hypothesis is excluded where a channel rejects it, or, of points, where its chi-square exceeds the smallest one by more than chance allows; of a
//! record each has a reading of its own. What remains is possible, and the range of a parameter is that over what remains.

use std::f64::consts::{FRAC_PI_2, TAU};
use std::sync::Arc;

use lovines::Parameters;
use nalgebra::{DMatrix, DVector, Vector3};
use num_complex::Complex64;
use serde::Serialize;
use statrs::distribution::{ChiSquared, ContinuousCDF};
use thiserror::Error;
use vines_estimate::{Backbone, Basis, CubicSpline, Curve, Element, Linear};
use vines_model::Definition;
use vines_model::numerics::{
    Estimate, LeastSquares, Misfit, SIGNIFICANT, equally_spaced, mean, range, singular_values,
};
use vines_model::theory::{B_SYMMETRY_BREAKING, BranchSide, SlowFlow};

use crate::branch::Branch;
use crate::hypothesis::{Hypothesis, TYPICAL, impact_speed, plant};
use crate::ideal_rig::IdealRig;
use crate::motions::{AMPLITUDES, Goal, Motions, Place, backbone, uncertainties};
use crate::particle::Particle;
use crate::points::MeasuredPoint;
use crate::quantity::{Known, Quantity, STEP, UNKNOWNS, Unknowns, gradient, moved, unknowns};
use crate::record::{PASSES, STILL, Samples};

/// What a record says.
#[derive(Debug, Clone)]
pub struct MeasuredCurve {
    /// Where it comes from, for messages.
    pub origin: String,
    /// Drive and frequency of phase resonance.
    pub curve: Curve,
    /// Times, s, and amplitudes of the response, m, of the periods that were used.
    pub periods: Vec<[f64; 2]>,
    /// What it was read from.
    pub samples: Arc<Samples>,
    /// The periods that were used.
    pub used: Vec<bool>,
    /// The particle with which it was read.
    pub read: Particle,
    /// Relative error of the curve beside noise.
    pub resolution: f64,
}

/// What was measured on a rig.
#[derive(Debug, Clone, Default)]
pub struct Data {
    /// Points of its backbone.
    pub points: Vec<MeasuredPoint>,
    /// Records.
    pub curves: Vec<MeasuredCurve>,
    /// What is known from elsewhere.
    pub known: Vec<Known>,
    /// What counts as resonance.
    pub definition: Definition,
    /// Standard uncertainty of the gain of the reference.
    pub calibration: f64,
    /// The rig that a record was made on, about: without it a short noisy decay determines nothing.
    pub scene: Option<IdealRig>,
}

/// Fewest points: two equations each for five parameters, and one to spare.
pub const FEWEST_POINTS: usize = 3;
/// Amplitudes of a record at which its curve is shown.
pub const SHOWN: usize = 12;
/// Probability below which a channel rejects a hypothesis, and at which chi-square exceeds the smallest one by chance.
pub const EXCLUDED: f64 = 1e-3;
/// Restitution coefficients from which the minimisation begins: chi-square may have several minima.
const FIRST_RESTITUTIONS: [f64; 4] = [0.3, 0.5, 0.7, 0.9];
/// Number of half-widths that are tried at the start of a search.
const WIDTHS: usize = 8;
/// Relative error of first-order theory: of the drive, and of the detuning.
const THEORY: f64 = 0.04;
/// Gain of a further step, relative to one and chi-square, at which a minimum counts as found: of a curve in closed form, and of one of motions.
const LEAST_GAIN: [f64; 2] = [1e-9, 1e-4];
/// Amplitudes that count as equal to one of a record, relative.
const ASIDE: f64 = 0.03;

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
}

/// Chi-square of one channel.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ChannelTest {
    /// Responses, frequencies or drives of points, or the origin of a record.
    #[serde(rename = "channel")]
    pub name: String,
    /// Sum of the squares of the residuals over their standard uncertainties.
    pub chi_square: f64,
    /// Its mean if the hypothesis and the uncertainties are right.
    pub expected: f64,
    /// Probability of a larger one; absent if the data say nothing about this channel.
    pub p_value: Option<f64>,
}

impl ChannelTest {
    /// The test of a channel, from the part of the residuals' covariance that belongs to it (Satterthwaite's approximation: a multiple of a
    /// chi-square with the same mean and variance).
    fn new(name: String, chi_square: f64, covariance: &DMatrix<f64>) -> Self {
        let (expected, squares) = (covariance.trace(), covariance.norm_squared());
        let p_value = probability(chi_square * expected / squares, expected * expected / squares);
        Self { name, chi_square, expected, p_value }
    }
}

/// Probability that a chi-square with this number of degrees of freedom is larger; `None` without a degree of freedom.
#[must_use]
pub fn probability(chi_square: f64, degrees: f64) -> Option<f64> {
    let p = ChiSquared::new(degrees).ok()?.sf(chi_square.max(0.0));
    p.is_finite().then_some(p)
}

/// The parameters of a hypothesis that fit the data best.
#[derive(Debug, Clone)]
pub struct Fit {
    /// Which.
    pub hypothesis: Hypothesis,
    pub(crate) x: Unknowns,
    covariance: nalgebra::SMatrix<f64, UNKNOWNS, UNKNOWNS>,
    has_scale: bool,
    has_friction: bool,
    /// Speed of the impacts, m/s, at which a law of restitution has the value r.
    speed: f64,
    /// Chi-square.
    pub chi_square: f64,
    /// Its degrees of freedom.
    pub degrees: usize,
    /// Residuals of the points over their standard uncertainties: response, frequency, drive.
    pub residuals: Vec<[f64; 3]>,
    /// Chi-square of response, frequency and drive of points, and of the records.
    pub channels: Vec<ChannelTest>,
    /// Why it is excluded.
    pub excluded: Option<String>,
}

impl Fit {
    /// A quantity; `None` for a mass, a stiffness or a damping if none of them is known, and for what the hypothesis has not.
    #[must_use]
    pub fn estimate(&self, quantity: Quantity) -> Option<Estimate> {
        let gradient = quantity.gradient(&self.x);
        let variance = (gradient.transpose() * self.covariance * gradient)[0];
        let is_its = self.hypothesis.is_cavity() || matches!(quantity, Quantity::F0 | Quantity::Zeta);
        (is_its && (self.has_scale || !quantity.needs_a_scale()))
            .then(|| Estimate { value: quantity.of(&self.x), uncertainty: variance.sqrt() })
    }

    /// Correlation of two quantities.
    #[must_use]
    pub fn correlation(&self, first: Quantity, second: Quantity) -> f64 {
        let [a, b] = [first, second].map(|quantity| quantity.gradient(&self.x));
        let covariance = |a: &Unknowns, b: &Unknowns| (a.transpose() * self.covariance * b)[0];
        covariance(&a, &b) / (covariance(&a, &a) * covariance(&b, &b)).sqrt()
    }

    /// The strength of what the hypothesis adds, in the unit of [`Hypothesis::names`].
    #[must_use]
    pub fn strength(&self) -> Option<Estimate> {
        let value = |x: &Unknowns| self.hypothesis.strength([x[6], x[7]], x[2], self.speed);
        let gradient = gradient(&self.x, value);
        let variance = (gradient.transpose() * self.covariance * gradient)[0];
        let uncertainty = match self.hypothesis {
            // The square of a tilt may be 0.
            Hypothesis::Tilt => {
                let mut above = self.x;
                above[7] += self.covariance[(7, 7)].max(0.0).sqrt();
                value(&above) - value(&self.x)
            }
            _ => variance.max(0.0).sqrt(),
        };
        (self.hypothesis != Hypothesis::Ideal).then(|| Estimate { value: value(&self.x), uncertainty })
    }

    /// The friction, where it acts beside another effect.
    #[must_use]
    pub fn friction(&self) -> Option<Estimate> {
        let acts = self.hypothesis != Hypothesis::Friction && self.has_friction;
        acts.then(|| Estimate {
            value: self.x[6],
            uncertainty: self.covariance[(6, 6)].max(0.0).sqrt(),
        })
    }

    /// The probability of a larger chi-square if the hypothesis is right; `None` without a degree of freedom.
    #[must_use]
    pub fn p_value(&self) -> Option<f64> {
        probability(self.chi_square, self.degrees as f64)
    }

    /// The plant of the fit; without a known mass, stiffness or damping, its primary mass is that of `scene`.
    #[must_use]
    pub fn plant(&self, scene: &Parameters) -> Parameters {
        let mut x = self.x;
        if !self.has_scale {
            x[5] = scene.primary_mass.ln();
        }
        plant(&x, self.hypothesis.cavity([x[6], x[7]], x[2], self.speed))
    }

    /// Why its own data reject it.
    fn rejection(&self) -> Option<String> {
        let channels = self
            .channels
            .iter()
            .filter_map(|one| Some((one.name.as_str(), one.p_value?)));
        let every = channels.chain(self.p_value().map(|p| ("all data", p)));
        let (name, p) = every.min_by(|one, other| one.1.total_cmp(&other.1))?;
        (p < EXCLUDED).then(|| format!("p = {p:.1e} of {name}"))
    }
}

/// All hypotheses that have a curve at the data, the ideal cavity first.
#[derive(Debug, Clone)]
pub struct Hypotheses {
    /// Their fits.
    pub fits: Vec<Fit>,
    /// Those without a fit: the plant has no motions with the responses of the data near what is expected of the rig.
    pub not_fitted: Vec<Hypothesis>,
    /// Whether what is expected of the rig counts.
    has_scene: bool,
}

impl Hypotheses {
    /// The hypotheses that are not excluded.
    pub fn possible(&self) -> impl Iterator<Item = &Fit> {
        self.fits.iter().filter(|fit| fit.excluded.is_none())
    }

    /// Whether the data show impacts in 1:1 motion: a cavity is not excluded, and a nonlinear spring without a particle is.
    #[must_use]
    pub fn describes(&self) -> bool {
        self.possible().next().is_some() && self.possible().all(|fit| fit.hypothesis.is_cavity())
    }

    /// The ideal cavity, or, where it is excluded, the possible one with the smallest chi-square, or of all.
    #[must_use]
    pub fn best(&self) -> &Fit {
        let cavities = || self.possible().filter(|fit| fit.hypothesis.is_cavity());
        let least = |one: &&Fit, other: &&Fit| one.chi_square.total_cmp(&other.chi_square);
        let ideal = cavities().find(|fit| fit.hypothesis == Hypothesis::Ideal);
        ideal
            .or_else(|| cavities().min_by(least))
            .or_else(|| self.fits.iter().min_by(least))
            .unwrap_or(&self.fits[0])
    }

    /// The range of a quantity over the possible cavities, as its middle and half its width; of the best one, if none is possible.
    #[must_use]
    pub fn range(&self, quantity: Quantity) -> Option<Estimate> {
        let of = |fit: &Fit| {
            fit.estimate(quantity)
                .map(|one| [one.value - one.uncertainty, one.value + one.uncertainty])
        };
        let possible = self.possible().filter(|fit| fit.hypothesis.is_cavity()).filter_map(of);
        let [low, high] = possible
            .reduce(|[low, high], one| [low.min(one[0]), high.max(one[1])])
            .or_else(|| of(self.best()))?;
        Some(Estimate { value: 0.5 * (low + high), uncertainty: 0.5 * (high - low) })
    }

    /// The fitted quantities that the data do not determine: the interval of three standard uncertainties contains 0, or its standard uncertainty is
    /// most of that of the scene.
    #[must_use]
    pub fn undetermined(&self) -> Vec<Quantity> {
        let is_determined = |(quantity, of_scene): &(Quantity, f64)| {
            self.range(*quantity).is_some_and(|one| {
                let scale = if *quantity == Quantity::R { 1.0 } else { one.value };
                let is_of_scene = self.has_scene && one.uncertainty > 0.5 * of_scene * scale;
                one.value.abs() > SIGNIFICANT * one.uncertainty && !is_of_scene
            })
        };
        let fitted = Quantity::FITTED.iter().copied().zip(IdealRig::UNCERTAINTY);
        fitted.filter(|one| !is_determined(one)).map(|one| one.0).collect()
    }
}

impl Data {
    /// The points, and those of the curves of records at some amplitudes.
    #[must_use]
    pub fn shown(&self) -> Vec<MeasuredPoint> {
        let of_curve = |one: &MeasuredCurve| {
            let [low, high] = one.curve.basis.ends;
            let amplitudes: Vec<f64> = equally_spaced(low.exp(), high.exp(), SHOWN).collect();
            let at = one.curve.at(&amplitudes);
            let u = |n: usize| at.covariance[(n, n)].sqrt();
            let point = |n: usize| MeasuredPoint {
                response: Estimate { value: amplitudes[n], uncertainty: 0.0 },
                omega: Estimate { value: at.omega[n], uncertainty: u(SHOWN + n) },
                drive: Estimate { value: at.drive[n], uncertainty: u(n) },
                phase: -FRAC_PI_2,
            };
            (0..SHOWN).map(point).collect::<Vec<_>>()
        };
        self.points
            .iter()
            .copied()
            .chain(self.curves.iter().flat_map(of_curve))
            .collect()
    }

    /// The fit less what is [shown](Self::shown), over the standard uncertainties: response, frequency, drive.
    #[must_use]
    pub fn apart(&self, fit: &Fit) -> Vec<[f64; 3]> {
        let problem = self.problem(fit.hypothesis, fit.x);
        let spline = problem.start(&fit.x).and_then(|start| {
            let backbone = problem.at(&fit.x, &start)?.backbone;
            let values = backbone
                .iter()
                .map(|[_, drive, omega]| Complex64::new(*omega, *drive))
                .collect();
            (backbone.len() > 3).then(|| CubicSpline::new(backbone.iter().map(|one| one[0]).collect(), values))
        });
        let of_curves = spline.map(|spline| {
            let apart = |point: &MeasuredPoint| {
                let at = spline.at(point.response.value)[0];
                let over = |value: f64, measured: Estimate| (value - measured.value) / measured.uncertainty;
                [0.0, over(at.re, point.omega), over(at.im, point.drive)]
            };
            self.shown()[self.points.len()..].iter().map(apart).collect::<Vec<_>>()
        });
        fit.residuals
            .iter()
            .copied()
            .chain(of_curves.into_iter().flatten())
            .collect()
    }

    /// What contradicts a fit most: a point, or the times at which a record has an amplitude.
    #[must_use]
    pub fn worst(&self, fit: &Fit) -> String {
        let (shown, apart) = (self.shown(), self.apart(fit));
        let sizes = apart
            .iter()
            .enumerate()
            .flat_map(|(n, one)| one.iter().enumerate().map(move |(i, size)| (n, i, *size)));
        let Some((n, channel, size)) = sizes.max_by(|one, other| one.2.abs().total_cmp(&other.2.abs())) else {
            return "nothing has its amplitudes".into();
        };
        let (what, response) = (["response", "frequency", "drive"][channel], shown[n].response.value);
        let place = match n.checked_sub(self.points.len()) {
            None => format!("point {}", n + 1),
            Some(n) => {
                let MeasuredCurve { origin, periods, .. } = &self.curves[n / SHOWN];
                let near = periods
                    .iter()
                    .filter(|[_, amplitude]| (amplitude / response - 1.0).abs() < ASIDE);
                let times = near.map(|[time, _]| *time);
                let [from, to] = times.fold([f64::INFINITY, 0.0], |[from, to], time| [time.min(from), time.max(to)]);
                format!("{origin} between {from:.2} s and {to:.2} s")
            }
        };
        format!(
            "the {what} of {place}, at a response of {response:.4e} m, is {:+.1} u off",
            -size
        )
    }

    /// Refuses too few points, and numbers that are not positive.
    fn checked(&self) -> Result<(), FitError> {
        if self.points.len() < FEWEST_POINTS && self.curves.is_empty() {
            return Err(FitError::TooFew(self.points.len()));
        }
        for (n, point) in self.points.iter().enumerate() {
            let estimates = [point.response, point.omega.scaled(1.0 / TAU), point.drive];
            let names = ["response, m,", "frequency, Hz,", "drive"];
            for (what, Estimate { value, uncertainty }) in names.into_iter().zip(estimates) {
                let is_positive = |number: f64| number > 0.0 && number.is_finite();
                if !(is_positive(value) && is_positive(uncertainty)) {
                    return Err(FitError::NotPositive { number: n + 1, what, value, uncertainty });
                }
            }
        }
        Ok(())
    }

    /// Fits the ideal cavity. `expected`: where the search begins.
    ///
    /// # Errors
    /// Too few points, numbers that are not positive, and data that no symmetric 1:1 motion has, or that do not determine the parameters.
    pub fn ideal(&self, expected: &Parameters) -> Result<Fit, FitError> {
        self.checked()?;
        let starts = FIRST_RESTITUTIONS
            .into_iter()
            .filter_map(|restitution| self.start(&Parameters { restitution, ..*expected }));
        let problem = self.problem(Hypothesis::Ideal, unknowns(expected));
        let fit = problem
            .best(starts.chain([unknowns(expected)]))
            .ok_or(FitError::NoMotion)?;
        let is_determined = |one: Estimate| one.uncertainty.is_finite() && one.uncertainty > 0.0;
        let mut estimates = Quantity::ALL.iter().filter_map(|quantity| fit.estimate(*quantity));
        estimates
            .all(is_determined)
            .then_some(fit)
            .ok_or(FitError::Undetermined)
    }

    /// The ideal cavity with the parameters of `plant`: its chi-square and residuals say whether the data belong to the plant, and its uncertainties are
    /// the Cramér–Rao bound of the data. `None` where the plant has no such motion.
    #[must_use]
    pub fn at(&self, plant: &Parameters) -> Option<Fit> {
        let problem = self.problem(Hypothesis::Ideal, unknowns(plant));
        let x = unknowns(plant);
        let here = LeastSquares::at(&problem, x, &Vec::new())?;
        let fit = problem.found(&here)?;
        Some(Fit { degrees: problem.equations(), ..fit })
    }

    /// Fits every hypothesis. `progress` is told the number of those that are done.
    ///
    /// # Errors
    /// As [`Data::ideal`].
    pub fn hypotheses(&self, expected: &Parameters, mut progress: impl FnMut(usize)) -> Result<Hypotheses, FitError> {
        let ideal = self.ideal(expected)?;
        let x = ideal.x;
        let (mut fits, mut not_fitted) = (vec![ideal], Vec::new());
        for (n, hypothesis) in Hypothesis::ALL.into_iter().enumerate().skip(1) {
            progress(n);
            if self.is_excluded(hypothesis) {
                continue;
            }
            let start = if hypothesis.is_cavity() {
                x
            } else {
                self.linear(expected)
            };
            let with = |mut x: Unknowns, share: f64| {
                (x[6], x[7]) = (Hypothesis::Friction.start(&x, share), hypothesis.start(&x, share));
                x
            };
            let friction = fits.iter().find(|fit| fit.hypothesis == Hypothesis::Friction);
            let with_friction = friction.map_or(with(start, TYPICAL), |fit| {
                let mut x = fit.x;
                x[7] = hypothesis.start(&x, TYPICAL);
                x
            });
            let problem = self.problem(hypothesis, start);
            // Where an ideal cavity is far from the data, the rig that is expected may be nearer.
            let starts = match problem.has_motions() {
                false => vec![start],
                true => vec![with_friction, with(start, 0.0), with(unknowns(expected), TYPICAL)],
            };
            match problem.best(starts.into_iter()).and_then(|fit| self.read_again(fit)) {
                Some(fit) => fits.push(fit),
                None => not_fitted.push(hypothesis),
            }
        }
        // Chi-squares of the same data: each hypothesis reads a record for itself. What its own data reject is no measure of the others.
        let comparable = fits
            .iter()
            .filter(|fit| self.curves.is_empty() && fit.rejection().is_none());
        let best = comparable.min_by(|one, other| one.chi_square.total_cmp(&other.chi_square));
        let best = best.map(|fit| (fit.chi_square, fit.degrees));
        for fit in &mut fits {
            let exceeds = best.and_then(|(least, degrees)| {
                let (excess, difference) = (fit.chi_square - least, fit.degrees.abs_diff(degrees).max(1) as f64);
                let is_excess = probability(excess, difference).is_some_and(|p| p < EXCLUDED);
                is_excess.then(|| format!("chi-square exceeds the smallest by {excess:.0}"))
            });
            fit.excluded = fit.rejection().or(exceeds);
        }
        Ok(Hypotheses { fits, not_fitted, has_scene: self.scene.is_some() })
    }

    /// The fit to the records as the hypothesis itself reads them: with its particle and its linear response. `None` if these have no curve then.
    fn read_again(&self, first: Fit) -> Option<Fit> {
        if self.curves.is_empty() || !first.hypothesis.is_cavity() {
            return Some(first);
        }
        let again = |fit: &Fit| {
            let problem = Problem { speed: fit.speed, ..self.problem(fit.hypothesis, fit.x) };
            let at = problem.at(&fit.x, &problem.start(&fit.x)?)?;
            let linear = Linear { omega0: fit.x[0].exp(), zeta: fit.x[1] };
            let itself = problem.itself(&fit.x, &at);
            let powers = DMatrix::from_fn(itself.len(), 4, |n, power| itself[n][0].ln().powi(power as i32));
            let ratios = DVector::from_fn(itself.len(), |n, _| itself[n][2] / linear.omega0);
            let frequency = singular_values(powers)?.solve(&ratios, f64::EPSILON).ok()?;
            let frequency = std::array::from_fn(|power| frequency[power]);
            let read = Particle { frequency, ..problem.particle(&fit.x) };
            let curves = self.curves.iter().map(|one| {
                let curve = one
                    .samples
                    .read(&one.used, read, &itself, linear)?
                    .resolved(one.resolution)?;
                Some(MeasuredCurve { curve, read, ..one.clone() })
            });
            let data = Self { curves: curves.collect::<Option<_>>()?, ..self.clone() };
            let problem = Problem { speed: fit.speed, ..data.problem(fit.hypothesis, fit.x) };
            problem.best(std::iter::once(fit.x))
        };
        let mut fit = first;
        for _ in 0..PASSES {
            let next = again(&fit)?;
            let change = |i: usize| (next.x[i] - fit.x[i]).abs() / next.covariance[(i, i)].max(0.0).sqrt();
            let is_still = (0..UNKNOWNS)
                .filter(|i| next.x[*i] != fit.x[*i])
                .all(|i| change(i) < STILL);
            fit = next;
            if is_still {
                break;
            }
        }
        Some(fit)
    }

    /// Whether it is known that something does not act.
    fn is_excluded(&self, hypothesis: Hypothesis) -> bool {
        let zero = Known::Strength {
            hypothesis,
            estimate: Estimate { value: 0.0, uncertainty: 0.0 },
        };
        self.known.contains(&zero)
    }

    /// Rises of the chi-square of an ideal cavity that fits the data, by a linear response in some states of the particle.
    #[must_use]
    pub fn rises(&self, ideal: &Fit, states: [Option<Known>; 2]) -> [Option<f64>; 2] {
        let rise = |known: Known| {
            let with = Self { known: [&self.known[..], &[known]].concat(), ..self.clone() };
            let fit = with.problem(Hypothesis::Ideal, ideal.x).best(std::iter::once(ideal.x));
            fit.map_or(f64::INFINITY, |fit| fit.chi_square - ideal.chi_square)
        };
        states.map(|known| known.map(rise))
    }

    /// The structure without a particle that has the points on average.
    fn linear(&self, expected: &Parameters) -> Unknowns {
        let shown = self.shown();
        let mut x = unknowns(expected);
        x[0] = mean(shown.iter().map(|one| one.omega.value)).ln();
        x[1] = 0.5 * mean(shown.iter().map(|one| one.drive.value / one.response.value));
        x
    }

    /// The start of a search at a restitution coefficient: by first-order theory, drive and frequency are linear in zeta, epsilon and f0 if the
    /// half-width is known. Half-widths are tried from that at which the motion of the largest response loses its symmetry to that at which
    /// the smallest response is at the fold.
    fn start(&self, expected: &Parameters) -> Option<Unknowns> {
        let r = expected.restitution;
        let undamped = SlowFlow::new(0.0, r);
        let manifold = undamped.manifold;
        let points = self.shown();
        let (low, high) = range((f64::INFINITY, 0.0), points.iter().map(|point| point.response.value));
        let [from, to] = [
            high / manifold.c(B_SYMMETRY_BREAKING),
            low / manifold.c(manifold.b_min()),
        ];
        let omega = mean(points.iter().map(|point| point.omega.value));
        let fits = equally_spaced(from.ln(), to.ln(), WIDTHS).filter_map(|width| {
            let b = width.exp();
            let mut rows = Vec::new();
            for point in &points {
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
            let columns = DMatrix::from_fn(rows.len(), 3, |row, column| rows[row][column]);
            let values = DVector::from_iterator(rows.len(), rows.iter().map(|row| row[3]));
            let inverse = (columns.transpose() * &columns).cholesky()?;
            let solution = inverse.solve(&columns.tr_mul(&values));
            let [omega0, zeta, epsilon] = [0, 1, 2].map(|n| solution[n]);
            let at = [omega0, zeta, r, b, epsilon];
            let is_physical = omega0 > 0.0 && zeta > 0.0 && epsilon > 0.0;
            is_physical.then_some(((values - columns * solution).norm(), at))
        });
        let (_, [omega0, zeta, r, b, epsilon]) = fits.min_by(|first, second| first.0.total_cmp(&second.0))?;
        let mass = expected.primary_mass.ln();
        Some(Unknowns::from([
            omega0.ln(),
            zeta,
            r,
            b.ln(),
            epsilon.ln(),
            mass,
            0.0,
            0.0,
        ]))
    }

    fn problem(&self, hypothesis: Hypothesis, x: Unknowns) -> Problem<'_> {
        let of_curve = |one: &MeasuredCurve| one.curve.basis.ends.map(f64::exp);
        let of_points = self.points.iter().map(|point| [point.response.value; 2]);
        let ends = of_points.chain(self.curves.iter().map(of_curve));
        let range = ends.fold([f64::INFINITY, 0.0], |[low, high], one| {
            [low.min(one[0]), high.max(one[1])]
        });
        let mut phases: Vec<f64> = self.points.iter().map(|point| point.phase).collect();
        phases.push(-FRAC_PI_2);
        phases.sort_by(f64::total_cmp);
        phases.dedup();
        let mut goals: Vec<Goal> = self.points.iter().copied().map(Goal::Point).collect();
        if !self.curves.is_empty() {
            let basis = Basis { ends: range.map(f64::ln), size: AMPLITUDES };
            goals.extend(basis.spread(AMPLITUDES).map(|a| Goal::Amplitude(a.exp())));
        }
        Problem {
            data: self,
            hypothesis,
            speed: impact_speed(&x),
            held: x,
            has_scale: self.known.iter().any(Known::needs_a_scale),
            phases,
            goals,
            range,
        }
    }
}

/// What is minimised.
struct Problem<'a> {
    data: &'a Data,
    hypothesis: Hypothesis,
    speed: f64,
    /// The unknowns that are not free.
    held: Unknowns,
    has_scale: bool,
    /// Different phases of the points, and that of phase resonance.
    phases: Vec<f64>,
    /// What motions of the plant are looked for near to.
    goals: Vec<Goal>,
    /// Amplitudes of the data, m.
    range: [f64; 2],
}

/// A curve at the data.
#[derive(Clone)]
struct AtData {
    /// The curve less the points, over their standard uncertainties, and its direction there.
    apart: Vec<[Vector3<f64>; 2]>,
    /// The curve by rising amplitude.
    backbone: Backbone,
}

impl Problem<'_> {
    fn is_free(&self, i: usize) -> bool {
        match i {
            5 => self.has_scale,
            6 => self.hypothesis.is_free(6) && !self.data.is_excluded(Hypothesis::Friction),
            _ => self.hypothesis.is_free(i),
        }
    }

    /// Whether the curve has no closed form.
    fn has_motions(&self) -> bool {
        self.hypothesis.acts_on_particle() || self.is_free(6)
    }

    fn motions(&self, x: &Unknowns) -> Option<Motions<'_>> {
        let plant = plant(x, self.hypothesis.cavity([x[6], x[7]], x[2], self.speed));
        let (hypothesis, definition) = (self.hypothesis, self.data.definition);
        (0.0 < x[2] && x[2] <= 1.0).then(|| Motions { hypothesis, x: *x, plant, definition, goals: &self.goals })
    }

    /// Places from which the curve is followed; none where it has a closed form.
    fn start(&self, x: &Unknowns) -> Option<Vec<Place>> {
        match self.has_motions() {
            true => self.motions(x)?.along(),
            false => Some(Vec::new()),
        }
    }

    /// The curve at the data in closed form.
    fn closed(&self, x: &Unknowns) -> Option<AtData> {
        let of = |phase: &f64| {
            self.hypothesis
                .branch(x, self.data.definition.at_phase(*phase), self.range)
        };
        let branches: Option<Vec<Branch>> = self.phases.iter().map(of).collect();
        let branches = branches?;
        let at = |phase: f64| self.phases.iter().position(|one| *one == phase).map(|n| &branches[n]);
        let apart = |point: &MeasuredPoint| {
            let branch = at(point.phase)?;
            let measured = Vector3::from([point.response, point.omega, point.drive].map(|one| one.value));
            let u = uncertainties(point);
            let [here, along] = branch.at(branch.nearest(&measured, &u)?);
            Some([(here - measured).component_div(&u), along.component_div(&u)])
        };
        let apart: Option<Vec<_>> = self.data.points.iter().map(apart).collect();
        Some(AtData { apart: apart?, backbone: at(-FRAC_PI_2)?.rising() })
    }

    /// The curve at the data by motions.
    fn of_places(&self, places: &[Place]) -> AtData {
        let of = |(point, place): (&MeasuredPoint, &Place)| {
            [place.apart(point), place.along.component_div(&uncertainties(point))]
        };
        AtData {
            apart: self.data.points.iter().zip(places).map(of).collect(),
            backbone: backbone(&places[self.data.points.len()..]),
        }
    }

    /// The curve at the data.
    fn at(&self, x: &Unknowns, places: &[Place]) -> Option<AtData> {
        match self.has_motions() {
            true => Some(self.of_places(places)),
            false => self.closed(x),
        }
    }

    /// The backbone of the rig itself, whatever its reference reads.
    fn itself(&self, x: &Unknowns, at: &AtData) -> Backbone {
        let gain = self.hypothesis.gain(x);
        let itself = at
            .backbone
            .iter()
            .map(|[a, drive, omega]| [*a, drive / (1.0 + gain), *omega]);
        itself.collect()
    }

    /// Residuals of points, perpendicular to the curve, and of records.
    fn of_data(&self, x: &Unknowns, at: &AtData) -> Option<Vec<f64>> {
        let mut residuals: Vec<f64> = Vec::new();
        for [apart, along] in &at.apart {
            residuals.extend(across(along, apart).iter());
        }
        let (itself, gain) = (self.itself(x, at), self.hypothesis.gain(x));
        for MeasuredCurve { curve, read, .. } in &self.data.curves {
            residuals.extend(curve.residuals(&itself, self.lag(x, curve, read), gain)?.iter());
        }
        residuals.iter().all(|one| one.is_finite()).then_some(residuals)
    }

    /// Lag of the particle over that of the particle with which a record was read: the mean over its amplitudes.
    fn lag(&self, x: &Unknowns, curve: &Curve, read: &Particle) -> Complex64 {
        if !self.hypothesis.is_cavity() {
            return Complex64::ZERO;
        }
        let own = Particle { frequency: read.frequency, ..self.particle(x) };
        let ratios = curve
            .basis
            .spread(AMPLITUDES)
            .map(|a| own.lag(a.exp()) / read.lag(a.exp()));
        ratios.sum::<Complex64>() / AMPLITUDES as f64
    }

    fn particle(&self, x: &Unknowns) -> Particle {
        let sensor = self.data.definition.sensor;
        self.hypothesis.particle(x, self.is_free(6), self.speed, sensor)
    }

    /// Residuals of what is known, and of the unknowns that are held.
    fn of_known(&self, x: &Unknowns) -> Vec<f64> {
        let strength = |effect: Hypothesis| match effect == self.hypothesis || effect == Hypothesis::Friction {
            true => effect.strength(
                [6, 7].map(|i| if self.is_free(i) { x[i] } else { 0.0 }),
                x[2],
                self.speed,
            ),
            false => 0.0,
        };
        let known = self.data.known.iter().flat_map(|known| known.residuals(x, strength));
        let calibration = (self.hypothesis == Hypothesis::Reference).then(|| x[7] / self.data.calibration);
        let scene = self.data.scene.iter().flat_map(|scene| {
            let u = scene.uncertainties();
            let off = move |i: usize| (Quantity::FITTED[i].of(x) - scene.values()[i]) / u[i];
            (0..5).filter(|i| self.is_free(*i)).map(off).collect::<Vec<f64>>()
        });
        let held = (0..UNKNOWNS).filter(|i| !self.is_free(*i)).map(|i| x[i] - self.held[i]);
        known.chain(calibration).chain(scene).chain(held).collect()
    }

    /// Number of independent residuals.
    fn equations(&self) -> usize {
        let of_curves = self
            .data
            .curves
            .iter()
            .map(|one| one.curve.expected.len())
            .sum::<usize>();
        let held = (0..UNKNOWNS).filter(|i| !self.is_free(*i)).count();
        2 * self.data.points.len() + of_curves + self.of_known(&self.held).len() - held
    }

    /// The smallest of the minima that are reached from these starts.
    fn best(&self, starts: impl Iterator<Item = Unknowns>) -> Option<Fit> {
        let gain = LEAST_GAIN[usize::from(self.has_motions())];
        let minima = starts.filter_map(|x| LeastSquares::minimum(self, x, &self.start(&x)?, gain));
        let minimum = minima.min_by(|first, second| first.chi_square.total_cmp(&second.chi_square))?;
        self.found(&minimum)
    }

    /// The fit of a minimum.
    fn found(&self, minimum: &LeastSquares<UNKNOWNS, Vec<Place>>) -> Option<Fit> {
        let covariance = minimum.covariance();
        let free = (0..UNKNOWNS).filter(|i| self.is_free(*i)).count();
        let count = self.data.points.len();
        let at = self.at(&minimum.x, &minimum.trace)?;
        let alongs: Vec<Vector3<f64>> = at.apart.iter().map(|[_, along]| along.normalize()).collect();
        // The covariance of the residuals is what remains of the unit matrix beside the directions that the fit can follow.
        let test = |name: String, rows: &[usize], beside: &dyn Fn(usize) -> f64| {
            let covariance = DMatrix::from_fn(rows.len(), rows.len(), |n, m| {
                let [one, other] = [n, m].map(|n| minimum.derivatives[rows[n]]);
                let own = if n == m { beside(n) } else { 0.0 };
                own - (one.transpose() * covariance * other)[0]
            });
            let chi_square = rows.iter().map(|row| minimum.residuals[*row].powi(2)).sum();
            ChannelTest::new(name, chi_square, &covariance)
        };
        let mut channels = Vec::new();
        if count > 0 {
            for (channel, name) in ["responses", "frequencies", "drives"].into_iter().enumerate() {
                let rows: Vec<usize> = (0..count).map(|n| 3 * n + channel).collect();
                channels.push(test(name.into(), &rows, &|n| 1.0 - alongs[n][channel].powi(2)));
            }
        }
        let mut from = 3 * count;
        for MeasuredCurve { origin, curve, .. } in &self.data.curves {
            let rows: Vec<usize> = (from..from + curve.expected.len()).collect();
            channels.push(test(origin.clone(), &rows, &|_| 1.0));
            from += rows.len();
        }
        Some(Fit {
            hypothesis: self.hypothesis,
            x: minimum.x,
            covariance,
            has_scale: self.has_scale,
            has_friction: self.is_free(6),
            speed: self.speed,
            chi_square: minimum.chi_square,
            degrees: self.equations().saturating_sub(free),
            residuals: minimum.residuals.as_chunks().0[..count].to_vec(),
            channels,
            excluded: None,
        })
    }
}

/// What is perpendicular to a direction.
fn across(along: &Vector3<f64>, value: &Vector3<f64>) -> Vector3<f64> {
    let along = along.normalize();
    value - along * along.dot(value)
}

impl Misfit<UNKNOWNS> for Problem<'_> {
    type Trace = Vec<Place>;

    fn residuals(&self, x: &Unknowns, near: &Vec<Place>) -> Option<(Vec<f64>, Vec<Place>)> {
        let places = match self.has_motions() {
            true => self.motions(x)?.near(near)?,
            false => Vec::new(),
        };
        let mut residuals = self.of_data(x, &self.at(x, &places)?)?;
        residuals.extend(self.of_known(x));
        Some((residuals, places))
    }

    fn derivatives(&self, x: &Unknowns, places: &Vec<Place>) -> Option<Vec<Unknowns>> {
        let here = self.at(x, places)?;
        // Of motions only what is perpendicular to the curve of `x` counts.
        let of_data = |x: &Unknowns| {
            let mut at = match self.has_motions() {
                true => self.of_places(&self.motions(x)?.beside(places)?),
                false => self.closed(x)?,
            };
            for ([_, there], [_, along]) in at.apart.iter_mut().zip(&here.apart) {
                *there = *along;
            }
            self.of_data(x, &at)
        };
        let before = self.of_data(x, &here)?;
        let [low, high] = [0, 1].map(|end| self.limits().map(|limits| limits[end]));
        let mut rows = vec![Unknowns::zeros(); before.len()];
        for i in (0..UNKNOWNS).filter(|i| self.is_free(*i) && *i != 5) {
            // Where there is no motion on one side the difference is taken on the other one, or is smaller: near the loss of symmetry a motion bears
            // hardly any tilt.
            let steps = [1.0, -1.0, 0.1, -0.1, 0.01, -0.01].map(|share| share * STEP);
            let mut within = steps
                .iter()
                .filter(|step| (low[i]..=high[i]).contains(&(x[i] + **step)));
            let (there, step) = within.find_map(|step| Some((of_data(&moved(x, i, *step))?, step)))?;
            for ((row, there), here) in rows.iter_mut().zip(there).zip(&before) {
                row[i] = (there - here) / step;
            }
        }
        let count = self.of_known(x).len();
        rows.extend((0..count).map(|n| gradient(x, |x| self.of_known(x)[n])));
        Some(rows)
    }

    fn limits(&self) -> [[f64; 2]; UNKNOWNS] {
        let mut limits = [[f64::NEG_INFINITY, f64::INFINITY]; UNKNOWNS];
        limits[1] = [0.0, 1.0];
        limits[2] = [1e-3, 1.0];
        // Neither friction nor the square of a tilt is negative.
        limits[6][0] = 0.0;
        if self.hypothesis == Hypothesis::Tilt {
            limits[7][0] = 0.0;
        }
        limits
    }
}
