//! The `[backbone]` section: how the backbone is tracked.

use serde::{Deserialize, Serialize};

use super::{SceneError, positive, within};

/// How the response amplitude is stepped with the loop closed.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct BackboneSettings {
    /// First level, response amplitude over b.
    #[serde(rename = "C_from")]
    pub c_from: f64,
    /// Last level, response amplitude over b.
    #[serde(rename = "C_to")]
    pub c_to: f64,
    /// Number of levels, at equal distances.
    pub points: u32,
    /// Largest drive allowed, base amplitude over `b epsilon`.
    #[serde(rename = "G_max")]
    pub g_max: f64,
    /// Periods after which a point is taken, settled or not.
    pub dwell_max: u32,
    /// Largest standard uncertainty of the drive E as a share of it, and of the frequency as a share of the half-power bandwidth of a linear rig
    /// that this drive holds at the largest level: `omega0 E/A`. Noise and transients lengthen the dwell until both are reached.
    pub precision: f64,
}

impl Default for BackboneSettings {
    fn default() -> Self {
        Self {
            c_from: 0.7,
            c_to: 0.14,
            points: 29,
            g_max: 4.0,
            dwell_max: 150,
            precision: 9e-4,
        }
    }
}

impl BackboneSettings {
    pub(super) fn check(&self) -> Result<(), SceneError> {
        positive("backbone.C_from", self.c_from, "(over b)")?;
        positive("backbone.C_to", self.c_to, "(over b)")?;
        positive("backbone.G_max", self.g_max, "(over b epsilon)")?;
        positive("backbone.precision", self.precision, "(relative)")?;
        within("backbone.points", self.points.into(), "(levels)", [1.0, 1e4])?;
        // Two halves of four periods.
        within("backbone.dwell_max", self.dwell_max.into(), "(periods)", [8.0, 1e4])
    }

    /// The levels, amplitudes of the response in m, for the half-width `b`, m, in the order in which they are visited.
    pub(super) fn levels(&self, b: f64) -> Vec<f64> {
        let [from, to] = [self.c_from, self.c_to].map(|level| level * b);
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
