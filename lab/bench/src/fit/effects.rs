//! Effects of a real cavity that explain why points contradict the ideal one: each is fitted alone, and they are compared.
//!
//! The curve of a rig with an effect is that of the ideal cavity, shifted: at the amplitude of a point the plant's own periodic motion
//! ([`resonant_motion`]) has another frequency and another drive. The shifts and their gradients over parameters and strength are computed at the
//! present parameters; with them the fit of the ideal curve finds the next ones. At the end chi-square is that of the plant's motions.
//!
//! Unequal gaps are no candidate: they shift the particle by the middle of the cavity and change nothing that the points contain. The fitted b is
//! half of the distance between the walls.

use std::fmt::{self, Display, Formatter};

use lovines::cavity::GRAVITY;
use lovines::{Cavity, Restitution};
use vines_model::Definition;
use vines_model::numerics::{Estimate, mean};
use vines_model::orbit::{DriveCondition, PlantMotion, periodic_motion, resonant_motion};

use super::{
    Curve, FEWEST, Fit, FitError, Known, MeasuredPoint, Problem, Quantity, Shift, UNKNOWNS, Unknowns, checked, fit,
    unknowns,
};
use crate::scene::Parameters;

/// An effect of a real cavity.
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
}

/// A fit with one effect.
#[derive(Debug, Clone)]
pub struct Candidate {
    /// Which.
    pub effect: Effect,
    /// Its strength, in the unit of [`Effect::symbol`].
    pub strength: Estimate,
    /// The fit; its chi-square is that of the plant's own motions.
    pub fit: Fit,
    /// Impact speed, m/s, at which a restitution that depends on it has the value r of the fit.
    speed: f64,
}

/// Rounds in which the shifts are computed again.
const ROUNDS: usize = 12;
/// What a further step would take from chi-square, at which the minimum counts as found.
const FOUND: f64 = 0.02;
/// Smallest share of a step.
const SMALLEST: f64 = 1e-3;
/// Strength from which the search begins, over that which gives the particle the acceleration `b omega0²`: friction and tilt of this size are
/// about 0.03 and 2 degrees on the default rig.
const TYPICAL: f64 = 0.01;
/// Step of a difference: of the unknowns, and of the strength over the typical one.
const STEP: f64 = 1e-4;
/// Difference of Akaike's criterion up to which a candidate that is not the best one remains possible: its evidence is a twentieth.
const POSSIBLE: f64 = 6.0;

impl Effect {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Friction, Self::Tilt, Self::Viscoelastic, Self::Plastic];

    /// Symbol and unit of its strength.
    #[must_use]
    pub fn symbol(self) -> [&'static str; 2] {
        match self {
            Self::Friction => ["mu", ""],
            Self::Tilt => ["theta", "deg"],
            Self::Viscoelastic => ["k_r", "(s/m)^(1/5)"],
            Self::Plastic => ["v_y", "m/s"],
        }
    }

    /// Whether it has a strength beside the five parameters: a law of restitution stands for r.
    fn adds_a_parameter(self) -> bool {
        matches!(self, Self::Friction | Self::Tilt)
    }

    /// The cavity with this effect: `strength` is the friction, the square of the tilt (the motions are even in it), or nothing; `r` is the
    /// restitution at the impact speed `speed`, m/s.
    fn cavity(self, strength: f64, r: f64, speed: f64) -> Cavity {
        let both = |law| Cavity { restitution: [Some(law); 2], ..Cavity::IDEAL };
        match self {
            Self::Friction => Cavity { kinetic_friction: strength, ..Cavity::IDEAL },
            Self::Tilt => Cavity { tilt: strength.sqrt(), ..Cavity::IDEAL },
            Self::Viscoelastic => both(Restitution::Viscoelastic((1.0 - r) / speed.powf(0.2))),
            Self::Plastic => both(Restitution::Plastic(speed * r.powi(4))),
        }
    }

    /// The strength in the unit of [`Effect::symbol`].
    fn strength(self, x: Estimate, r: Estimate, speed: f64) -> Estimate {
        match self {
            Self::Friction => x,
            Self::Tilt => {
                let tilt = x.value.sqrt();
                Estimate { value: tilt, uncertainty: x.uncertainty / (2.0 * tilt) }.scaled(1f64.to_degrees())
            }
            Self::Viscoelastic => {
                Estimate { value: 1.0 - r.value, uncertainty: r.uncertainty }.scaled(speed.powf(-0.2))
            }
            Self::Plastic => Estimate {
                value: speed * r.value.powi(4),
                uncertainty: 4.0 * speed * r.value.powi(3) * r.uncertainty,
            },
        }
    }
}

