//! The `[start]` section: the initial state.

use serde::{Deserialize, Serialize};

use super::{Plant, SceneError, validate::Quantity};

/// Initial state, SI units; everything left out is zero.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Start {
    /// Displacement of the primary mass, m.
    pub q1: f64,
    /// Velocity of the primary mass, m/s.
    pub dq1: f64,
    /// Displacement of the particle, m.
    pub q2: f64,
    /// Velocity of the particle, m/s.
    pub dq2: f64,
}

impl Start {
    pub(super) fn check(&self, plant: &Plant) -> Result<(), SceneError> {
        Quantity::new("start.q1", self.q1, "m").finite()?;
        Quantity::new("start.dq1", self.dq1, "m/s").finite()?;
        Quantity::new("start.dq2", self.dq2, "m/s").finite()?;
        let b = plant.half_width;
        let inside = (self.q1 - self.q2).abs() <= b;
        let allowed = format!(
            "the particle must start inside its cavity, at most b = {b} m from q1 = {} m",
            self.q1
        );
        Quantity::new("start.q2", self.q2, "m").check(inside, allowed)
    }
}
