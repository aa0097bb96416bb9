//! The state just after an impact.

use nalgebra::Vector4;
use serde::Serialize;

/// Dimensionless positions and velocities (q1, q1', q2, q2').
pub(super) type State = [f64; 4];

/// State just after an impact. The base displacement is `epsilon G sin(phase)` there, and the particle is at `q1 - wall`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Bounce {
    /// Phase of the base, rad; it grows from impact to impact.
    pub phase: f64,
    /// Displacement of the primary mass over b.
    pub q1: f64,
    /// Velocity of the primary mass over `b omega0`.
    pub dq1: f64,
    /// Velocity of the particle over `b omega0`.
    pub dq2: f64,
    /// The wall that was hit: +1 for w = +1, -1 for w = -1.
    pub wall: f64,
}

impl Bounce {
    pub(super) fn vector(&self) -> Vector4<f64> {
        Vector4::new(self.phase, self.q1, self.dq1, self.dq2)
    }

    pub(super) fn from_vector(x: &Vector4<f64>, wall: f64) -> Self {
        let [phase, q1, dq1, dq2] = (*x).into();
        Self { phase, q1, dq1, dq2, wall }
    }

    /// Displacement of the particle over b.
    #[must_use]
    pub fn q2(&self) -> f64 {
        self.q1 - self.wall
    }
}
