//! The quantities of a rig, and what is known of them beside its points: values from elsewhere, and the linear response, with the state of the particle.

use std::f64::consts::TAU;
use std::str::FromStr;

use lovines::Parameters;
use nalgebra::SVector;
use vines_model::ArgumentError;
use vines_model::numerics::Estimate;
use vines_scene::linear::{MeasuredLinear, ParticleState};

use crate::hypothesis::Hypothesis;

/// Number of unknowns.
pub(crate) const UNKNOWNS: usize = 8;
/// The unknowns: the logarithm of omega0 (rad/s), zeta, r, the logarithms of b (m), epsilon and M (kg), the friction, and the strength of another effect.
pub(crate) type Unknowns = SVector<f64, UNKNOWNS>;

/// Step of a difference, relative or, of zeta and r, absolute: the root of the error of curves and motions, 1e-12.
pub(crate) const STEP: f64 = 1e-6;

/// The unknowns of a plant.
pub(crate) fn unknowns(plant: &Parameters) -> Unknowns {
    Unknowns::from([
        plant.natural_frequency().ln(),
        0.5 * plant.damping / (plant.stiffness * plant.primary_mass).sqrt(),
        plant.restitution,
        plant.half_width.ln(),
        plant.mass_ratio().ln(),
        plant.primary_mass.ln(),
        0.0,
        0.0,
    ])
}

/// The unknowns with one moved by a step.
pub(crate) fn moved(x: &Unknowns, i: usize, step: f64) -> Unknowns {
    let mut x = *x;
    x[i] += step;
    x
}

/// The gradient of a quantity.
pub(crate) fn gradient(x: &Unknowns, of: impl Fn(&Unknowns) -> f64) -> Unknowns {
    Unknowns::from_fn(|i, _| {
        let [low, high] = [-STEP, STEP].map(|step| of(&moved(x, i, step)));
        (high - low) / (2.0 * STEP)
    })
}

/// A quantity of a rig.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quantity {
    /// Natural frequency without the particle, Hz.
    F0,
    /// Damping ratio of the structure.
    Zeta,
    /// Restitution coefficient.
    R,
    /// Half-width of the cavity, m.
    B,
    /// Mass ratio m/M.
    Epsilon,
    /// Primary mass, kg.
    PrimaryMass,
    /// Mass of the particle, kg.
    ParticleMass,
    /// Stiffness, N/m.
    Stiffness,
    /// Damping, N s/m.
    Damping,
}

impl Quantity {
    /// All of them: those that a fit determines first, then those that need a mass, a stiffness or a damping from elsewhere.
    pub const ALL: [Self; 9] = [
        Self::F0,
        Self::Zeta,
        Self::R,
        Self::B,
        Self::Epsilon,
        Self::PrimaryMass,
        Self::ParticleMass,
        Self::Stiffness,
        Self::Damping,
    ];
    /// Those that a fit determines.
    pub const FITTED: &[Self] = Self::ALL.split_at(5).0;

    /// Symbol and unit.
    #[must_use]
    pub fn symbol(self) -> [&'static str; 2] {
        match self {
            Self::F0 => ["f0", "Hz"],
            Self::Zeta => ["zeta", ""],
            Self::R => ["r", ""],
            Self::B => ["b", "m"],
            Self::Epsilon => ["epsilon", ""],
            Self::PrimaryMass => ["M", "kg"],
            Self::ParticleMass => ["m", "kg"],
            Self::Stiffness => ["k", "N/m"],
            Self::Damping => ["c", "N s/m"],
        }
    }

    /// Whether the motion shows it only together with another mass, stiffness or damping.
    pub(crate) fn needs_a_scale(self) -> bool {
        !Self::FITTED.contains(&self)
    }

    /// The value at the unknowns.
    pub(crate) fn of(self, x: &Unknowns) -> f64 {
        let (omega0, mass) = (x[0].exp(), x[5].exp());
        match self {
            Self::F0 => omega0 / TAU,
            Self::Zeta => x[1],
            Self::R => x[2],
            Self::B => x[3].exp(),
            Self::Epsilon => x[4].exp(),
            Self::PrimaryMass => mass,
            Self::ParticleMass => x[4].exp() * mass,
            Self::Stiffness => mass * omega0 * omega0,
            Self::Damping => 2.0 * x[1] * omega0 * mass,
        }
    }

    /// The value of a plant.
    #[must_use]
    pub fn of_plant(self, plant: &Parameters) -> f64 {
        self.of(&unknowns(plant))
    }

    /// The gradient over the unknowns.
    pub(crate) fn gradient(self, x: &Unknowns) -> Unknowns {
        gradient(x, |x| self.of(x))
    }
}

