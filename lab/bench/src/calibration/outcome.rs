//! The errors of the results, and their statistics.

use serde::Serialize;
use vines_model::numerics::mean_square;

/// What a result belongs to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Kind {
    /// The locked point, against the exact orbit at the same G.
    Lock,
    /// A settled tracked point, against the exact backbone at the same C.
    Tracked,
    /// A point of the decay with C > 0.2, against the same sensors without noise.
    Decay,
}

/// The error of one result.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Outcome {
    /// Mass ratio of the rig.
    pub epsilon: f64,
    /// Signal-to-noise ratio, dB.
    pub snr: f64,
    /// Amplitude of the response over b.
    #[serde(rename = "C")]
    pub c: f64,
    /// What it belongs to.
    pub kind: Kind,
    /// Name of the quantity.
    pub quantity: &'static str,
    /// Value less exact value.
    pub error: f64,
    /// Standard uncertainty.
    pub uncertainty: f64,
    /// Cramér–Rao bound of the standard deviation; absent where it is not known in closed form.
    pub bound: Option<f64>,
}

/// Statistics of the outcomes of one quantity.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Coverage {
    /// Number of results.
    pub count: usize,
    /// Share of the results whose 95 % interval contains the exact value.
    pub covered: f64,
    /// Largest error over its standard uncertainty.
    pub worst: f64,
    /// RMS error.
    pub rms: f64,
    /// RMS of the Cramér–Rao bounds; absent where they are not known.
    pub bound: Option<f64>,
}

/// Half width of a 95 % interval, standard uncertainties.
pub const HALF_WIDTH: f64 = 1.96;

impl Coverage {
    /// Of some outcomes; shares of none are NaN.
    pub fn of<'a>(outcomes: impl Iterator<Item = &'a Outcome> + Clone) -> Self {
        let count = outcomes.clone().count();
        let pulls = outcomes.clone().map(|one| one.error.abs() / one.uncertainty);
        let bounds: Option<Vec<f64>> = outcomes.clone().map(|one| one.bound).collect();
        Self {
            count,
            covered: pulls.clone().filter(|pull| *pull <= HALF_WIDTH).count() as f64 / count as f64,
            worst: pulls.fold(0.0, f64::max),
            rms: mean_square(outcomes.map(|one| one.error)).sqrt(),
            bound: bounds.map(|bounds| mean_square(bounds).sqrt()),
        }
    }
}
