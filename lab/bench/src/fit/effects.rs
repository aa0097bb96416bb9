//! Effects of a real rig that explain why points contradict the ideal one: each is fitted alone, and they are compared.
//!
//! The points of a rig with an effect lie on a curve of the plant's own periodic motions ([`periodic_motion`]). For given parameters each point has a
//! motion near it; the distance from the tangent of the curve there, and its derivatives over parameters and strength, are differences between motions
//! on the line across the curve. Every step of the search moves each motion along its curve to the place nearest to the
//! point.
//!
//! Unequal gaps are no candidate: they shift the particle by the middle of the cavity and change nothing that the points contain. The fitted b is
//! half of the distance between the walls.

use std::cmp::Ordering;

use lovines::cavity::GRAVITY;
use lovines::{Cavity, Restitution};
use nalgebra::Vector3;
use serde::Serialize;
use vines_model::numerics::{Estimate, LeastSquares, Misfit, SIGNIFICANT, mean};
use vines_model::orbit::{Condition, PlantMotion, periodic_motion, resonant_motion};
use vines_model::{Definition, Dimensionless};

use super::{
    FEWEST_POINTS, Fit, FitError, Known, LEFT_OUT, LIMITS, LinearVerdict, MeasuredPoint, Nearest, Part, Problem,
    Quantity, REJECTED, RecordFit, Recording, RecordingError, UNKNOWNS, Unknowns, across, at, checked, fit, follow,
    gradient, linear_verdicts, parts, plant, shifted,
};
use vines_scene::linear::MeasuredLinear;
use vines_scene::scene::{Parameters, Scene};

/// An effect of a real cavity, or of its suspension.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Effect {
    /// Coulomb friction on the floor.
    Friction,
    /// Gravity along the axis.
    Tilt,
    /// A restitution that falls with the speed as that of viscoelastic spheres.
    Viscoelastic,
    /// A restitution that falls with the speed as that of plastic impacts.
    Plastic,
    /// A cubic stiffness of the suspension, `k (1 + h (q1/b)²)`. It moves the frequency of a response of the amplitude C b by `3/8 h C²` of itself
    /// (harmonic balance), the more negative the softer. The plant has none: its motions are those of the ideal cavity.
    Hardening,
}

/// A fit with one effect.
#[derive(Debug, Clone)]
pub struct Candidate {
    /// Which.
    pub effect: Effect,
    /// Its strength, in the unit of [`Effect::names`].
    pub strength: Estimate,
    /// The fit; its chi-square is that of the plant's own motions.
    pub fit: Fit,
    /// Impact speed, m/s, at which a restitution that depends on it has the value r of the fit.
    speed: f64,
}

/// Most steps of a fit, and of a motion along the curve to a point.
const MOST_FIT_STEPS: usize = 30;
/// Longest step along the curve, in units of its tangent.
const LONGEST_CURVE_STEP: f64 = 0.1;
/// Difference of the response over b at which a motion is at a point.
const POINT_DISTANCE: f64 = 1e-3;
/// What a further step would take from chi-square, relative to one and chi-square, at which the minimum counts as found.
const EFFECT_GAIN: f64 = 1e-4;
/// Smallest strength, over that from which the search begins.
const SMALLEST_STRENGTH: f64 = 1e-3;
/// Strengths from which a search begins, a typical, a weak and a strong one, the largest of a rig that is built with care, over that which gives the particle the acceleration `b omega0²`, or the
/// suspension the additional stiffness `m omega0²`: a typical friction and tilt are about 0.03 and 2 degrees on the default rig.
const STRENGTHS: [f64; 3] = [0.01, 0.001, 0.05];
/// Smallest step to the largest strength that points allow, as a factor.
const SMALLEST_FACTOR: f64 = 1.1;
/// Step of a difference: of the unknowns, of the strength relative, and along the curve.
const EFFECT_DIFFERENCE: f64 = 1e-4;
impl Effect {
    /// All of them.
    pub const ALL: [Self; 5] = [
        Self::Friction,
        Self::Tilt,
        Self::Viscoelastic,
        Self::Plastic,
        Self::Hardening,
    ];

