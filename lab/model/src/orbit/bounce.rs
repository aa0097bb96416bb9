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

    /// How far `later` is from repeating this state after the base has turned by `turn`, rad; with the sign -1, from its mirror image.
    pub(super) fn apart(&self, later: &Bounce, turn: f64, sign: f64) -> Vector4<f64> {
        let mut apart = later.vector() * sign - self.vector();
        apart[0] = later.phase - self.phase - turn;
        apart
    }

    /// Displacement of the particle over b.
    pub fn q2(&self) -> f64 {
        self.q1 - self.wall
    }
}
