//! The `[backbone]` section: how the backbone is tracked.

use serde::{Deserialize, Serialize};

use super::{Checked, Dimensionless, Length, SceneError};

/// How the response amplitude is stepped with the loop closed.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct BackboneSettings {
    /// First level over b, in a file only: [`Scene`](super::Scene) has it as `a_from`.
    #[serde(rename = "C_from", skip_serializing)]
    pub c_from: Option<f64>,
    /// First level, response amplitude, m.
    #[serde(rename = "A_from")]
    pub a_from: Option<f64>,
    /// Last level over b, in a file only.
    #[serde(rename = "C_to", skip_serializing)]
    pub c_to: Option<f64>,
    /// Last level, response amplitude, m.
    #[serde(rename = "A_to")]
    pub a_to: Option<f64>,
    /// Number of levels, at equal distances.
    pub points: u32,
    /// Largest drive allowed over `b epsilon`, in a file only.
    #[serde(rename = "G_max", skip_serializing)]
    pub g_max: Option<f64>,
    /// Largest drive allowed, base amplitude, m.
    #[serde(rename = "E_max")]
    pub e_max: Option<f64>,
    /// Periods after which a point is taken, settled or not.
    pub dwell_max: u32,
    /// Largest standard uncertainty of the drive E as a share of it, and of the frequency as a share of the half-power bandwidth of a linear rig
    /// that this drive holds at the largest level: `omega0 E/A`. Noise and transients lengthen the dwell until both are reached.
    pub precision: f64,
}

/// First and last level over b, and the largest drive over `b epsilon`, where a scene states none.
const LEVELS: [f64; 2] = [0.7, 0.14];
const G_MAX: f64 = 4.0;

impl Default for BackboneSettings {
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

impl BackboneSettings {
    /// The default levels and the default largest drive, in metres.
    pub fn of(d: &Dimensionless) -> Self {
        let [a_from, a_to] = LEVELS.map(|level| Some(level * d.b));
        Self {
            a_from,
            a_to,
            e_max: Some(d.amplitude(G_MAX)),
            ..Self::default()
        }
    }

    /// The section with its levels and its largest drive in metres, checked.
    pub(super) fn in_metres(mut self, origin: &str, d: &Dimensionless) -> Result<Self, SceneError> {
        let default = Self::of(d);
        let length = |keys, over_unit: &mut Option<f64>, in_metres| Length {
            origin,
            section: "backbone",
            keys,
            over_unit: over_unit.take(),
            in_metres,
        };
        self.a_from = length(["C_from", "A_from"], &mut self.c_from, self.a_from)
            .resolve(d.b)?
            .or(default.a_from);
        self.a_to = length(["C_to", "A_to"], &mut self.c_to, self.a_to)
            .resolve(d.b)?
            .or(default.a_to);
        self.e_max = length(["G_max", "E_max"], &mut self.g_max, self.e_max)
            .resolve(d.amplitude(1.0))?
            .or(default.e_max);
        Checked::new("backbone.points", self.points.into(), "(levels)")
            .check((1..=10_000).contains(&self.points), "must be from 1 to 10000")?;
        Checked::new("backbone.dwell_max", self.dwell_max.into(), "(periods)").check(
            (8..=10_000).contains(&self.dwell_max),
            "must be from 8 (two halves of four periods) to 10000",
        )?;
        Checked::new("backbone.precision", self.precision, "(relative)").positive()?;
        Ok(self)
    }

    /// The levels, amplitudes of the response, m, in the order in which they are visited.
    pub fn levels(&self) -> Vec<f64> {
        let [from, to] = [self.a_from, self.a_to].map(Option::unwrap_or_default);
        let steps = f64::from(self.points.max(2) - 1);
        (0..self.points)
            .map(|n| rounded(from + (to - from) * f64::from(n) / steps))
            .collect()
    }
}

/// The value to ten digits, as a person would write it: 0.0068, not 0.0067999999999999996.
fn rounded(value: f64) -> f64 {
    format!("{value:.9e}").parse().unwrap_or(value)
}