    /// Its name, and symbol and unit of its strength.
    #[must_use]
    pub fn names(self) -> [&'static str; 3] {
        match self {
            Self::Friction => ["friction", "mu", ""],
            Self::Tilt => ["tilt", "theta", "deg"],
            Self::Viscoelastic => ["viscoelastic restitution", "k_r", "(s/m)^(1/5)"],
            Self::Plastic => ["plastic restitution", "v_y", "m/s"],
            Self::Hardening => ["cubic stiffness", "h", ""],
        }
    }

    /// Unknowns from which a search begins: those of an ideal cavity, with a strength as in [`STRENGTHS`].
    fn start(self, ideal: &Unknowns, strength: f64) -> Unknowns {
        let mut x = *ideal;
        let over_gravity = strength * x[3].exp() * x[0].exp().powi(2) / GRAVITY;
        x[6] = match self {
            Self::Friction => over_gravity,
            Self::Tilt => 4.0 * over_gravity * over_gravity,
            Self::Viscoelastic | Self::Plastic => 0.0,
            Self::Hardening => strength * x[4].exp(),
        };
        x
    }

    /// Whether it has a strength beside the five parameters: a law of restitution stands for r.
    fn adds_a_parameter(self) -> bool {
        !matches!(self, Self::Viscoelastic | Self::Plastic)
    }

    /// The cavity with this effect. `strength` is the friction, or the square of the tilt, rad² (the motions are even in it); a law of restitution
    /// has the value `r` at the impact speed `speed`, m/s.
    #[must_use]
    pub fn cavity(self, strength: f64, r: f64, speed: f64) -> Cavity {
        let both = |law| Cavity { restitution: [Some(law); 2], ..Cavity::IDEAL };
        match self {
            Self::Friction => Cavity { kinetic_friction: strength, ..Cavity::IDEAL },
            Self::Tilt => Cavity { tilt: strength.sqrt(), ..Cavity::IDEAL },
            Self::Viscoelastic => both(Restitution::Viscoelastic(self.strength(strength, r, speed))),
            Self::Plastic => both(Restitution::Plastic(self.strength(strength, r, speed))),
            Self::Hardening => Cavity::IDEAL,
        }
    }

    /// The strength in the unit of [`Effect::names`], of what [`Effect::cavity`] takes.
    #[must_use]
    pub fn strength(self, strength: f64, r: f64, speed: f64) -> f64 {
        match self {
            Self::Friction | Self::Hardening => strength,
            Self::Tilt => strength.sqrt().to_degrees(),
            Self::Viscoelastic => (1.0 - r) / speed.powf(0.2),
            Self::Plastic => speed * r.powi(4),
        }
    }
}

/// What the candidates say about points that contradict the ideal cavity.
#[derive(Debug, Clone)]
pub struct Explanation {
    /// The fit of the ideal cavity to all points.
    pub ideal: Fit,
    /// The candidates that have motions at the points, the best one by Akaike's criterion first.
    pub candidates: Vec<Candidate>,
}

impl Explanation {
    /// The best candidate, if it describes the points.
    #[must_use]
    pub fn explains(&self) -> Option<&Candidate> {
        self.possible().next()
    }

    /// The candidates that describe the points, the best one first. The evidence of a candidate is `exp(-criterion/2)`. That of each is at least 1 %
    /// of that of every other one that describes the same points; one that leaves out more points than another has 100 times its evidence on
    /// the others.
    pub fn possible(&self) -> impl Iterator<Item = &Candidate> {
        let describe = || self.candidates.iter().filter(|one| !one.fit.is_rejected());
        let excludes = |other: &Candidate, one: &Candidate| {
            let [left_out, of_one] = [&other.fit.left_out, &one.fit.left_out];
            let kept = (0..).filter(|n| !left_out.contains(n)).zip(&other.fit.residuals);
            let beside = kept
                .filter(|(n, _)| of_one.contains(n))
                .flat_map(|(_, residual)| residual);
            let excess = one.criterion() + beside.map(|one| one * one).sum::<f64>() - other.criterion();
            let limit = -2.0 * REJECTED.ln();
            match left_out.len().cmp(&of_one.len()) {
                Ordering::Less => excess > -limit,
                Ordering::Equal => excess > limit,
                Ordering::Greater => false,
            }
        };
        describe().filter(move |one| !describe().any(|other| excludes(other, one)))
    }
}

