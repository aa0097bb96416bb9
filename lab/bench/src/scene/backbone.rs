//! The `[backbone]` section: how the backbone is tracked.

use serde::{Deserialize, Serialize};

use super::{Dimensionless, SceneError, validate::Quantity};

/// How the response amplitude is stepped with the loop closed.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Backbone {
    /// First level, response amplitude over b.
    #[serde(rename = "C_from", skip_serializing_if = "Option::is_none")]
    pub c_from: Option<f64>,
    /// The same in m.
    #[serde(rename = "A_from", skip_serializing_if = "Option::is_none")]
    pub a_from: Option<f64>,
    /// Last level, response amplitude over b.
    #[serde(rename = "C_to", skip_serializing_if = "Option::is_none")]
    pub c_to: Option<f64>,
    /// The same in m.
    #[serde(rename = "A_to", skip_serializing_if = "Option::is_none")]
    pub a_to: Option<f64>,
    /// How many levels, at equal distances.
    pub points: u32,
    /// Largest drive allowed, base amplitude over `b epsilon`.
    #[serde(rename = "G_max", skip_serializing_if = "Option::is_none")]
    pub g_max: Option<f64>,
    /// The same in m.
    #[serde(rename = "E_max", skip_serializing_if = "Option::is_none")]
    pub e_max: Option<f64>,
    /// Periods after which a point is taken, settled or not.
    pub dwell_max: u32,
    /// Largest standard uncertainty of the drive E as a share of it, and of the frequency as a share of the half-power bandwidth of a linear rig
    /// that this drive holds at the largest level: `omega0 E/A`. Noise and transients lengthen the dwell until both are reached.
    pub precision: f64,
}

impl Default for Backbone {
    fn default() -> Self {
        Self {
            c_from: None,
            a_from: None,
            c_to: None,
            a_to: None,
            points: 29,
            g_max: None,
            e_max: None,
            dwell_max: 150,
            precision: 9e-4,
        }
    }
}

impl Backbone {
    /// First and last level and the largest drive where neither unit is given, and a refusal where both are.
    pub(super) fn complete(&mut self, origin: &str) -> Result<(), SceneError> {
        let default =
            |over_b: &mut Option<f64>, in_m: Option<f64>, [key, other]: [&str; 2], value| match (*over_b, in_m) {
                (Some(_), Some(_)) => Err(both(origin, "backbone", key, other)),
                (None, None) => {
                    *over_b = Some(value);
                    Ok(())
                }
                _ => Ok(()),
            };
        default(&mut self.c_from, self.a_from, ["C_from", "A_from"], 0.7)?;
        default(&mut self.c_to, self.a_to, ["C_to", "A_to"], 0.14)?;
        default(&mut self.g_max, self.e_max, ["G_max", "E_max"], 4.0)
    }

    /// The levels, amplitudes of the response, m, in the order in which they are visited; `b` (m) is the half-width of the cavity.
    pub fn levels(&self, b: f64) -> Vec<f64> {
        let in_m = |in_m: Option<f64>, over_b: Option<f64>| in_m.or(over_b.map(|c| c * b)).unwrap_or_default();
        let (from, to, unit) = match (self.c_from, self.c_to) {
            (Some(from), Some(to)) => (from, to, b),
            (from, to) => (in_m(self.a_from, from), in_m(self.a_to, to), 1.0),
        };
        let steps = f64::from(self.points.max(2) - 1);
        (0..self.points)
            .map(|n| unit * rounded(from + (to - from) * f64::from(n) / steps))
            .collect()
    }

    /// Largest drive, m.
    pub(super) fn drive_max(&self, d: &Dimensionless) -> f64 {
        let by_g = self.g_max.map(|g| d.amplitude(g));
        self.e_max.or(by_g).unwrap_or(f64::INFINITY)
    }

    pub(super) fn check(&self) -> Result<(), SceneError> {
        for (key, value, unit) in [
            ("backbone.C_from", self.c_from, "(over b)"),
            ("backbone.C_to", self.c_to, "(over b)"),
            ("backbone.A_from", self.a_from, "m"),
            ("backbone.A_to", self.a_to, "m"),
            ("backbone.G_max", self.g_max, "(dimensionless)"),
            ("backbone.E_max", self.e_max, "m"),
        ] {
            Quantity::new(key, value.unwrap_or(1.0), unit).positive()?;
        }
        Quantity::new("backbone.points", self.points.into(), "(levels)")
            .check((1..=10_000).contains(&self.points), "must be from 1 to 10000")?;
        Quantity::new("backbone.dwell_max", self.dwell_max.into(), "(periods)").check(
            (8..=10_000).contains(&self.dwell_max),
            "must be from 8 (two halves of four periods) to 10000",
        )?;
        Quantity::new("backbone.precision", self.precision, "(relative)").positive()
    }
}

/// The refusal of a quantity that is given in two units.
pub(super) fn both(origin: &str, section: &str, key: &str, other: &str) -> SceneError {
    SceneError::Keys {
        origin: origin.into(),
        message: format!("[{section}] has both {key} and {other} (m), which say the same thing: give one of them"),
    }
}

/// As a person would write it, to ten digits: 0.68, not 0.6799999999999999.
fn rounded(value: f64) -> f64 {
    format!("{value:.9e}").parse().unwrap_or(value)
}
