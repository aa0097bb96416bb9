//! The linear response of the structure as a measurement of its own, with the state of the particle that it belongs to.
//!
//! `vines check`, the loop check before an experiment, and a decay without impacts measure it. It is data for a fit of the parameters:
//!
//! - `tracked.json`, `identification.json` and the JSON of `vines check` have it under the key `linear`;
//! - `tracked.csv` has it in the columns [`MeasuredLinear::COLUMNS`], the same values in every row.
//!
//! A particle that no wall touches is free, or is carried along, or friction does something between the two.
//! With m/M = epsilon, a free particle leaves `f0` and `zeta`; a carried one gives `f0/sqrt(1 + epsilon)` and `zeta/sqrt(1 + epsilon)`, because
//! the mass is M + m and the damper is the same.

use serde::{Deserialize, Serialize};
use vines_model::numerics::Estimate;

/// What the particle does while no wall touches it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ParticleState {
    /// It moves with the structure, as one mass.
    Carried,
    /// It does not act on the structure.
    Free,
    /// One of the two, or sliding friction between them: the measurement cannot tell.
    Unknown,
}

/// Natural frequency and damping ratio of the structure as measured, in one state of the particle.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct MeasuredLinear {
    /// Natural frequency, Hz, in this state of the particle.
    #[serde(rename = "f0_Hz")]
    pub f0: f64,
    /// Its standard uncertainty, Hz.
    #[serde(rename = "u_f0_Hz")]
    pub u_f0: f64,
    /// Damping ratio, in this state of the particle.
    pub zeta: f64,
    /// Its standard uncertainty.
    pub u_zeta: f64,
    /// Correlation of the two.
    pub correlation: f64,
    /// The state of the particle.
    pub particle: ParticleState,
}

impl MeasuredLinear {
    /// Its columns in a table, in the order of its fields.
    pub const COLUMNS: [&str; 6] = [
        "linear_f0_Hz",
        "linear_u_f0_Hz",
        "linear_zeta",
        "linear_u_zeta",
        "linear_correlation",
        "linear_particle",
    ];

    /// Natural frequency, Hz, and damping ratio.
    #[must_use]
    pub fn estimates(&self) -> [Estimate; 2] {
        [(self.f0, self.u_f0), (self.zeta, self.u_zeta)].map(|(value, uncertainty)| Estimate { value, uncertainty })
    }
}