/// Decimals for two digits of a standard uncertainty.
#[must_use]
pub fn decimals(uncertainty: f64) -> usize {
    if uncertainty > 0.0 && uncertainty.is_finite() {
        (1.0 - uncertainty.log10().floor()).clamp(0.0, 15.0) as usize
    } else {
        6
    }
}

impl Candidate {
    /// Akaike's criterion.
    fn criterion(&self) -> f64 {
        self.fit.chi_square + 2.0 * f64::from(u8::from(self.effect.adds_a_parameter()))
    }

    /// The better one first: one that describes the points, that leaves out fewer of them, and then by Akaike's criterion.
    fn order(&self, other: &Self) -> Ordering {
        let first = |candidate: &Self| (candidate.fit.is_rejected(), candidate.fit.left_out.len());
        let by_criterion = self.criterion().total_cmp(&other.criterion());
        first(self).cmp(&first(other)).then(by_criterion)
    }

    /// Its numbers, for programs.
    #[must_use]
    pub fn report(&self) -> EffectReport {
        let ([effect, symbol, unit], Estimate { value: strength, uncertainty }) = (self.effect.names(), self.strength);
        EffectReport {
            effect,
            symbol,
            unit,
            strength,
            uncertainty,
            possible_b_m: Quantity::B.of(&self.fit.x),
            chi_square: self.fit.chi_square,
            degrees: self.fit.degrees,
            left_out: self.fit.left_out.len(),
            describes: !self.fit.is_rejected(),
        }
    }

    /// The plant of the fit, with the effect. Without a known mass, stiffness or damping, its primary mass is that of `scene`.
    #[must_use]
    pub fn plant(&self, scene: &Parameters) -> Parameters {
        let cavity = self.effect.cavity(self.fit.x[6], self.fit.x[2], self.speed);
        Parameters { cavity, ..self.fit.plant(scene) }
    }
}

/// The fit with an effect in numbers.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct EffectReport {
    /// Name of the effect.
    pub effect: &'static str,
    /// Symbol of its strength.
    pub symbol: &'static str,
    /// Its unit; empty for a pure number.
    pub unit: &'static str,
    /// The fitted strength.
    pub strength: f64,
    /// Its standard uncertainty; 0 if it was given.
    pub uncertainty: f64,
    /// The half-width that goes with it, m.
    pub possible_b_m: f64,
    /// Chi-square.
    pub chi_square: f64,
    /// Its degrees of freedom.
    pub degrees: usize,
    /// Number of points that do not belong to this motion.
    pub left_out: usize,
    /// Whether the effect describes the other points.
    pub describes: bool,
}

/// What was measured on a rig.
#[derive(Debug, Clone, Default)]
pub struct Measurements {
    /// Points of its backbone.
    pub points: Vec<MeasuredPoint>,
    /// Recordings.
    pub recordings: Vec<Recording>,
    /// Linear responses.
    pub linear: Vec<MeasuredLinear>,
    /// What is known from elsewhere.
    pub known: Vec<Known>,
}

/// The rig that fits what was measured.
#[derive(Debug, Clone)]
pub struct Found {
    /// The fit: of the ideal cavity, or with the effect that explains why the points contradict it.
    pub fit: Fit,
    /// Its plant.
    pub plant: Parameters,
    /// All points, those of recordings last.
    pub points: Vec<MeasuredPoint>,
    /// Parts of the recordings.
    pub parts: Vec<Part>,
    /// What the points say of the linear responses.
    pub linear: Vec<LinearVerdict>,
    /// The fit of the recordings themselves, if it is the result.
    pub record: Option<RecordFit>,
    /// Why their points are fitted instead.
    pub points_instead: Option<String>,
    /// Recordings that are far from the phase target half of the time in which the base moves.
    pub off_target: Vec<String>,
    /// What the effects say, if the ideal cavity does not describe all points.
    pub explanation: Option<Explanation>,
    /// If the ideal cavity describes the points: effects that describe them as well, with a half-width outside the interval of the fit.
    pub alternatives: Vec<Candidate>,
}

