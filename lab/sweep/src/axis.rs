//! The axes of a sweep.

use std::fmt::{self, Display, Formatter};
use std::str::FromStr;

use phase_lock::Parameter;
use rand_chacha::{
    ChaCha8Rng,
    rand_core::{Rng, SeedableRng},
};

use vines_model::ArgumentError;

/// The detuning, which belongs to the drive and not to the scene.
pub const SIGMA: &str = "sigma";

/// Short names of two keys, as the axes of a map use them: the numbers of the theory, both dimensionless.
const SHORT: [(&str, &str); 2] = [("G", "excitation.G"), ("r", "plant.r")];

/// Values at equal distances.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Grid {
    /// First value.
    pub from: f64,
    /// Last value.
    pub to: f64,
    /// Number of values.
    pub points: u64,
}

impl Grid {
    /// The n-th value.
    #[must_use]
    pub fn at(&self, n: u64) -> f64 {
        self.from + self.step() * n as f64
    }

    /// Distance of two neighbouring values.
    #[must_use]
    pub fn step(&self) -> f64 {
        (self.to - self.from) / (self.points - 1) as f64
    }
}

/// Values of an axis.
#[derive(Debug, Clone, PartialEq)]
pub enum Values {
    /// At equal distances from the first to the last.
    Grid(Grid),
    /// As listed.
    List(Vec<f64>),
    /// As listed, one per sample: all such axes of a sweep belong together.
    Paired(Vec<f64>),
    /// Independent random numbers from an interval, one per sample.
    Random([f64; 2]),
}

/// A number of the scene, or [`SIGMA`], with its values. Parse it from `plant.r=0.3:1:71` (first : last : how many),
/// `plant.r=0.3,0.5,0.8`, `plant.r=paired:0.3,0.5,0.5` or `start.dq2=random:-1:1`.
#[derive(Debug, Clone, PartialEq)]
pub struct Axis {
    /// `section.key` of a scene, or `sigma`. In text, `G` and `r` stand for `excitation.G` and `plant.r`.
    pub name: String,
    /// Its values.
    pub values: Values,
}

impl Axis {
    /// An axis, checked.
    ///
    /// # Errors
    /// A value that is not finite, fewer than two values, a value twice, or an empty interval.
    pub fn new(name: &str, values: Values) -> Result<Self, ArgumentError> {
        let (numbers, points) = match &values {
            Values::Grid(Grid { from, to, points }) => (&[*from, *to][..], *points),
            Values::List(list) | Values::Paired(list) => (&list[..], list.len() as u64),
            Values::Random(interval) => (&interval[..], u64::MAX),
        };
        if let Some(value) = numbers.iter().find(|value| !value.is_finite()) {
            return Err(format!("{name} = {value} is not a finite number").into());
        }
        match (&values, numbers) {
            (_, []) => return Err(format!("{name} has no values; at least 2 are needed").into()),
            (_, [value, ..]) if points < 2 => return Err(constant(name, *value).into()),
            (Values::Grid(_) | Values::Random(_), [from, to]) if from >= to => {
                return Err(format!("{name} from {from} to {to}: the first must be below the last").into());
            }
            (Values::List(list), _) => {
                let mut sorted = list.clone();
                sorted.sort_by(f64::total_cmp);
                if let Some(pair) = sorted.windows(2).find(|pair| pair[0] == pair[1]) {
                    return Err(format!("{name} has the value {} twice", pair[0]).into());
                }
            }
            _ => {}
        }
        Ok(Self { name: name.into(), values })
    }

    /// Number of values along its own dimension; None if it has one value per sample.
    #[must_use]
    pub fn points(&self) -> Option<u64> {
        match &self.values {
            Values::Grid(grid) => Some(grid.points),
            Values::List(list) => Some(list.len() as u64),
            Values::Paired(_) | Values::Random(_) => None,
        }
    }

    /// The axis as text, with its short name.
    #[must_use]
    pub fn short_form(&self) -> String {
        let name = self.short_name().to_string();
        Self { name, values: self.values.clone() }.to_string()
    }