/// What is known beside the points; parse a value from `m=0.032±0.0005`, or `r=0.65` for an exact value.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Known {
    /// A value from elsewhere, in the unit of its quantity; an uncertainty of 0 fixes it.
    Value {
        /// Of what.
        quantity: Quantity,
        /// The value.
        estimate: Estimate,
    },
    /// The strength of what a hypothesis adds, in the unit of [`Hypothesis::names`]: 0 excludes it.
    Strength {
        /// Of which.
        hypothesis: Hypothesis,
        /// The value.
        estimate: Estimate,
    },
    /// Natural frequency and damping ratio. While the state of the particle is unknown, they say nothing.
    Linear(MeasuredLinear),
}

/// Relative uncertainty of a value that is known exactly: above rounding.
const EXACT_VALUE: f64 = 1e-9;

impl Known {
    /// Whether it needs a mass.
    pub(crate) fn needs_a_scale(&self) -> bool {
        matches!(self, Self::Value { quantity, .. } if quantity.needs_a_scale())
    }

    /// Independent residuals over their standard uncertainties. `strength`: of an effect, 0 of all that the hypothesis has not.
    pub(crate) fn residuals(&self, x: &Unknowns, strength: impl Fn(Hypothesis) -> f64) -> Vec<f64> {
        let off = |here: f64, Estimate { value, uncertainty }: Estimate| {
            (here - value) / uncertainty.max(EXACT_VALUE * value.abs()).max(f64::MIN_POSITIVE)
        };
        match self {
            Self::Strength { hypothesis, estimate } => vec![off(strength(*hypothesis), *estimate)],
            Self::Value { quantity, estimate } => vec![off(quantity.of(x), *estimate)],
            Self::Linear(linear) => {
                // The damper is the same, and the mass is M + m.
                let added = match linear.particle {
                    ParticleState::Free => 0.0,
                    ParticleState::Carried => Quantity::Epsilon.of(x),
                    ParticleState::Unknown => return Vec::new(),
                };
                let of = |quantity: Quantity| quantity.of(x) / (1.0 + added).sqrt();
                let f0 = (of(Quantity::F0) - linear.f0) / linear.u_f0;
                let zeta = (of(Quantity::Zeta) - linear.zeta) / linear.u_zeta;
                let rho = linear.correlation;
                vec![f0, (zeta - rho * f0) / (1.0 - rho * rho).sqrt()]
            }
        }
    }
}

impl FromStr for Known {
    type Err = ArgumentError;

    fn from_str(text: &str) -> Result<Self, ArgumentError> {
        let quantities = Quantity::ALL.map(|quantity| quantity.symbol()[0]);
        // The spring without a particle has the h of the cubic stiffness.
        let strengths = Hypothesis::ALL.into_iter().filter(|hypothesis| hypothesis.is_cavity());
        let strengths = strengths.map(|hypothesis| hypothesis.names()[1]);
        let symbols = quantities
            .into_iter()
            .chain(strengths)
            .filter(|symbol| !symbol.is_empty());
        let symbols = symbols.collect::<Vec<_>>().join(", ");
        let form = || {
            format!("`{text}`: expected SYMBOL=VALUE±UNCERTAINTY, for instance m=0.032±0.0005, with one of {symbols}")
        };
        let (symbol, numbers) = text.split_once('=').ok_or_else(form)?;
        let symbol = symbol.trim();
        let quantity = Quantity::ALL
            .into_iter()
            .find(|quantity| quantity.symbol()[0] == symbol);
        let is_its = |hypothesis: &Hypothesis| !symbol.is_empty() && hypothesis.names()[1] == symbol;
        let hypothesis = Hypothesis::ALL.into_iter().find(is_its);
        let (value, uncertainty) = numbers
            .split_once('±')
            .or(numbers.split_once("+-"))
            .unwrap_or((numbers, "0"));
        let number = |text: &str| text.trim().parse::<f64>().ok().filter(|number| number.is_finite());
        let (value, uncertainty) = number(value).zip(number(uncertainty)).ok_or_else(form)?;
        let may_be_0 = matches!(quantity, None | Some(Quantity::Zeta | Quantity::Damping));
        let may_be_negative = matches!(hypothesis, Some(Hypothesis::Cubic | Hypothesis::Reference));
        if uncertainty < 0.0 || (value < 0.0 && !may_be_negative) || (value == 0.0 && !may_be_0) {
            return Err(format!("`{text}`: the value must be positive, and its uncertainty positive or 0").into());
        }
        let most = match quantity {
            Some(Quantity::R | Quantity::Zeta) => 1.0,
            _ => f64::INFINITY,
        };
        if value > most {
            return Err(format!("`{text}`: the value may be at most {most}").into());
        }
        let estimate = Estimate { value, uncertainty };
        match (quantity, hypothesis) {
            (Some(quantity), _) => Ok(Self::Value { quantity, estimate }),
            (_, Some(hypothesis)) => Ok(Self::Strength { hypothesis, estimate }),
            _ => Err(form().into()),
        }
    }
}
