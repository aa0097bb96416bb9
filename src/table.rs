//! The parameters of the plant as users set them: one table.
//!
//! To add a parameter, add a field to [`Parameters`] or [`Cavity`] with its effect, and a row here. From the row follow the
//! check of its range, the variable in `modelDescription.xml`, the key in `[plant]` of a scene, the argument in Python, and the row in
//! docs/plant-parameters.md. Files are compared with the table by tests; `UPDATE=1 cargo test -p lovines-fmu --test table` writes them.

use core::f64::consts::FRAC_PI_2;

use crate::parameters::{Cavity, FASTEST, InvalidValue, Parameters, Restitution};

/// Numbers that a parameter may have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Range {
    /// Above 0.
    Positive,
    /// 0 or above.
    NotNegative,
    /// Above 0, at most 1.
    Ratio,
    /// 0 to 1.
    Share,
    /// A coefficient of friction.
    Friction,
    /// Up to a right angle, either way.
    Tilt,
    /// The code of a law of restitution: its place in [`LAWS`].
    Law,
    /// A whole number of 31 bits.
    Whole,
}

impl Range {
    /// The least and the largest number.
    pub fn bounds(self) -> [f64; 2] {
        match self {
            Self::Positive => [1e-100, 1e100],
            Self::NotNegative => [0.0, 1e100],
            Self::Ratio => [f64::MIN_POSITIVE, 1.0],
            Self::Share => [0.0, 1.0],
            Self::Friction => [0.0, 100.0],
            Self::Tilt => [-FRAC_PI_2, FRAC_PI_2],
            Self::Law => [0.0, (LAWS.len() - 1) as f64],
            Self::Whole => [0.0, 2_147_483_647.0],
        }
    }

    /// The same in words.
    pub fn allowed(self) -> &'static str {
        match self {
            Self::Positive => "a number from 1e-100 to 1e100",
            Self::NotNegative => "a number from 0 to 1e100",
            Self::Ratio => "a number above 0 and at most 1",
            Self::Share => "a number from 0 to 1",
            Self::Friction => "a number from 0 to 100",
            Self::Tilt => "a number from -pi/2 to pi/2",
            Self::Law => "0 (constant), 1 (viscoelastic) or 2 (plastic)",
            Self::Whole => "a whole number from 0 to 2147483647",
        }
    }

    /// Whether it has whole numbers only.
    pub fn is_whole(self) -> bool {
        matches!(self, Self::Law | Self::Whole)
    }
}

/// Laws of restitution, by their codes.
pub const LAWS: [&str; 3] = ["constant", "viscoelastic", "plastic"];

/// Where the physics keeps a parameter.
#[derive(Clone, Copy, Debug)]
enum Place {
    Always(fn(&mut Parameters) -> &mut f64),
    Optional(fn(&mut Parameters) -> &mut Option<f64>),
    Law,
    /// Parameter of the law at a wall: 0 or 1.
    OfLaw(usize),
    Seed,
}

/// A parameter of the plant.
#[derive(Clone, Copy, Debug)]
pub struct Parameter {
    /// Its name: the FMU's variable, the key of a scene, the argument in Python.
    pub symbol: &'static str,
    /// Symbol and meaning, for messages.
    title: &'static str,
    /// What it is.
    pub meaning: &'static str,
    /// Unit; empty for a pure number, and where it depends on the law.
    pub unit: &'static str,
    /// What is allowed.
    pub range: Range,
    /// The value of the default rig; 0 where it stands for `default`.
    pub start: f64,
    /// What holds where it is not given; `None` for one that must be given.
    pub default: Option<&'static str>,
    /// Whether it may change while the plant moves.
    pub tunable: bool,
    place: Place,
}

impl Parameter {
    /// Whether 0 stands for its default where numbers cannot be absent, as in an FMU.
    pub fn has_zero_for_default(&self) -> bool {
        matches!(self.place, Place::Optional(_) | Place::OfLaw(_))
    }

    /// Refuses a number that is not allowed whatever the other parameters are.
    ///
    /// # Errors
    /// The number, with its unit and the allowed range.
    pub fn check(&self, value: f64) -> Result<(), InvalidValue> {
        let [low, high] = self.range.bounds();
        let whole = !self.range.is_whole() || libm::trunc(value) == value;
        let valid = (low..=high).contains(&value) && whole;
        InvalidValue::unless(valid, self.title, value, self.unit, self.range.allowed())
    }
}

macro_rules! table {
    ($($symbol:literal ($title:literal, $meaning:literal) $unit:literal $range:ident $start:literal $default:expr, $tunable:literal, $place:expr;)*) => {
        /// All parameters.
        pub static PARAMETERS: [Parameter; [$($symbol),*].len()] = [$(Parameter {
            symbol: $symbol,
            title: concat!($symbol, " (", $title, ")"),
            meaning: $meaning,
            unit: $unit,
            range: Range::$range,
            start: $start,
            default: $default,
            tunable: $tunable,
            place: $place,
        }),*];
    };
}

