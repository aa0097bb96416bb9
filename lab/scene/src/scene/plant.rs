//! The sections `[plant]`, in SI units or dimensionless, `[start]` and `[excitation]`.

use std::fmt;
use std::sync::LazyLock;

use lovines::table::{self, LAWS, PARAMETERS, Parameter, Values};
use lovines::{Parameters, State};
use serde::de::{Error, MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serializer};
use vines_model::Dimensionless;

use super::checks::{Range, Row};
use super::shaker::ShakerSection;
use super::{Reference, SceneError, Structure, Unit};

/// The section as written: rows of the plant's table, or dimensionless numbers.
#[derive(Debug, Clone, Default)]
pub(super) struct PlantSection {
    values: Values,
    epsilon: Option<f64>,
    lambda: Option<f64>,
}

/// Keys of the section: the symbols of the table, and these two after them.
static PLANT_KEYS: LazyLock<Vec<&str>> = LazyLock::new(|| {
    let symbols = PARAMETERS.iter().map(|row| row.symbol);
    symbols.chain(["epsilon", "lambda"]).collect()
});

/// The place of a key in [`PLANT_KEYS`].
struct PlantKey(usize);

impl<'de> Deserialize<'de> for PlantKey {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        let key = String::deserialize(from)?;
        let place = PLANT_KEYS.iter().position(|known| *known == key);
        place
            .map(Self)
            .ok_or_else(|| D::Error::unknown_field(&key, &PLANT_KEYS))
    }
}

impl<'de> Deserialize<'de> for PlantSection {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        struct Section;

        impl<'de> Visitor<'de> for Section {
            type Value = PlantSection;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a map")
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<PlantSection, A::Error> {
                let mut section = PlantSection::default();
                while let Some(PlantKey(n)) = map.next_key()? {
                    let row = PARAMETERS.get(n);
                    let value = match row.map(|row| row.range) {
                        Some(table::Range::Law) => law(&map.next_value::<String>()?)?,
                        Some(table::Range::Whole) => map.next_value::<u32>()?.into(),
                        _ => map.next_value()?,
                    };
                    *match n.checked_sub(PARAMETERS.len()) {
                        None => &mut section.values.0[n],
                        Some(0) => &mut section.epsilon,
                        Some(_) => &mut section.lambda,
                    } = Some(value);
                }
                Ok(section)
            }
        }

        from.deserialize_map(Section)
    }
}

/// The code of a law of restitution.
fn law<E: Error>(word: &str) -> Result<f64, E> {
    let code = LAWS.iter().position(|law| *law == word);
    code.map(|code| code as f64)
        .ok_or_else(|| E::unknown_variant(word, &LAWS))
}

impl PlantSection {
    /// Whether the plant is in SI units. Of two sets of units, one would silently be ignored.
    pub(super) fn is_si(&self) -> Result<bool, &'static str> {
        let is_si = ["M", "k", "c", "m", "b"]
            .iter()
            .any(|symbol| self.get(symbol).is_some());
        if is_si && (self.epsilon.is_some() || self.lambda.is_some()) {
            return Err(
                "[plant] mixes SI keys (M, k, c, m, b) with dimensionless ones (epsilon, lambda): \
                 give one set or the other, and r (epsilon = m/M, lambda = c/(m omega0))",
            );
        }
        Ok(is_si)
    }

    /// The number under a symbol of the table.
    fn get(&self, symbol: &str) -> Option<f64> {
        self.values.0[Values::place(symbol)?]
    }

    /// The oscillator as a structure with one mode, on the table of a shaker or driven by its force.
    pub(super) fn take_oscillator(&mut self, origin: &str, shaker: &ShakerSection) -> Result<Structure, SceneError> {
        let excitation = shaker.table_mass.map_or(Reference::Force, |_| Reference::Base);
        let mut numbers = [0.0; 3];
        for (number, symbol) in numbers.iter_mut().zip(["M", "k", "c"]) {
            let place = Values::place(symbol);
            *number = place.and_then(|place| self.values.0[place].take()).ok_or_else(|| {
                let message = format!(
                    "[shaker] with a [plant] without `{symbol}`: give M, k and c in SI units, or a [structure]"
                );
                SceneError::text(origin, message)
            })?;
        }
        let [mass, stiffness, damping] = numbers;
        Row::new("plant.M", mass, "kg", Range::Positive).check()?;
        Row::new("plant.k", stiffness, "N/m", Range::Positive).check()?;
        Row::new("plant.c", damping, "N s/m", Range::NotNegative).check()?;
        Structure::of_oscillator(numbers, excitation)
    }

    /// The section with the oscillator of a structure's driven mode.
    pub(super) fn of_structure(mut self, origin: &str, structure: &Structure) -> Result<Self, SceneError> {
        if let Some(key) = ["M", "k", "c"].into_iter().find(|key| self.get(key).is_some()) {
            let message =
                format!("[plant] has `{key}` beside [structure], which takes the place of M, k and c: drop it");
            return Err(SceneError::text(origin, message));
        }
        let mode = structure.mode();
        let mass = structure.at_cavity(mode).powi(-2);
        for (symbol, value) in [
            ("M", mass),
            ("k", mass * mode.omega * mode.omega),
            ("c", 2.0 * mode.zeta * mode.omega * mass),
        ] {
            if let Some(place) = Values::place(symbol) {
                self.values.0[place] = Some(value);
            }
        }
        Ok(self)
    }

    pub(super) fn resolve(&self, origin: &str) -> Result<Parameters, SceneError> {
        let keys = |message: &str| SceneError::text(origin, message);
        let is_si = self.is_si().map_err(keys)?;
        let need = |value: Option<f64>, key: &str| {
            value.ok_or_else(|| {
                keys(&format!(
                    "[plant] has no `{key}`: give M, k, c, m, b and r (SI), or epsilon, lambda and r (dimensionless)"
                ))
            })
        };
        if self.get("r_law").is_some_and(|law| law != 0.0) && self.get("r_plus").is_none() {
            return Err(keys(
                "[plant] has an `r_law` without its parameter: give r_plus, which is k in (s/m)^(1/5) of \"viscoelastic\", or the yield speed in \
                 m/s of \"plastic\"",
            ));
        }
        for (row, value) in self.values.given() {
            row.check(value)?;
        }
        let mut plant = self.values.parameters();
        if is_si {
            for row in PARAMETERS.iter().filter(|row| row.default.is_none()) {
                need(self.get(row.symbol), row.symbol)?;
            }
        } else {
            let (epsilon, lambda) = (need(self.epsilon, "epsilon")?, need(self.lambda, "lambda")?);
            Row::new("plant.epsilon", epsilon, "(dimensionless)", Range::Positive).check()?;
            Row::new("plant.lambda", lambda, "(dimensionless)", Range::NotNegative).check()?;
            plant = Parameters {
                cavity: plant.cavity,
                ..Parameters::dimensionless(epsilon, lambda, need(self.get("r"), "r")?)
            };
        }
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
    /// The state, once a plant takes it; of a structure, only the particle moves.
    pub(super) fn resolve(
        &self,
        origin: &str,
        plant: &Parameters,
        structure: Option<&Structure>,
    ) -> Result<State, SceneError> {
        let Self { q1, dq1, q2, dq2 } = *self;
        if structure.is_some() && (q1 != 0.0 || dq1 != 0.0) {
            let message = "[start] has q1 or dq1: a structure starts at rest; give q2 and dq2 of the particle only";
            return Err(SceneError::text(origin, message));
        }
        let start = State { q1, dq1, q2, dq2 };
        lovines::Plant::new(*plant, start)?;
        Ok(start)
    }
}