impl Display for Effect {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Friction => "friction",
            Self::Tilt => "tilt",
            Self::Viscoelastic => "viscoelastic restitution",
            Self::Plastic => "plastic restitution",
        })
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
        self.candidates.first().filter(|best| !best.fit.is_rejected())
    }

    /// The verdict in a sentence.
    #[must_use]
    pub fn verdict(&self) -> String {
        let chi_square = |fit: &Fit| format!("{:.0} for {}", fit.chi_square, fit.degrees);
        let Some(best) = self.explains() else {
            let tried: Vec<String> = self
                .candidates
                .iter()
                .map(|one| format!("{} ({})", one.effect, chi_square(&one.fit)))
                .collect();
            return format!(
                "no single effect of the cavity explains it: chi-square is {} without one, with {}",
                chi_square(&self.ideal),
                if tried.is_empty() {
                    "none of them a motion exists".into()
                } else {
                    tried.join(", ")
                }
            );
        };
        let [symbol, unit] = best.effect.symbol();
        let Estimate { value, uncertainty } = best.strength;
        let (space, decimals) = (if unit.is_empty() { "" } else { " " }, decimals(uncertainty));
        let mut text = format!(
            "{} explains it: {symbol} = {value:.decimals$} ± {uncertainty:.decimals$}{space}{unit}, chi-square {}; without it, chi-square is {}",
            best.effect,
            chi_square(&best.fit),
            chi_square(&self.ideal)
        );
        let others = self.candidates[1..]
            .iter()
            .filter(|one| one.criterion() - best.criterion() < POSSIBLE);
        let others: Vec<String> = others
            .map(|one| format!("{} ({})", one.effect, chi_square(&one.fit)))
            .collect();
        if !others.is_empty() {
            text += &format!("; the points do not exclude {}", others.join(", "));
        }
        text
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

    /// The plant of the fit, with the effect. Without a known mass, stiffness or damping, its primary mass is that of `scene`.
    #[must_use]
    pub fn plant(&self, scene: &Parameters) -> Parameters {
        let cavity = self.effect.cavity(self.fit.x[6], self.fit.x[2], self.speed);
        Parameters { cavity, ..self.fit.plant(scene) }
    }
}

/// The rig that fits some points.
#[derive(Debug, Clone)]
pub struct Found {
    /// The fit: of the ideal cavity, or with the effect that explains why the points contradict it.
    pub fit: Fit,
    /// Its plant.
    pub plant: Parameters,
    /// What the effects say, if the ideal cavity does not describe all points.
    pub verdict: Option<String>,
}

