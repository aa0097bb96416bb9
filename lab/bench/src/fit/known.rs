//! The quantities of a rig, and what is known of them beside its points: values from elsewhere, and the linear response, with the state of the particle.

use std::f64::consts::TAU;
use std::str::FromStr;

use serde::Serialize;
use vines_model::numerics::Estimate;
use vines_model::{ArgumentError, Definition};

use super::{
    Fit, FitError, LinearDecay, MeasuredPoint, Problem, REJECTED, Unknowns, fit, gradient, probability, unknowns,
};
use vines_scene::linear::{MeasuredLinear, ParticleState};
use vines_scene::scene::Parameters;

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
    pub(super) fn needs_a_scale(self) -> bool {
        !Self::FITTED.contains(&self)
    }

    /// The value at the unknowns.
    pub(super) fn of(self, x: &Unknowns) -> f64 {
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
    pub(super) fn gradient(self, x: &Unknowns) -> Unknowns {
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
    /// Natural frequency and damping ratio. While the state of the particle is unknown, they say nothing.
    Linear(MeasuredLinear),
}

/// Relative uncertainty of a value that is known exactly: above rounding.
const EXACT_VALUE: f64 = 1e-9;

impl Known {
    /// Whether it needs a mass.
    pub(super) fn needs_a_scale(&self) -> bool {
        matches!(self, Self::Value { quantity, .. } if quantity.needs_a_scale())
    }

    /// Number of residuals.
    pub(super) fn equations(&self) -> usize {
        match self {
            Self::Value { .. } => 1,
            Self::Linear(linear) => 2 * usize::from(linear.particle != ParticleState::Unknown),
        }
    }

    /// Independent residuals over their standard uncertainties.
    pub(super) fn residuals(&self, x: &Unknowns) -> Vec<f64> {
        match self {
            Self::Value { quantity, estimate: Estimate { value, uncertainty } } => {
                let uncertainty = uncertainty.max(EXACT_VALUE * value.abs()).max(f64::MIN_POSITIVE);
                vec![(quantity.of(x) - value) / uncertainty]
            }
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

    /// Derivatives of the residuals by the unknowns.
    pub(super) fn rows(&self, x: &Unknowns) -> Vec<Unknowns> {
        (0..self.equations())
            .map(|n| gradient(x, |x| self.residuals(x)[n]))
            .collect()
    }
}

impl From<LinearDecay> for MeasuredLinear {
    /// A decay does not tell the state of the particle.
    fn from(decay: LinearDecay) -> Self {
        let f0 = decay.omega.scaled(1.0 / TAU);
        Self {
            f0: f0.value,
            u_f0: f0.uncertainty,
            zeta: decay.zeta.value,
            u_zeta: decay.zeta.uncertainty,
            correlation: 0.0,
            particle: ParticleState::Unknown,
        }
    }
}

/// What the points say of a linear response that was measured beside them.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct LinearVerdict {
    /// The linear response. Its state is known if the fit takes it.
    pub linear: MeasuredLinear,
    /// Rise of the chi-square of the points by these data if the particle was carried along, and if it was free; absent for a state that the
    /// measurement excludes.
    pub rises: [Option<f64>; 2],
}

impl LinearVerdict {
    /// Whether a state agrees with the points: the probability of a larger rise, of two degrees of freedom, is at least 1 %.
    #[must_use]
    pub fn agrees(&self) -> [bool; 2] {
        let is_likely = |rise: f64| probability(rise, 2.0).is_some_and(|p| p >= REJECTED);
        self.rises.map(|rise| rise.is_some_and(is_likely))
    }
}

/// What the points say of the linear responses `linear`: data of the fit if exactly one state of the particle agrees with the points.
///
/// # Errors
/// As [`fit`].
pub fn linear_verdicts(
    linear: &[MeasuredLinear],
    points: &[MeasuredPoint],
    definition: Definition,
    expected: &Parameters,
    known: &[Known],
) -> Result<Vec<LinearVerdict>, FitError> {
    if linear.is_empty() {
        return Ok(Vec::new());
    }
    let alone = fit(points, definition, expected, known)?;
    let kept = (0..points.len()).filter(|n| !alone.left_out.contains(n));
    let kept: Vec<MeasuredPoint> = kept.map(|n| points[n]).collect();
    let with = |linear: MeasuredLinear| -> Option<Fit> {
        let known = [known, &[Known::Linear(linear)]].concat();
        let problem = Problem::new(kept.clone(), definition, &known);
        problem.fit_from([alone.x].into_iter()).ok()
    };
    let verdict = |linear: &MeasuredLinear| {
        let is_possible = |particle| [particle, ParticleState::Unknown].contains(&linear.particle);
        let states = [ParticleState::Carried, ParticleState::Free];
        let rises = states.map(|particle| {
            let rise = |fit: Fit| fit.chi_square - alone.chi_square;
            is_possible(particle).then(|| with(MeasuredLinear { particle, ..*linear }).map_or(f64::INFINITY, rise))
        });
        let found = LinearVerdict { linear: *linear, rises };
        let particle = match found.agrees() {
            [true, false] => ParticleState::Carried,
            [false, true] => ParticleState::Free,
            _ => ParticleState::Unknown,
        };
        LinearVerdict { linear: MeasuredLinear { particle, ..*linear }, rises }
    };
    Ok(linear.iter().map(verdict).collect())
}

impl FromStr for Known {
    type Err = ArgumentError;

    fn from_str(text: &str) -> Result<Self, ArgumentError> {
        let symbols = Quantity::ALL.map(|quantity| quantity.symbol()[0]).join(", ");
        let form = || {
            format!("`{text}`: expected SYMBOL=VALUE±UNCERTAINTY, for instance m=0.032±0.0005, with one of {symbols}")
        };
        let (symbol, numbers) = text.split_once('=').ok_or_else(form)?;
        let quantity = Quantity::ALL
            .into_iter()
            .find(|quantity| quantity.symbol()[0] == symbol.trim())
            .ok_or_else(form)?;
        let (value, uncertainty) = numbers
            .split_once('±')
            .or(numbers.split_once("+-"))
            .unwrap_or((numbers, "0"));
        let number = |text: &str| text.trim().parse::<f64>().ok().filter(|number| number.is_finite());
        let (value, uncertainty) = number(value).zip(number(uncertainty)).ok_or_else(form)?;
        let may_be_0 = matches!(quantity, Quantity::Zeta | Quantity::Damping);
        if uncertainty < 0.0 || value < 0.0 || (value == 0.0 && !may_be_0) {
            return Err(format!("`{text}`: the value must be positive, and its uncertainty positive or 0").into());
        }
        Ok(Self::Value { quantity, estimate: Estimate { value, uncertainty } })
    }
}