/// The rows of the plant's table with their numbers; of the cavity those that are not ideal.
pub(super) fn given(plant: &Parameters) -> Vec<(&'static Parameter, f64)> {
    let values = Values::from(plant);
    let given = values
        .given()
        .filter(|(row, value)| row.default.is_none() || *value != 0.0);
    given.collect()
}

/// The parameters under their symbols, as a scene in SI units has them.
fn symbols(plant: &Parameters) -> Vec<(&'static str, toml::Value)> {
    let value = |(row, value): (&'static Parameter, f64)| {
        let value = match row.range {
            table::Range::Law => LAWS[value as usize].into(),
            table::Range::Whole => (value as i64).into(),
            _ => value.into(),
        };
        (row.symbol, value)
    };
    given(plant).into_iter().map(value).collect()
}

/// The keys of the section `[plant]` and their values, as a scene in SI units has them.
pub fn plant_keys(plant: &Parameters) -> Vec<(&'static str, String)> {
    let keys = symbols(plant).into_iter().map(|(symbol, value)| match value {
        toml::Value::Float(number) => (symbol, format!("{number:?}")),
        toml::Value::Integer(number) => (symbol, number.to_string()),
        text => (symbol, format!("{:?}", text.as_str().unwrap_or_default())),
    });
    keys.collect()
}

/// Writes the parameters under their symbols, as a scene has them.
pub(super) fn serialize<S: Serializer>(plant: &Parameters, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_map(symbols(plant))
}

/// The amplitude of the drive; exactly one of the keys is given.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ExcitationSection {
    #[serde(rename = "G")]
    g: Option<f64>,
    #[serde(rename = "E")]
    e: Option<f64>,
    #[serde(rename = "F")]
    f: Option<f64>,
}

impl ExcitationSection {
    /// Amplitude E of the base displacement, m, that moves the oscillator of `plant` alike.
    pub(super) fn in_metres(
        &self,
        origin: &str,
        d: &Dimensionless,
        structure: Option<&Structure>,
    ) -> Result<f64, SceneError> {
        let (excitation, unit) = structure.map_or((Reference::Base, Unit::METRE), |structure| {
            (structure.excitation, structure.units().reference)
        });
        let key = match excitation {
            Reference::Base => "E (m)",
            Reference::Force => "F (N)",
        };
        let (row, amplitude) = match (self.g, self.e, self.f, excitation) {
            (Some(g), None, None, _) => (("excitation.G", g, "(dimensionless)"), d.amplitude(g)),
            (None, Some(e), None, Reference::Base) => (("excitation.E", e, "m"), unit.in_metres(e)),
            (None, None, Some(f), Reference::Force) => (("excitation.F", f, "N"), unit.in_metres(f)),
            (g, e, f, _) => {
                let given = [("G", g), ("E", e), ("F", f)]
                    .into_iter()
                    .filter(|(_, value)| value.is_some());
                let given: Vec<&str> = given.map(|(name, _)| name).collect();
                let given = if given.is_empty() {
                    "no key".into()
                } else {
                    given.join(" and ")
                };
                let message = format!(
                    "[excitation] has {given}: give either G (dimensionless), which is E/(b epsilon), or {key}; E belongs to a base, F to a structure \
                     with excitation = \"force\""
                );
                return Err(SceneError::text(origin, message));
            }
        };
        let (key, value, unit) = row;
        Row::new(key, value, unit, Range::NotNegative).check()?;
        Ok(amplitude)
    }
}