/// [`fit()`], and where the ideal cavity does not describe all points, the effect that does. `progress` is told the number of effects tried.
///
/// # Errors
/// As [`fit()`].
pub fn find(
    points: &[MeasuredPoint],
    definition: Definition,
    expected: &Parameters,
    known: &[Known],
    progress: impl FnMut(usize),
) -> Result<Found, FitError> {
    let ideal = fit(points, definition, expected, known)?;
    let plant = ideal.plant(expected);
    if !ideal.is_rejected() && ideal.left_out.is_empty() {
        return Ok(Found { fit: ideal, plant, verdict: None });
    }
    let explanation = explain(points, definition, expected, known, progress)?;
    let verdict = Some(explanation.verdict());
    Ok(match explanation.explains() {
        Some(best) => Found { fit: best.fit.clone(), plant: best.plant(expected), verdict },
        None => Found { fit: ideal, plant, verdict },
    })
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
    let mut candidates = Vec::new();
    if ideal.is_rejected() {
        for (n, effect) in Effect::ALL.into_iter().enumerate() {
            progress(n);
            candidates.extend(problem.with_effect(effect, &ideal, expected));
        }
    }
    candidates.sort_by(|one, other| one.criterion().total_cmp(&other.criterion()));
    Ok(Explanation { ideal, candidates })
}

