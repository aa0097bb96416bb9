//! The `[plant]` section: SI parameters, or their dimensionless stand-ins.

use std::f64::consts::TAU;

use serde::{Deserialize, Serialize};

use super::{SceneError, validate::Quantity};

/// Keys that only the SI form has.
pub(super) const SI_KEYS: [&str; 5] = ["M", "k", "c", "m", "b"];
/// Keys that only the dimensionless form has.
pub(super) const DIMENSIONLESS_KEYS: [&str; 2] = ["epsilon", "lambda"];

/// The linear oscillator and the particle in its cavity, SI units.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Plant {
    /// Primary mass M, kg.
    #[serde(rename = "M")]
    pub mass: f64,
    /// Spring k, N/m.
    #[serde(rename = "k")]
    pub stiffness: f64,
    /// Damper c, N s/m.
    #[serde(rename = "c")]
    pub damping: f64,
    /// Particle m, kg.
    #[serde(rename = "m")]
    pub particle_mass: f64,
    /// Half-width b of the cavity, m.
    #[serde(rename = "b")]
    pub half_width: f64,
    /// Restitution coefficient r, in (0, 1].
    #[serde(rename = "r")]
    pub restitution: f64,
}

impl Plant {
    /// Natural angular frequency `sqrt(k/M)` of the oscillator alone, rad/s.
    #[must_use]
    pub fn omega0(&self) -> f64 {
        (self.stiffness / self.mass).sqrt()
    }

    /// Natural period `2 pi/omega0`, s.
    #[must_use]
    pub fn natural_period(&self) -> f64 {
        TAU / self.omega0()
    }

    /// Mass ratio `m/M`.
    #[must_use]
    pub fn epsilon(&self) -> f64 {
        self.particle_mass / self.mass
    }

    /// Dimensionless damping `c/(m omega0)`.
    #[must_use]
    pub fn lambda(&self) -> f64 {
        self.damping / (self.particle_mass * self.omega0())
    }

    /// The SI plant that is its own dimensionless model.
    fn from_dimensionless(epsilon: f64, lambda: f64, r: f64) -> Self {
        Self {
            mass: 1.0,
            stiffness: 1.0,
            damping: epsilon * lambda,
            particle_mass: epsilon,
            half_width: 1.0,
            restitution: r,
        }
    }

    fn check(&self) -> Result<(), SceneError> {
        Quantity::new("plant.M", self.mass, "kg").positive()?;
        Quantity::new("plant.k", self.stiffness, "N/m").positive()?;
        Quantity::new("plant.c", self.damping, "N s/m").not_negative()?;
        Quantity::new("plant.m", self.particle_mass, "kg").positive()?;
        Quantity::new("plant.b", self.half_width, "m").positive()?;
        check_restitution(self.restitution)
    }
}

fn check_restitution(r: f64) -> Result<(), SceneError> {
    let allowed = "must be above 0 and at most 1";
    Quantity::new("plant.r", r, "(dimensionless)").check(r > 0.0 && r <= 1.0, allowed)
}

/// The section as written.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawPlant {
    #[serde(rename = "M")]
    mass: Option<f64>,
    k: Option<f64>,
    c: Option<f64>,
    m: Option<f64>,
    b: Option<f64>,
    r: Option<f64>,
    epsilon: Option<f64>,
    lambda: Option<f64>,
}

impl RawPlant {
    pub(super) fn resolve(&self, origin: &str) -> Result<Plant, SceneError> {
        let keys = |message: String| SceneError::Keys {
            origin: origin.into(),
            message,
        };
        let si = [self.mass, self.k, self.c, self.m, self.b];
        let dimensionless = [self.epsilon, self.lambda];
        let is_si = si.iter().any(Option::is_some);
        if is_si && dimensionless.iter().any(Option::is_some) {
            return Err(keys(
                "[plant] mixes SI keys (M, k, c, m, b) with dimensionless ones (epsilon, lambda): \
                 give one set or the other, and r"
                    .into(),
            ));
        }
        let missing = |key: &str| {
            keys(format!(
                "[plant] has no `{key}`: give M, k, c, m, b and r (SI), or epsilon, lambda and r (dimensionless)"
            ))
        };
        let need = |value: Option<f64>, key: &str| value.ok_or_else(|| missing(key));
        if is_si {
            let plant = Plant {
                mass: need(self.mass, "M")?,
                stiffness: need(self.k, "k")?,
                damping: need(self.c, "c")?,
                particle_mass: need(self.m, "m")?,
                half_width: need(self.b, "b")?,
                restitution: need(self.r, "r")?,
            };
            plant.check()?;
            return Ok(plant);
        }
        let epsilon = need(self.epsilon, "epsilon")?;
        let lambda = need(self.lambda, "lambda")?;
        let r = need(self.r, "r")?;
        Quantity::new("plant.epsilon", epsilon, "(dimensionless)").positive()?;
        Quantity::new("plant.lambda", lambda, "(dimensionless)").not_negative()?;
        check_restitution(r)?;
        Ok(Plant::from_dimensionless(epsilon, lambda, r))
    }
}