/// The fit of all measurements: [`fit()`] of the points with the linear responses, [`follow`] of the recordings, and, where the ideal cavity does not
/// describe all points, the effect that does. `progress` is told the number of effects tried.
///
/// # Errors
/// As [`fit()`] and [`parts()`].
pub fn find(measured: &Measurements, scene: &Scene, mut progress: impl FnMut(usize)) -> Result<Found, FitError> {
    let Measurements { points: measured_points, recordings, linear, known } = measured;
    let (definition, expected) = (scene.definition(), &scene.plant);
    let parts = parts(recordings, scene)?;
    let of_parts = parts.iter().flatten().filter_map(|part| part.point);
    let points: Vec<MeasuredPoint> = measured_points.iter().copied().chain(of_parts).collect();
    let prepared = recordings.iter().map(|one| one.prepared(&scene.knowledge()));
    let prepared: Vec<Recording> = prepared.collect::<Result<_, _>>()?;
    let off_target: Vec<String> = prepared
        .iter()
        .filter_map(|one| one.off_target(&scene.knowledge()))
        .collect();
    // Too few points say less than why there are no more.
    let why = |error: FitError| match off_target.first() {
        Some(message) => RecordingError::new(message.clone()).into(),
        None => error,
    };
    let linear = linear_verdicts(linear, &points, definition, expected, known).map_err(why)?;
    let of_linear = linear.iter().map(|one| Known::Linear(one.linear));
    let known: Vec<Known> = known.iter().copied().chain(of_linear).collect();
    let followed = match recordings[..] {
        [] => None,
        _ => follow(&prepared, &parts, measured_points, definition, expected, &known),
    };
    let instead = |found: &str| format!("{found}: their points are fitted instead, and show less");
    let points_instead = match &followed {
        Some(RecordFit { fit, .. }) if fit.is_rejected() => Some(instead(&format!(
            "the recordings, followed period by period, contradict the model (chi-square {:.1} for {} degrees of freedom)",
            fit.chi_square, fit.degrees
        ))),
        None if !recordings.is_empty() => Some(instead("the plant does not follow the recordings")),
        _ => None,
    };
    let record = followed.filter(|_| points_instead.is_none());
    let fit = match &record {
        Some(record) => record.fit.clone(),
        // Nothing that was measured shows impacts.
        None if points.is_empty() && !recordings.is_empty() => {
            return Err(prepared[0].without_points(&parts[0], &scene.knowledge()).into());
        }
        None => fit(&points, definition, expected, &known).map_err(why)?,
    };
    let mut found = Found {
        plant: fit.plant(expected),
        fit,
        parts: parts.concat(),
        points,
        linear,
        record,
        points_instead,
        off_target,
        explanation: None,
        alternatives: Vec::new(),
    };
    let points = &found.points;
    if found.record.is_some()
        && let Some(beside) = at(points, definition, &found.plant, &[])
    {
        // The points are shown beside the fit of the record.
        found.fit.residuals = beside.residuals;
        found.fit.left_out.clear();
    }
    if points.len() < FEWEST_POINTS {
        return Ok(found);
    }
    let is_rejected = found.fit.is_rejected();
    if is_rejected || !found.fit.left_out.is_empty() {
        let explanation = explain(points, definition, expected, &known, &mut progress)?;
        let best = explanation.explains();
        let best = best.filter(|best| is_rejected || best.fit.left_out.len() <= found.fit.left_out.len());
        let is_explained = best.is_some();
        if let Some(best) = best {
            (found.fit, found.plant) = (best.fit.clone(), best.plant(expected));
        }
        if is_rejected || is_explained {
            found.explanation = Some(explanation);
            return Ok(found);
        }
    }
    let kept: Vec<usize> = (0..points.len()).filter(|n| !found.fit.left_out.contains(n)).collect();
    let problem = Problem::new(points.clone(), definition, &known).of(&kept);
    found.alternatives = problem.alternatives(&found.fit, expected, progress);
    Ok(found)
}

/// Fits the ideal cavity to all points, and, if they contradict it, each effect alone. `progress` is told the number of candidates done.
///
/// # Errors
/// As [`super::fit`].
pub fn explain(
    points: &[MeasuredPoint],
    definition: Definition,
    expected: &Parameters,
    known: &[Known],
    mut progress: impl FnMut(usize),
) -> Result<Explanation, FitError> {
    let problem = Problem::new(checked(points)?, definition, known);
    let ideal = problem.fit(expected)?;
    let tried = Effect::ALL.iter().enumerate().filter(|_| ideal.is_rejected());
    let with_effect = |(n, effect): (usize, &Effect)| {
        progress(n);
        problem.with_effect(*effect, expected)
    };
    let mut candidates: Vec<Candidate> = tried.filter_map(with_effect).collect();
    candidates.sort_by(Candidate::order);
    Ok(Explanation { ideal, candidates })
}