    /// The n-th value. Random axes have the same `seed`, and each a `stream` of its own.
    pub(crate) fn at(&self, n: u64, seed: u64, stream: u64) -> f64 {
        match &self.values {
            Values::Grid(grid) => grid.at(n),
            Values::List(list) | Values::Paired(list) => list[n as usize],
            Values::Random([from, to]) => {
                // One block of the generator per sample: any sample is found without those before it.
                let mut random = ChaCha8Rng::seed_from_u64(seed);
                random.set_stream(stream);
                random.set_word_pos(16 * u128::from(n));
                from + (to - from) * ((random.next_u64() >> 11) as f64 / 2_f64.powi(53))
            }
        }
    }

    /// The name as on a map: short where there is a short one.
    #[must_use]
    pub fn short_name(&self) -> &str {
        let short = SHORT.iter().find(|(_, key)| *key == self.name);
        short.map_or(&self.name, |(short, _)| short)
    }

    /// Unit: `1` for a count, and for what a scene states relative to omega0, b or a period.
    #[must_use]
    pub fn unit(&self) -> &'static str {
        match self.name.as_str() {
            "plant.M" | "plant.m" => "kg",
            "plant.k" => "N/m",
            "plant.c" => "N s/m",
            "plant.b" | "excitation.E" | "start.q1" | "start.q2" => "m",
            "start.dq1" | "start.dq2" => "m/s",
            "controller.phase_target" => "degree",
            "chain.snr" => "dB",
            name => {
                let parameter = name.strip_prefix("phase_lock.").and_then(Parameter::find);
                parameter.map_or(
                    "1",
                    |parameter| if parameter.unit.is_empty() { "1" } else { parameter.unit },
                )
            }
        }
    }
}

/// The message for an axis with one value: where a constant belongs.
fn constant(name: &str, value: f64) -> String {
    let place = match name.split_once('.') {
        Some((section, key)) => {
            format!("the scene: --set {name}={value}, in Python Scene({section}={{\"{key}\": {value}}})")
        }
        None => format!("the sweep: --{name}={value}, in Python {name}={value}"),
    };
    format!("{name} has one value; at least 2 are needed. A constant is a setting of {place}")
}

impl Display for Axis {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        write!(f, "{}=", self.name)?;
        let text = |list: &[f64]| list.iter().map(f64::to_string).collect::<Vec<_>>().join(",");
        match &self.values {
            Values::Grid(Grid { from, to, points }) => write!(f, "{from}:{to}:{points}"),
            Values::List(list) => f.write_str(&text(list)),
            Values::Paired(list) => write!(f, "paired:{}", text(list)),
            Values::Random([from, to]) => write!(f, "random:{from}:{to}"),
        }
    }
}

impl FromStr for Axis {
    type Err = ArgumentError;

    fn from_str(text: &str) -> Result<Self, ArgumentError> {
        let form = "expected KEY=FIRST:LAST:POINTS, KEY=VALUE,VALUE,..., KEY=paired:VALUE,VALUE,... or KEY=random:FIRST:LAST, \
                    for instance plant.r=0.3:1:71";
        let (name, values) = text.split_once('=').ok_or(form)?;
        let number = |text: &str| {
            let text = text.trim();
            text.parse::<f64>()
                .map_err(|_| ArgumentError::from(format!("`{text}` is not a number; {form}")))
        };
        let parts: Vec<&str> = values.split(':').collect();
        let listed = |list: &str| list.split(',').map(number).collect::<Result<Vec<_>, _>>();
        let values = match parts[..] {
            ["paired", list] => Values::Paired(listed(list)?),
            ["random", from, to] => Values::Random([number(from)?, number(to)?]),
            [from, to, points] => Values::Grid(Grid {
                from: number(from)?,
                to: number(to)?,
                points: points
                    .trim()
                    .parse()
                    .map_err(|_| format!("`{points}` is not a number of points; {form}"))?,
            }),
            [list] => Values::List(listed(list)?),
            _ => return Err(form.into()),
        };
        let name = name.trim();
        let key = SHORT.iter().find(|(short, _)| *short == name);
        Self::new(key.map_or(name, |(_, key)| key), values)
    }
}
