//! Effects of a real cavity that explain why points contradict the ideal one: each is fitted alone, and they are compared.
//!
//! The curve of a rig with an effect is that of the ideal cavity, shifted: at the amplitude of a point the plant's own periodic motion
//! ([`resonant_motion`]) has another frequency and another drive. The shifts are computed at the present parameters, once with the present
//! strength of the effect and once with a little more; with them the fit of the ideal curve finds parameters and strength, and this is repeated
//! until the strength is unchanged. At the end chi-square is that of the plant's motions.
//!
//! Unequal gaps are no candidate: they shift the particle by the middle of the cavity and change nothing that the points contain. The fitted b is
//! half of the distance between the walls.

use std::fmt::{self, Display, Formatter};

use lovines::{Cavity, Restitution};
use vines_model::Definition;
use vines_model::numerics::Estimate;
use vines_model::orbit::{PlantMotion, resonant_motion};

use super::{Curve, Fit, FitError, Known, MeasuredPoint, Problem, Quantity, Shift, Unknowns, checked};
use crate::scene::{Dimensionless, Parameters};

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
/// Change of the strength over its standard uncertainty at which it counts as found.
const FOUND: f64 = 0.02;
/// Strength from which the search begins, over that which gives the particle the acceleration `b omega0²`: friction and tilt of this size are
/// about 0.03 and 2 degrees on the default rig.
const TYPICAL: f64 = 0.01;
/// Step of the strength for its derivative, over the typical one.
const STEP: f64 = 1e-2;
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
            candidates.extend(problem.with_effect(effect, &ideal));
        }
    }
    candidates.sort_by(|one, other| one.criterion().total_cmp(&other.criterion()));
    Ok(Explanation { ideal, candidates })
}

impl Problem<'_> {
    /// The fit with an effect, from the fit without; `None` if the plant has no such motions.
    fn with_effect(&self, effect: Effect, ideal: &Fit) -> Option<Candidate> {
        let plant = |x: &Unknowns| Parameters {
            primary_mass: Quantity::PrimaryMass.of(x),
            stiffness: Quantity::Stiffness.of(x),
            damping: Quantity::Damping.of(x).max(0.0),
            particle_mass: Quantity::ParticleMass.of(x),
            half_width: Quantity::B.of(x),
            restitution: x[2],
            cavity: Cavity::IDEAL,
        };
        let mut x = ideal.x;
        let d = Dimensionless {
            definition: self.definition,
            ..Dimensionless::of(&plant(&x), 0.0)
        };
        // The particle turns from -B to B: its speed relative to the wall before the impact is 2 B (1 + epsilon)/(1 + r).
        let speeds = vines_model::numerics::mean(ideal.speeds.iter().copied());
        let speed = 2.0 * speeds * (1.0 + d.epsilon) / (1.0 + d.r) * d.b * d.omega0;
        let typical = TYPICAL * d.b * d.omega0 * d.omega0 / lovines::cavity::GRAVITY;
        let (first, step) = match effect {
            Effect::Friction => (typical, STEP * typical),
            Effect::Tilt => (4.0 * typical * typical, STEP * typical * typical),
            Effect::Viscoelastic | Effect::Plastic => (0.0, 0.0),
        };
        x[6] = first;
        let mut speeds: Vec<f64> = ideal.speeds.clone();
        let mut motions: Vec<Option<PlantMotion>> = vec![None; self.points.len()];
        let mut previous = None;
        for _ in 0..ROUNDS {
            let here = plant(&x);
            let mut shifts = Vec::with_capacity(speeds.len());
            for (speed_of_particle, last) in speeds.iter().zip(&mut motions) {
                let Curve { response, omega, drive } = self.curve(&x, *speed_of_particle)?;
                let mut at = |strength: f64| {
                    let cavity = effect.cavity(strength, x[2], speed);
                    let rig = Parameters { cavity, ..here };
                    let motion = resonant_motion(&rig, self.definition, response, last.as_ref()).ok()?;
                    let shift = [motion.omega / omega - 1.0, motion.amplitude / drive - 1.0];
                    *last = Some(motion);
                    Some(shift)
                };
                let value = at(x[6])?;
                let slope = if effect.adds_a_parameter() {
                    let more = at(x[6] + step)?;
                    [0, 1].map(|i| (more[i] - value[i]) / step)
                } else {
                    [0.0; 2]
                };
                shifts.push(Shift { strength: x[6], value, slope });
            }
            let problem = Problem {
                points: self.points.clone(),
                shifts,
                free: effect.adds_a_parameter(),
                ..*self
            };
            let (mut next, sums) = problem.minimum(x)?;
            let fit = problem.found(next, sums);
            let strength = Estimate {
                value: next[6],
                uncertainty: fit.covariance[(6, 6)].max(0.0).sqrt(),
            };
            let r = fit.estimate(Quantity::R)?;
            let result = effect.strength(Estimate { value: strength.value.max(0.0), ..strength }, r, speed);
            let change = (next - x).component_div(&fit.covariance.diagonal().map(|variance| variance.max(0.0).sqrt()));
            speeds.clone_from(&fit.speeds);
            let settled = change
                .iter()
                .take(5)
                .chain(&[if problem.free { change[6] } else { 0.0 }])
                .all(|one| one.abs() < FOUND);
            let candidate = Candidate { effect, strength: result, fit, speed };
            if settled {
                return (strength.value > 0.0 || !effect.adds_a_parameter()).then_some(candidate);
            }
            // Neither friction nor the square of a tilt is negative; a large step may lose the motion.
            if problem.free {
                next[6] = next[6].clamp(0.25 * x[6], 3.0 * x[6]);
            }
            (x, previous) = (next, Some(candidate));
        }
        previous.filter(|one| one.strength.value > 0.0)
    }
}
