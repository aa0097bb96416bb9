//! The `[plant]` section, in SI units or dimensionless, and the `[start]` section.

use lovines::{Parameters, State};
use serde::{Deserialize, Serializer, ser::SerializeMap};

use super::{SceneError, validate::Quantity};

/// Keys that only the SI form has.
pub(super) const SI_KEYS: [&str; 5] = ["M", "k", "c", "m", "b"];
/// Keys that only the dimensionless form has.
pub(super) const DIMENSIONLESS_KEYS: [&str; 2] = ["epsilon", "lambda"];

/// The section as written.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PlantSection {
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

impl PlantSection {
    pub(super) fn resolve(&self, origin: &str) -> Result<Parameters, SceneError> {
        let keys = |message: &str| SceneError::Keys { origin: origin.into(), message: message.into() };
        let si = [self.mass, self.k, self.c, self.m, self.b];
        let dimensionless = [self.epsilon, self.lambda];
        let is_si = si.iter().any(Option::is_some);
        if is_si && dimensionless.iter().any(Option::is_some) {
            return Err(keys(
                "[plant] mixes SI keys (M, k, c, m, b) with dimensionless ones (epsilon, lambda): \
                 give one set or the other, and r",
            ));
        }
        let need = |value: Option<f64>, key: &str| {
            value.ok_or_else(|| {
                keys(&format!(
                    "[plant] has no `{key}`: give M, k, c, m, b and r (SI), or epsilon, lambda and r (dimensionless)"
                ))
            })
        };
        let plant = if is_si {
            Parameters {
                primary_mass: need(self.mass, "M")?,
                stiffness: need(self.k, "k")?,
                damping: need(self.c, "c")?,
                particle_mass: need(self.m, "m")?,
                half_width: need(self.b, "b")?,
                restitution: need(self.r, "r")?,
                cavity: lovines::Cavity::IDEAL,
            }
        } else {
            let (epsilon, lambda) = (need(self.epsilon, "epsilon")?, need(self.lambda, "lambda")?);
            Quantity::new("plant.epsilon", epsilon, "(dimensionless)").positive()?;
            Quantity::new("plant.lambda", lambda, "(dimensionless)").not_negative()?;
            Parameters::dimensionless(epsilon, lambda, need(self.r, "r")?)
        };
        plant.validate()?;
        Ok(plant)
    }
}

/// The `[start]` section; what is left out is zero.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct StartSection {
    q1: f64,
    dq1: f64,
    q2: f64,
    dq2: f64,
}

impl StartSection {
    /// The state, once a plant takes it.
    pub(super) fn resolve(&self, plant: &Parameters) -> Result<State, SceneError> {
        let Self { q1, dq1, q2, dq2 } = *self;
        let start = State { q1, dq1, q2, dq2 };
        lovines::Plant::new(*plant, start)?;
        Ok(start)
    }
}

/// The parameters under their symbols, which are the names of the FMU's variables.
pub(super) fn symbols(plant: &Parameters) -> [(&'static str, f64); 6] {
    [
        ("M", plant.primary_mass),
        ("k", plant.stiffness),
        ("c", plant.damping),
        ("m", plant.particle_mass),
        ("b", plant.half_width),
        ("r", plant.restitution),
    ]
}

/// Writes the parameters under their symbols.
pub(super) fn serialize<S: Serializer>(plant: &Parameters, serializer: S) -> Result<S::Ok, S::Error> {
    let mut map = serializer.serialize_map(Some(6))?;
    for (symbol, value) in symbols(plant) {
        map.serialize_entry(symbol, &value)?;
    }
    map.end()
}