impl Problem<'_> {
    /// Effects with which the points agree as well as with the ideal cavity, while the half-width differs from it significantly: laws of restitution,
    /// and the others at the largest strength.
    fn alternatives(&self, ideal: &Fit, expected: &Parameters, mut progress: impl FnMut(usize)) -> Vec<Candidate> {
        let Some((b, same_points)) = ideal.estimate(Quantity::B).zip(self.fit(expected).ok()) else {
            return Vec::new();
        };
        let limit = same_points.chi_square - 2.0 * REJECTED.ln();
        let agrees =
            |one: &Candidate| !one.fit.is_rejected() && one.fit.left_out.is_empty() && one.fit.chi_square < limit;
        let of = |(n, effect): (usize, Effect)| {
            progress(n);
            let strongest = |sign| self.strongest(effect, sign, &same_points, agrees);
            match effect {
                Effect::Viscoelastic | Effect::Plastic => vec![self.with_effect(effect, expected).filter(agrees)],
                Effect::Hardening => vec![strongest(1.0), strongest(-1.0)],
                Effect::Friction | Effect::Tilt => vec![strongest(1.0)],
            }
        };
        let found = Effect::ALL.into_iter().enumerate().flat_map(of).flatten();
        found
            .filter(|one| (b.value - Quantity::B.of(&one.fit.x)).abs() > SIGNIFICANT * b.uncertainty)
            .collect()
    }

    /// The fit with the largest strength that the points allow, at most a strong one. Half-width and mass ratio make up for an effect, so that all strengths up to this one give
    /// the same points, and a search for the strength ends anywhere between. With a given strength the other parameters have one place: from a weak
    /// effect on the strength is doubled, and where this goes too far, by less and less.
    fn strongest(
        &self,
        effect: Effect,
        sign: f64,
        ideal: &Fit,
        agrees: impl Fn(&Candidate) -> bool,
    ) -> Option<Candidate> {
        let held = |x: Unknowns| self.with_effect_from(effect, x, ideal, false).filter(|one| agrees(one));
        let mut x = ideal.x;
        x[6] = sign * effect.start(&ideal.x, STRENGTHS[1])[6];
        let mut best = held(x)?;
        let (mut before, mut factor) = (ideal.x, 2.0_f64);
        before[6] = 0.0;
        let strong = effect.start(&ideal.x, STRENGTHS[2])[6];
        for _ in 0..MOST_FIT_STEPS {
            // On the straight line through the last two.
            let here = best.fit.x;
            let left = strong / here[6].abs();
            if left < SMALLEST_FACTOR {
                break;
            }
            let further = (factor.min(left) - 1.0) * here[6] / (here[6] - before[6]);
            match held(here + (here - before) * further) {
                Some(next) => (before, best) = (here, next),
                None if factor < SMALLEST_FACTOR => break,
                None => factor = factor.sqrt(),
            }
        }
        Some(best)
    }

    /// The fit with an effect; `None` if the plant has no such motions.
    ///
    /// Beside the fold a motion with wrong parameters may not exist, and most effects shift the points of large amplitude least: the fit without the
    /// fifth of the smallest responses starts that of all. A strong effect moves the fold, and the points beyond it belong to another motion: they
    /// are left out if the others agree.
    fn with_effect(&self, effect: Effect, expected: &Parameters) -> Option<Candidate> {
        let (order, all) = (self.by_falling_response(), self.points.len());
        let most = all - all / LEFT_OUT;
        let ideal = self.of(&order[..most]).fit(expected).ok()?;
        let mut best: Option<Candidate> = None;
        for strength in STRENGTHS {
            let mut x = effect.start(&ideal.x, strength);
            for count in [most, all] {
                let (problem, free) = (self.of(&order[..count]), effect.adds_a_parameter());
                let Some(mut next) = problem.with_effect_from(effect, x, &ideal, free) else {
                    break;
                };
                next.fit.left_out = (0..all).filter(|n| order[count..].contains(n)).collect();
                x = next.fit.x;
                best = best.into_iter().chain([next]).min_by(Candidate::order);
            }
            let describes_all = |one: &Candidate| !one.fit.is_rejected() && one.fit.left_out.is_empty();
            if !effect.adds_a_parameter() || best.as_ref().is_some_and(describes_all) {
                break;
            }
        }
        best
    }

    /// The fit with an effect, from the unknowns `x`; `free`: whether its strength is one.
    fn with_effect_from(&self, effect: Effect, x: Unknowns, ideal: &Fit, free: bool) -> Option<Candidate> {
        // The particle turns from -B to B: its speed relative to the wall before the impact is 2 B (1 + epsilon)/(1 + r).
        let particle = mean(ideal.speeds.iter().copied()) * Quantity::B.of(&ideal.x) * ideal.x[0].exp();
        let speed = 2.0 * particle * (1.0 + ideal.x[4].exp()) / (1.0 + ideal.x[2]);
        let problem = Problem { free, ..self.clone() };
        let fit = if effect == Effect::Hardening {
            problem.fit_from([x].into_iter()).ok()?
        } else {
            let curve = PlantCurve {
                problem: &problem,
                effect,
                speed,
                smallest: SMALLEST_STRENGTH * x[6],
            };
            let minimum = LeastSquares::minimum(&curve, x, &curve.along(&x)?, EFFECT_GAIN)?;
            let places: Vec<Nearest> = minimum
                .trace
                .iter()
                .map(|one| Nearest { speed, along: one.along })
                .collect();
            problem.found(&minimum, &places)
        };
        let value = |x: &Unknowns| effect.strength(x[6], x[2], speed);
        let gradient = gradient(&fit.x, value);
        let variance = (gradient.transpose() * fit.covariance * gradient)[0];
        let is_given = effect.adds_a_parameter() && !free;
        let uncertainty = if is_given { 0.0 } else { variance.max(0.0).sqrt() };
        let strength = Estimate { value: value(&fit.x), uncertainty };
        Some(Candidate { effect, strength, fit, speed })
    }
}