table! {
    "M" ("primary mass", "primary mass")
        "kg" Positive 3.807 None, false, Place::Always(|p| &mut p.primary_mass);
    "k" ("stiffness", "stiffness of the spring between base and primary mass, above 0")
        "N/m" Positive 11680.0 None, true, Place::Always(|p| &mut p.stiffness);
    "c" ("damping", "viscous damping between base and primary mass, 0 or above, also beyond critical")
        "N.s/m" NotNegative 2.53 None, true, Place::Always(|p| &mut p.damping);
    "m" ("particle mass", "mass of the particle")
        "kg" Positive 0.032 None, false, Place::Always(|p| &mut p.particle_mass);
    "b" ("half-width of the cavity", "half-width of the cavity, above 0: the particle flies freely while |q1 - q2| is below b")
        "m" Positive 0.01 None, false, Place::Always(|p| &mut p.half_width);
    "r" ("coefficient of restitution", "coefficient of restitution of an impact, above 0 and at most 1: speed of separation over speed of approach")
        "" Ratio 0.65 None, true, Place::Always(|p| &mut p.restitution);
    "b_plus" ("gap to the wall w = b_plus", "gap to the wall at q1 - q2 = b_plus")
        "m" Positive 0.0 Some("b"), false, Place::Optional(|p| &mut p.cavity.b_plus);
    "b_minus" ("gap to the wall w = -b_minus", "gap to the wall at q1 - q2 = -b_minus")
        "m" Positive 0.0 Some("b"), false, Place::Optional(|p| &mut p.cavity.b_minus);
    "theta" ("tilt", "tilt of the axis: gravity accelerates the particle by 9.80665 sin(theta) m/s2 towards positive q2; q1 is measured from the equilibrium without the particle")
        "rad" Tilt 0.0 Some("0"), true, Place::Always(|p| &mut p.cavity.tilt);
    "mu_k" ("kinetic friction", "coefficient of kinetic friction between particle and floor of the cavity; 0 is no friction")
        "" Friction 0.0 Some("0"), true, Place::Always(|p| &mut p.cavity.kinetic_friction);
    "mu_s" ("static friction", "coefficient of static friction, at least mu_k")
        "" Friction 0.0 Some("mu_k"), true, Place::Optional(|p| &mut p.cavity.static_friction);
    "r_law" ("law of restitution", "law of restitution: 0 constant r, 1 viscoelastic r = 1 - k v^(1/5), 2 plastic r = min(1, (v/v_y)^(-1/4)), with the speed of approach v in m/s")
        "" Law 0.0 Some("constant"), false, Place::Law;
    "r_plus" ("restitution at the wall w = b_plus", "parameter of the law at the wall q1 - q2 = b_plus: r, k in (s/m)^(1/5), or v_y in m/s")
        "" NotNegative 0.0 Some("r"), true, Place::OfLaw(0);
    "r_minus" ("restitution at the wall w = -b_minus", "parameter of the law at the wall q1 - q2 = -b_minus")
        "" NotNegative 0.0 Some("r_plus"), true, Place::OfLaw(1);
    "r_min" ("least coefficient of restitution", "least coefficient of restitution")
        "" Share 0.0 Some("0"), true, Place::Always(|p| &mut p.cavity.least_restitution);
    "r_scatter" ("scatter of the restitution", "relative standard deviation of the coefficient of restitution from impact to impact")
        "" Share 0.0 Some("0"), true, Place::Always(|p| &mut p.cavity.scatter);
    "seed" ("seed of the scatter", "seed of the scatter: coefficient number n depends on seed and n alone")
        "" Whole 0.0 Some("0"), false, Place::Seed;
}

/// Number of parameters.
pub const COUNT: usize = PARAMETERS.len();

/// A number for every row of [`PARAMETERS`], or none for its default.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Values(pub [Option<f64>; COUNT]);

impl Values {
    /// The place of a parameter in the table.
    pub fn place(symbol: &str) -> Option<usize> {
        PARAMETERS.iter().position(|parameter| parameter.symbol == symbol)
    }

    /// The rows that are given, with their numbers.
    pub fn given(&self) -> impl Iterator<Item = (&'static Parameter, f64)> {
        PARAMETERS
            .iter()
            .zip(self.0)
            .filter_map(|(row, value)| Some((row, value?)))
    }

    /// The parameters as the physics has them, not checked; one that must be given and is not is 0.
    pub fn parameters(&self) -> Parameters {
        let mut p = Parameters {
            primary_mass: 0.0,
            stiffness: 0.0,
            damping: 0.0,
            particle_mass: 0.0,
            half_width: 0.0,
            restitution: 0.0,
            cavity: Cavity::IDEAL,
        };
        let (mut law, mut walls) = (0.0, [None; 2]);
        for (row, value) in self.given() {
            match row.place {
                Place::Always(place) => *place(&mut p) = value,
                Place::Optional(place) => *place(&mut p) = Some(value),
                Place::Law => law = value,
                Place::OfLaw(wall) => walls[wall] = Some(value),
                Place::Seed => p.cavity.seed = value as u64,
            }
        }
        p.cavity.restitution = [walls[0], walls[1].or(walls[0])].map(|value| match law {
            1.0 => Some(Restitution::Viscoelastic(value.unwrap_or_default())),
            2.0 => Some(Restitution::Plastic(value.unwrap_or_default())),
            _ => value.map(Restitution::Constant),
        });
        p
    }
}

