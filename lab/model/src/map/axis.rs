//! The axes of a map.

use std::fmt::{self, Display, Formatter};
use std::str::FromStr;

use serde::Serialize;

use crate::ArgumentError;

/// Quantity of an axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub enum Axis {
    /// Detuning.
    #[serde(rename = "sigma")]
    Sigma,
    /// Base amplitude over `b epsilon`.
    G,
    /// Restitution coefficient.
    #[serde(rename = "r")]
    R,
}

impl Display for Axis {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Axis::Sigma => "sigma",
            Axis::G => "G",
            Axis::R => "r",
        })
    }
}

/// An axis with the values it takes; parse it from `sigma=-4:4:81` (first : last : how many).
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Range {
    /// Its quantity.
    pub axis: Axis,
    /// First value.
    pub from: f64,
    /// Last value.
    pub to: f64,
    /// Number of values, at equal distances.
    pub points: usize,
}

/// Most points of an axis.
const MOST: usize = 2000;

impl Range {
    /// The n-th value.
    #[must_use]
    pub fn at(&self, n: usize) -> f64 {
        self.from + self.step() * n as f64
    }

    /// Distance of two values.
    #[must_use]
    pub fn step(&self) -> f64 {
        (self.to - self.from) / (self.points - 1) as f64
    }
}

impl Display for Range {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let Range { axis, from, to, points } = self;
        write!(f, "{axis}={from}:{to}:{points}")
    }
}

impl FromStr for Range {
    type Err = ArgumentError;

    fn from_str(text: &str) -> Result<Self, ArgumentError> {
        let form = "expected AXIS=FIRST:LAST:POINTS with the axis sigma, G or r, for instance sigma=-4:4:81";
        let (name, values) = text.split_once('=').ok_or(form)?;
        let axis = match name.trim() {
            "sigma" => Axis::Sigma,
            "G" => Axis::G,
            "r" => Axis::R,
            _ => return Err(form.into()),
        };
        let values: Vec<&str> = values.split(':').map(str::trim).collect();
        let [from, to, points] = values[..] else {
            return Err(form.into());
        };
        let number = |text: &str| {
            text.parse::<f64>()
                .ok()
                .filter(|value| value.is_finite())
                .ok_or_else(|| format!("`{text}` is not a finite number; {form}"))
        };
        let (from, to) = (number(from)?, number(to)?);
        let points = points
            .parse()
            .ok()
            .filter(|points| (2..=MOST).contains(points))
            .ok_or_else(|| format!("`{points}` is not a number of points from 2 to {MOST}"))?;
        if from >= to {
            return Err(format!("{axis} from {from} to {to}: the first must be below the last").into());
        }
        let allowed = match axis {
            Axis::Sigma => None,
            Axis::G => (from < 0.0).then_some("at least 0"),
            Axis::R => (from <= 0.0 || to > 1.0).then_some("above 0 and at most 1"),
        };
        match allowed {
            Some(allowed) => Err(format!("{axis} from {from} to {to} (dimensionless): must be {allowed}").into()),
            None => Ok(Self { axis, from, to, points }),
        }
    }
}