/// The curve of all motions at phase resonance of the plant with an effect.
struct PlantCurve<'a> {
    problem: &'a Problem<'a>,
    effect: Effect,
    speed: f64,
    /// Smallest strength.
    smallest: f64,
}

/// A motion on the curve.
#[derive(Clone)]
struct Place {
    motion: PlantMotion,
    /// Direction of the curve: change of the response over b and of the frequency over epsilon omega0, a unit vector.
    tangent: [f64; 2],
    /// The motion less the point, over its standard uncertainties, and the derivative along the curve.
    residual: Vector3<f64>,
    along: Vector3<f64>,
}

impl PlantCurve<'_> {
    /// The definition of resonance at the phase of a point.
    fn definition(&self, n: usize) -> Definition {
        self.problem.definition.at_phase(self.problem.points[n].phase)
    }

    /// The motion at the phase of a point near `near` on the line across the curve `ahead` of it.
    fn motion(&self, x: &Unknowns, n: usize, near: &PlantMotion, tangent: [f64; 2], ahead: f64) -> Option<PlantMotion> {
        if !(0.0 < x[2] && x[2] <= 1.0) {
            return None;
        }
        let (plant, definition) = (self.plant(x), self.definition(n));
        let (numbers, phase) = (Dimensionless::of(&plant, 0.0), definition.phase);
        let at = [
            near.response.norm() / numbers.b + ahead * tangent[0],
            numbers.sigma(near.omega) + ahead * tangent[1],
        ];
        let conditions = [
            Condition::Phase(phase),
            Condition::Across { phase, at, normal: tangent },
        ];
        periodic_motion(&plant, definition, near, conditions).ok()
    }

    fn plant(&self, x: &Unknowns) -> Parameters {
        plant(x, self.effect.cavity(x[6], x[2], self.speed))
    }

    fn residual(&self, n: usize, motion: &PlantMotion) -> Vector3<f64> {
        self.problem
            .over_u(n, motion.response.norm(), motion.omega, motion.amplitude)
    }

    /// As [`PlantCurve::motion`], for a point.
    fn place(&self, x: &Unknowns, n: usize, near: &PlantMotion, tangent: [f64; 2], ahead: f64) -> Option<Place> {
        let motion = self.motion(x, n, near, tangent, ahead)?;
        let next = self.motion(x, n, &motion, tangent, EFFECT_DIFFERENCE)?;
        let [length, rate] = units(x);
        let change = [
            (next.response.norm() - motion.response.norm()) / length,
            (next.omega - motion.omega) / rate,
        ];
        let size = change[0].hypot(change[1]);
        let residual = self.residual(n, &motion);
        let along = (self.residual(n, &next) - residual) / size;
        Some(Place {
            motion,
            tangent: change.map(|component| component / size),
            residual,
            along,
        })
    }

    /// The motions with the amplitudes of the points, or at the fold, from the largest one along the curve.
    fn along(&self, x: &Unknowns) -> Option<Vec<Place>> {
        let points = &self.problem.points;
        let order = self.problem.by_falling_response();
        let largest = points[order[0]].response.value;
        let mut near = resonant_motion(&self.plant(x), self.definition(order[0]), largest, None).ok()?;
        let (mut tangent, mut places) = ([1.0, 0.0], Vec::new());
        for n in order {
            let mut place = self.place(x, n, &near, tangent, 0.0)?;
            for _ in 0..MOST_FIT_STEPS {
                let rest = (points[n].response.value - place.motion.response.norm()) / units(x)[0];
                // Beyond the fold the amplitude rises again.
                if rest.abs() < POINT_DISTANCE || place.tangent[0] < 0.0 {
                    break;
                }
                let ahead = (rest / place.tangent[0]).clamp(-LONGEST_CURVE_STEP, LONGEST_CURVE_STEP);
                // Where the curve bends, a long step along its tangent finds no motion.
                let steps = (0..MOST_FIT_STEPS).map(|n| ahead * 0.5_f64.powi(n as i32));
                let mut steps = steps.take_while(|step| step.abs() >= POINT_DISTANCE.min(ahead.abs()));
                place = steps.find_map(|step| self.place(x, n, &place.motion, place.tangent, step))?;
            }
            (near, tangent) = (place.motion.clone(), place.tangent);
            places.push((n, place));
        }
        places.sort_by_key(|(n, _)| *n);
        Some(places.into_iter().map(|(_, place)| place).collect())
    }
}