impl Problem<'_> {
    /// The best one of the fits with an effect from several starts, up to the first that describes the points; `None` if the plant has no such
    /// motions.
    fn with_effect(&self, effect: Effect, ideal: &Fit, expected: &Parameters) -> Option<Candidate> {
        let mut best: Option<Candidate> = None;
        // Most effects shift the points of large amplitude least.
        let mut strongest = self.points.clone();
        strongest.sort_by(|one, other| other.response.value.total_cmp(&one.response.value));
        strongest.truncate(strongest.len().div_ceil(2).max(FEWEST));
        let strongest = Problem::new(strongest, self.definition, self.known).fit(expected);
        let first = strongest.map_or(ideal.x, |fit| fit.x);
        for (x, strength) in [(first, 1.0), (ideal.x, 1.0), (unknowns(expected), 1.0), (ideal.x, 4.0)] {
            if strength > 1.0 && !effect.adds_a_parameter() {
                continue;
            }
            let found = self.with_effect_from(effect, x, strength * TYPICAL, ideal);
            let both = best.into_iter().chain(found);
            best = both.min_by(|one, other| one.criterion().total_cmp(&other.criterion()));
            if best.as_ref().is_some_and(|one| !one.fit.is_rejected()) {
                break;
            }
        }
        best
    }

    /// The fit with an effect, from the unknowns `x`: Gauss and Newton's method with the plant's motions, in steps that reduce chi-square.
    fn with_effect_from(&self, effect: Effect, mut x: Unknowns, strength: f64, ideal: &Fit) -> Option<Candidate> {
        let [b, omega0] = [Quantity::B.of(&x), x[0].exp()];
        // The particle turns from -B to B: its speed relative to the wall before the impact is 2 B (1 + epsilon)/(1 + r).
        let particle = mean(ideal.speeds.iter().copied());
        let speed = 2.0 * particle * (1.0 + x[4].exp()) / (1.0 + x[2]) * b * omega0;
        let typical = strength * b * omega0 * omega0 / GRAVITY;
        let (typical, free) = match effect {
            Effect::Friction => (typical, true),
            Effect::Tilt => (4.0 * typical * typical, true),
            Effect::Viscoelastic | Effect::Plastic => (0.0, false),
        };
        x[6] = typical;
        let mut steps = Unknowns::from_element(STEP);
        steps[6] = STEP * typical;
        let mut motions: Vec<Option<PlantMotion>> = vec![None; self.points.len()];
        let mut shift = |n: usize, x: &Unknowns, particle: f64| {
            let Curve { response, omega, drive } = self.curve(x, particle)?;
            let cavity = effect.cavity(x[6], x[2], speed);
            let rig = Parameters { cavity, ..plant(x) };
            let conditions = [DriveCondition::PhaseResonance, DriveCondition::Response(response)];
            let motion = match &motions[n] {
                Some(near) => periodic_motion(&rig, self.definition, near, conditions),
                None => resonant_motion(&rig, self.definition, response, None),
            };
            let motion = motion.ok()?;
            let shift = [motion.omega / omega - 1.0, motion.amplitude / drive - 1.0];
            motions[n] = Some(motion);
            Some(shift)
        };
        let mut slopes = vec![[0.0; 2]; self.points.len()];
        let mut problem = Problem {
            points: self.points.clone(),
            shifts: Vec::new(),
            free,
            ..*self
        };
        // Without shifts, the particle speeds at which the points are nearest.
        let mut here = problem.sums(&x, &mut vec![None; self.points.len()])?;
        here.chi_square = f64::INFINITY;
        let (mut next, mut next_speeds) = (x, here.speeds.clone());
        for _ in 0..ROUNDS {
            let mut share = 1.0;
            // A step that reduces chi-square; the first one is to the start.
            loop {
                let at = if here.chi_square.is_infinite() {
                    next
                } else {
                    x + (next - x) * share
                };
                let ends = here.speeds.iter().zip(&next_speeds);
                let speeds: Vec<f64> = ends.map(|(from, to)| from + share * (to - from)).collect();
                let shifts: Option<Vec<Shift>> = (0..speeds.len())
                    .map(|n| {
                        Some(Shift {
                            at,
                            speed: speeds[n],
                            value: shift(n, &at, speeds[n])?,
                            gradient: [Unknowns::zeros(); 2],
                            by_speed: slopes[n],
                        })
                    })
                    .collect();
                let there = shifts.and_then(|shifts| {
                    problem.shifts = shifts;
                    problem.sums(&at, &mut speeds.into_iter().map(Some).collect::<Vec<_>>())
                });
                if let Some(there) = there.filter(|there| there.chi_square <= here.chi_square) {
                    (x, here) = (at, there);
                    break;
                }
                share *= 0.3;
                if share < SMALLEST {
                    return None;
                }
                // Too much of the effect may end the motion.
                if here.chi_square.is_infinite() {
                    next[6] *= 0.3;
                }
            }
            // Values and derivatives at the same places.
            for (n, one) in problem.shifts.iter_mut().enumerate() {
                one.speed = here.speeds[n];
                one.value = shift(n, &x, one.speed)?;
                let value = shift(n, &x, one.speed + STEP)?;
                one.by_speed = [0, 1].map(|i| (value[i] - one.value[i]) / STEP);
                slopes[n] = one.by_speed;
            }
            for i in (0..UNKNOWNS).filter(|i| *i != 5 && (free || *i != 6)) {
                let mut more = x;
                more[i] += steps[i];
                for n in 0..here.speeds.len() {
                    let value = shift(n, &more, here.speeds[n])?;
                    let one = &mut problem.shifts[n];
                    for (gradient, (value, before)) in one.gradient.iter_mut().zip(value.into_iter().zip(one.value)) {
                        gradient[i] = (value - before) / steps[i];
                    }
                }
            }
            let mut speeds: Vec<Option<f64>> = here.speeds.iter().copied().map(Some).collect();
            here = problem.sums(&x, &mut speeds)?;
            let (mut best, least) = problem.minimum(x)?;
            next_speeds.clone_from(&least.speeds);
            if here.chi_square - least.chi_square < FOUND {
                let fit = problem.found(x, here);
                let uncertainty = fit.covariance[(6, 6)].max(0.0).sqrt();
                let strength = Estimate { value: x[6], uncertainty };
                let strength = effect.strength(strength, fit.estimate(Quantity::R)?, speed);
                return Some(Candidate { effect, strength, fit, speed });
            }
            // Neither friction nor the square of a tilt is negative.
            best[6] = best[6].max(0.1 * x[6]);
            next = best;
        }
        None
    }
}

/// The ideal plant of some unknowns.
fn plant(x: &Unknowns) -> Parameters {
    Parameters {
        primary_mass: Quantity::PrimaryMass.of(x),
        stiffness: Quantity::Stiffness.of(x),
        damping: Quantity::Damping.of(x).max(0.0),
        particle_mass: Quantity::ParticleMass.of(x),
        half_width: Quantity::B.of(x),
        restitution: x[2],
        cavity: Cavity::IDEAL,
    }
}
