//! The sections `[record]`: how long to drive, to record and to average; and `[backbone]`: how the backbone is tracked.

use serde::{Deserialize, Serialize};
use vines_rig::unit::rounded;

settings! {
    /// Durations of an experiment.
    pub struct RecordSettings {
        /// How long the settled lock is held and measured, natural periods.
        hold_periods: f64 = 20.0,
        /// Length of the recorded decay, natural periods; by default as long as the linear response takes to fall to 5 %.
        decay_periods: Option<f64> = None,
    }
}

settings! {
    /// How the response amplitude is stepped with the loop closed.
    pub struct BackboneSettings {
        /// First level, response amplitude over b.
        #[serde(rename = "C_from")]
        c_from: f64 = 0.7,
        /// Last level, response amplitude over b.
        #[serde(rename = "C_to")]
        c_to: f64 = 0.14,
        /// Number of levels, at equal distances.
        points: u32 = 29,
        /// Largest standard uncertainty of the drive E as a share of it, and of the frequency as a share of the half-power bandwidth of a linear rig
        /// that this drive holds at the largest level: `omega0 E/A`. Noise and transients lengthen the dwell until both are reached.
        precision: f64 = 9e-4,
    }
}

impl BackboneSettings {
    /// The levels, amplitudes of the response in m, for the half-width `b`, m, in the order in which they are visited.
    pub(crate) fn levels(&self, b: f64) -> Vec<f64> {
        let [from, to] = [self.c_from, self.c_to].map(|level| level * b);
        let steps = f64::from(self.points.max(2) - 1);
        (0..self.points)
            // To ten digits, as a person would write it: 0.0068, not 0.0067999999999999996.
            .map(|n| rounded(from + (to - from) * f64::from(n) / steps, 9))
            .collect()
    }
}