impl Misfit<UNKNOWNS> for PlantCurve<'_> {
    type Trace = Vec<Place>;

    /// Each motion moves along its curve to the place nearest to the point.
    fn residuals(&self, x: &Unknowns, near: &Vec<Place>) -> Option<(Vec<f64>, Vec<Place>)> {
        let moved = near.iter().enumerate().map(|(n, place)| {
            let here = self.place(x, n, &place.motion, place.tangent, 0.0)?;
            let ahead = -here.along.dot(&here.residual) / here.along.norm_squared();
            if ahead.abs() < POINT_DISTANCE {
                return Some(here);
            }
            self.place(
                x,
                n,
                &here.motion,
                here.tangent,
                ahead.clamp(-LONGEST_CURVE_STEP, LONGEST_CURVE_STEP),
            )
        });
        let places: Vec<Place> = moved.collect::<Option<_>>()?;
        let residuals = places
            .iter()
            .flat_map(|one| <[f64; 3]>::from(across(&one.along, &one.residual)));
        Some((residuals.chain(self.problem.known_residuals(x)).collect(), places))
    }

    fn derivatives(&self, x: &Unknowns, at: &Vec<Place>) -> Option<Vec<Unknowns>> {
        self.problem.rows(x, at.iter().map(|place| place.along), |n, i| {
            let step = if i == 6 {
                EFFECT_DIFFERENCE * x[6]
            } else {
                EFFECT_DIFFERENCE
            };
            let slope = |step: f64| {
                let motion = self.motion(&shifted(x, i, step), n, &at[n].motion, at[n].tangent, 0.0)?;
                Some((self.residual(n, &motion) - at[n].residual) / step)
            };
            slope(step).or_else(|| slope(-step))
        })
    }

    /// Neither friction nor the square of a tilt is negative.
    fn limits(&self) -> [[f64; 2]; UNKNOWNS] {
        let mut limits = LIMITS;
        limits[6][0] = self.smallest;
        limits
    }
}

/// b, m, and epsilon omega0, rad/s.
fn units(x: &Unknowns) -> [f64; 2] {
    [x[3].exp(), (x[4] + x[0]).exp()]
}