impl From<&Parameters> for Values {
    /// Of two laws it has that of the first wall.
    fn from(p: &Parameters) -> Self {
        let mut p = *p;
        let walls = p.cavity.restitution.map(|law| law.map(code));
        let law = walls[0].or(walls[1]).map_or(0.0, |(law, _)| law);
        Self(PARAMETERS.each_ref().map(|row| match row.place {
            Place::Always(place) => Some(*place(&mut p)),
            Place::Optional(place) => *place(&mut p),
            Place::Law => Some(law),
            Place::OfLaw(wall) => walls[wall].map(|(_, value)| value),
            Place::Seed => Some(p.cavity.seed as f64),
        }))
    }
}

/// The code of a law, and its parameter.
fn code(law: Restitution) -> (f64, f64) {
    match law {
        Restitution::Constant(r) => (0.0, r),
        Restitution::Viscoelastic(k) => (1.0, k),
        Restitution::Plastic(speed) => (2.0, speed),
    }
}

/// Refuses the first number that is out of its range. The seed of the physics is any number of 64 bits.
pub(crate) fn check(p: &Parameters) -> Result<(), InvalidValue> {
    let values = Values::from(p);
    let mut given = values.given().filter(|(row, _)| !matches!(row.place, Place::Seed));
    given.try_for_each(|(row, value)| row.check(value))
}

impl Parameters {
    /// Checks every value and the rates that follow from them.
    ///
    /// # Errors
    /// The first invalid value, with its unit and the allowed range.
    pub fn validate(&self) -> Result<(), InvalidValue> {
        check(self)?;
        let rate = |name, value: f64, least, allowed| {
            InvalidValue::unless((least..=FASTEST).contains(&value), name, value, "rad/s", allowed)
        };
        let name = "sqrt(k/M) (natural frequency)";
        rate(name, self.natural_frequency(), 1e-12, "a number from 1e-12 to 1e12")?;
        rate(
            "c/M (decay rate)",
            self.damping / self.primary_mass,
            0.0,
            "at most 1e12 rad/s",
        )?;
        self.cavity.validate()
    }
}

impl Restitution {
    /// Refuses a parameter that is not allowed for this law.
    fn validate(self) -> Result<(), InvalidValue> {
        let (name, value, unit, range) = match self {
            Self::Constant(r) => ("r of a wall (coefficient of restitution)", r, "", Range::Ratio),
            Self::Viscoelastic(k) => (
                "k of a wall (viscoelastic restitution)",
                k,
                "(s/m)^(1/5)",
                Range::NotNegative,
            ),
            Self::Plastic(v) => ("v_y of a wall (yield speed)", v, "m/s", Range::Positive),
        };
        let [low, high] = range.bounds();
        InvalidValue::unless((low..=high).contains(&value), name, value, unit, range.allowed())
    }
}

impl Cavity {
    /// Refuses values that contradict each other.
    fn validate(&self) -> Result<(), InvalidValue> {
        let mu = self.kinetic_friction;
        let (held, allowed) = (self.static_friction.unwrap_or(mu), "a number from mu_k to 100");
        InvalidValue::unless(held >= mu, "mu_s (static friction)", held, "", allowed)?;
        self.restitution
            .into_iter()
            .flatten()
            .try_for_each(Restitution::validate)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_numbers_of_the_table_and_the_parameters_of_the_physics_say_the_same() {
        for law in 0..LAWS.len() {
            let mut n = 0.0;
            let values = Values(PARAMETERS.each_ref().map(|row| {
                n += 0.01;
                Some(match row.range {
                    Range::Law => law as f64,
                    Range::Whole => 7.0,
                    _ => n,
                })
            }));
            let p = values.parameters();
            assert_eq!(Values::from(&p), values);
            p.validate().unwrap();
        }
        let given: Vec<_> = Values::from(&Parameters::dimensionless(0.01, 1.0, 0.5))
            .given()
            .collect();
        let absent = |row: &&Parameter| !given.iter().any(|(given, _)| given.symbol == row.symbol);
        assert!(PARAMETERS.iter().filter(absent).all(Parameter::has_zero_for_default));
    }

    #[test]
    fn every_row_refuses_what_is_beyond_its_bounds_and_names_itself() {
        for row in &PARAMETERS {
            let [low, high] = row.range.bounds();
            row.check(low).and(row.check(high)).unwrap();
            for beyond in [low - 1e-90, 2.0 * high + 1.0, f64::NAN] {
                if let Err(error) = row.check(beyond) {
                    assert!(error.to_string().starts_with(row.symbol));
                } else {
                    assert!(low.abs() >= 1.0, "{} = {beyond}", row.symbol);
                }
            }
        }
    }
}
