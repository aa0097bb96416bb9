//! Exact periodic orbits: symmetric 1:1 ones at phase resonance in closed form, all others by shooting on the plant's own motion.
//!
//! Everything is dimensionless: lengths over b, velocities over `b omega0`, time `tau = omega0 t`. Half a period after an
//! impact the state of a symmetric orbit is minus itself; the particle flies in straight lines at speed ±B, so the wall exerts
//! alternating impulses of known size on the oscillator, and their periodic response has a closed form. At a given frequency
//! one quadratic equation for B remains. There is no first-order approximation.

mod continuation;
mod flight;
mod half_period;
mod impacts;
mod multipliers;
mod periodic;
mod plant;
mod response;
mod return_map;
mod shooting;
mod structure;
mod study;
mod symmetric;

use crate::Dimensionless;
use serde::Serialize;

pub use continuation::{Branch, BranchBifurcation, BranchEnd, ContinuationLimits, continue_both_ways};
pub use impacts::{Bounce, ImpactPattern};
pub use periodic::{Periodic, settle};
pub(crate) use periodic::{SETTLING_DISTANCE, periodic_near};
pub use plant::{NoMotion, PlantMotion, periodic_motion, resonant_motion, resonant_motion_under, settled_motion};
pub use response::{BifurcationCurve, Component, DOUBLINGS, FrequencyResponse, bifurcation_curves, response};
pub use return_map::{Bifurcation, Condition, Stability, Unknowns};
pub use structure::{
    ModeFacts, OrbitCurve, SEARCHED, StabilityChange, StructureBranch, StructureFacts, StructureOrbit, StructureOrbits,
    StructureRange, StructureStart,
};
pub use study::{
    at_amplitude, backbone, backbone_at_speed, exact_backbone, phase_resonant, stable_resonant, symmetric_orbits,
};
pub use symmetric::Particle;

/// An exact symmetric 1:1 orbit. At phase resonance, the first harmonic of `v = q1 + epsilon q2` lags the base by pi/2.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Orbit {
    /// Base amplitude over `b epsilon`.
    #[serde(rename = "G")]
    pub g: f64,
    /// Detuning `(Omega - 1)/epsilon`.
    pub sigma: f64,
    /// Angular frequency over omega0.
    #[serde(rename = "Omega")]
    pub omega: f64,
    /// Amplitude of the first harmonic of the response: of v, unless the scene's definition of resonance says otherwise.
    #[serde(rename = "C")]
    pub c: f64,
    /// Phase of the first harmonic of the response relative to the reference, rad.
    pub gamma: f64,
    /// Speed of the particle in flight.
    #[serde(rename = "B")]
    pub b: f64,
    /// Relative velocity just before an impact (w' at the wall w = +1).
    pub impact_velocity: f64,
    /// Where the orbit can be started.
    pub start: AfterImpact,
    /// Moduli of the multipliers of the half-period map, ascending.
    pub multipliers: [f64; 4],
    /// All multipliers are inside the unit circle.
    pub stable: bool,
    /// The largest multipliers are on the unit circle, within 1e-7: disturbances neither grow nor decay.
    pub neutral: bool,
}

/// The state just after an impact on the wall w = +1, where the base displacement is `epsilon G sin(Omega tau + phase)`
/// with tau counted from that impact. Half a period later the state is minus this one.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct AfterImpact {
    /// Phase of the base, rad, in (-pi, pi].
    pub phase: f64,
    /// Displacement of the primary mass over b.
    pub q1: f64,
    /// Velocity of the primary mass over `b omega0`.
    pub dq1: f64,
    /// Displacement of the particle over b.
    pub q2: f64,
    /// Velocity of the particle over `b omega0`.
    pub dq2: f64,
}

impl Orbit {
    /// Whether a multiplier is outside the unit circle.
    pub fn is_unstable(&self) -> bool {
        !self.stable && !self.neutral
    }

    /// The unknowns that shooting starts from: (phase, q1, q1', q2') after the impact on w = +1, sigma, G.
    pub fn unknowns(&self) -> Unknowns {
        let AfterImpact { phase, q1, dq1, dq2, .. } = self.start;
        Unknowns::from([phase, q1, dq1, dq2, self.sigma, self.g])
    }

    /// The symmetric motion near this one that satisfies both conditions.
    pub fn periodic(&self, scene: &Dimensionless, conditions: [Condition; 2]) -> Option<Periodic> {
        Periodic::find(scene, &ImpactPattern::symmetric(), &self.unknowns(), conditions)
    }
}
