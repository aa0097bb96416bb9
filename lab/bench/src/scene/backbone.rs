//! The `[backbone]` section: how the backbone is tracked.

use serde::{Deserialize, Serialize};

use super::{Controller, SceneError, validate::Quantity};

/// How the response amplitude is stepped with the loop closed.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Backbone {
    /// First level, response amplitude over b.
    #[serde(rename = "C_from")]
    pub c_from: f64,
    /// Last level, response amplitude over b.
    #[serde(rename = "C_to")]
    pub c_to: f64,
    /// How many levels, at equal distances.
    pub points: u32,
    /// Largest drive allowed, base amplitude over `b epsilon`.
    #[serde(rename = "G_max")]
    pub g_max: f64,
    /// Largest bandwidth of the detector while tracking, in units of omega0; less where the loops of phase and amplitude would be coupled.
    pub bandwidth: f64,
    /// Duration of the move from one level to the next, periods.
    pub move_periods: f64,
    /// Fewest periods that a point is averaged over.
    pub dwell_min: u32,
    /// Periods after which a point is taken, settled or not.
    pub dwell_max: u32,
    /// Largest standard uncertainties of sigma and G; noise and transients lengthen the dwell until they are reached.
    pub precision: f64,
}

impl Default for Backbone {
    fn default() -> Self {
        Self {
            c_from: 0.7,
            c_to: 0.14,
            points: 29,
            g_max: 4.0,
            bandwidth: 0.15,
            move_periods: 4.0,
            dwell_min: 8,
            dwell_max: 150,
            precision: 1.25e-3,
        }
    }
}

impl Backbone {
    /// The levels, response amplitude over b, in the order in which they are visited.
    pub fn levels(&self) -> Vec<f64> {
        let steps = f64::from(self.points.max(2) - 1);
        // Rounded as a person would write them: 0.68, not 0.6799999999999999.
        (0..self.points)
            .map(|n| self.c_from + (self.c_to - self.c_from) * f64::from(n) / steps)
            .map(|level| (1e9 * level).round() / 1e9)
            .collect()
    }

    pub(super) fn check(&self, controller: &Controller) -> Result<(), SceneError> {
        for (key, level) in [("backbone.C_from", self.c_from), ("backbone.C_to", self.c_to)] {
            Quantity::new(key, level, "(over b)").positive()?;
        }
        Quantity::new("backbone.points", self.points.into(), "(levels)")
            .check((1..=10_000).contains(&self.points), "must be from 1 to 10000")?;
        Quantity::new("backbone.G_max", self.g_max, "(dimensionless)").positive()?;
        let widest = controller.bandwidth_max();
        Quantity::new("backbone.bandwidth", self.bandwidth, "(omega0)").check(
            self.bandwidth > 0.0 && self.bandwidth <= widest,
            format!("must be above 0 and at most {widest:.3} at that many samples per period"),
        )?;
        Quantity::new("backbone.move_periods", self.move_periods, "(periods)").check(
            (0.0..=1e4).contains(&self.move_periods),
            "must be from 0 (a jump) to 10000",
        )?;
        let (least, most) = (self.dwell_min, self.dwell_max);
        Quantity::new("backbone.dwell_min", least.into(), "(periods)").check(
            (8..=1000).contains(&least),
            "must be from 8 (two halves of four periods) to 1000",
        )?;
        Quantity::new("backbone.dwell_max", most.into(), "(periods)").check(
            (least..=10_000).contains(&most),
            format!("must be from dwell_min = {least} to 10000"),
        )?;
        Quantity::new("backbone.precision", self.precision, "(relative)").positive()
    }
}
