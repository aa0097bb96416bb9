//! Newton's law of restitution, for the methods that follow impacts one by one.

use lovines::Parameters;

/// Velocities of primary mass and particle after an impact with the velocities `v1` and `v2`.
pub fn rebound(p: &Parameters, v1: f64, v2: f64) -> (f64, f64) {
    let (m1, m2) = (p.primary_mass, p.particle_mass);
    let (momentum, apart) = (m1 * v1 + m2 * v2, p.restitution * (v1 - v2));
    let after = (momentum - m2 * apart) / (m1 + m2);
    (after, after + apart)
}

/// The acceleration of the primary mass under `e = amplitude sin(angle)`.
pub fn acceleration(p: &Parameters, amplitude: f64, omega: f64, angle: f64, q1: f64, v1: f64) -> f64 {
    let (sin, cos) = angle.sin_cos();
    let (e, de) = (amplitude * sin, amplitude * omega * cos);
    (p.stiffness * (e - q1) + p.damping * (de - v1)) / p.primary_mass
}
