//! The numbers that the page shows, from the bench as it is now.

use std::f64::consts::TAU;

use vines_model::regime::{MEASURED, Regime, one_to_one};

use crate::bench::Bench;

/// Periods without an impact after which there are none.
const QUIET: f64 = 20.0;
/// Smallest number of impacts that a regime is determined from.
const ENOUGH: usize = 12;

impl Bench {
    /// The regime of the last impacts, as the lab determines it in an experiment.
    #[must_use]
    pub fn regime(&self) -> Regime {
        let since = self.impacts.last().map_or(self.phase, |last| self.phase - last.time);
        if since > QUIET * TAU {
            return Regime::NoImpacts;
        }
        if self.impacts.len() < ENOUGH {
            return Regime::Unknown;
        }
        one_to_one(&self.impacts, self.impacts_per_period(), MEASURED)
    }
}
