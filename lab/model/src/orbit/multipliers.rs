//! Stability: the half-period map, linearised through flight and impact.

use std::f64::consts::PI;

use nalgebra::{Matrix4, RowVector4, Vector4};

use super::{candidate::Candidate, oscillator::Oscillator};
use crate::Dimensionless;

/// Moduli of the multipliers of the half-period map, ascending; those of the period are their squares.
pub(super) fn moduli(scene: &Dimensionless, candidate: &Candidate) -> [f64; 4] {
    let oscillator = Oscillator::new(scene.epsilon * scene.lambda / 2.0);
    let map = saltation(scene, candidate, &oscillator) * flight(candidate, &oscillator);
    let mut moduli: [f64; 4] = map.complex_eigenvalues().map(|one| one.norm()).into();
    moduli.sort_by(f64::total_cmp);
    moduli
}

/// Disturbances of (q1, q1', q2, q2') over a flight; the forcing drops out.
fn flight(candidate: &Candidate, oscillator: &Oscillator) -> Matrix4<f64> {
    let duration = PI / candidate.omega;
    let mut map = Matrix4::identity();
    map.fixed_view_mut::<2, 2>(0, 0)
        .copy_from(&oscillator.propagator(duration));
    map[(2, 3)] = duration;
    map
}

/// Disturbances through an impact, which a disturbed motion reaches a little earlier or later:
/// `R + (f+ - R f-) n/(n f-)` with the jump R, the fields f before and after, and the normal n of the wall.
fn saltation(scene: &Dimensionless, candidate: &Candidate, oscillator: &Oscillator) -> Matrix4<f64> {
    let Dimensionless { epsilon, r, .. } = *scene;
    let Candidate { b, before, .. } = *candidate;

    let particle = (1.0 + r) / (1.0 + epsilon);
    let mut jump = Matrix4::identity();
    jump[(1, 1)] -= epsilon * particle;
    jump[(1, 3)] += epsilon * particle;
    jump[(3, 1)] += particle;
    jump[(3, 3)] -= particle;

    let force = (candidate.base * oscillator.base_force(candidate.omega)).im;
    let [q1, dq1] = before.into();
    let field = |dq1: f64, dq2: f64| {
        let acceleration = oscillator.free_acceleration(q1, dq1) + force;
        Vector4::new(dq1, acceleration, dq2, 0.0)
    };
    let f_before = field(dq1, -b);
    let f_after = field(dq1 - 2.0 * epsilon * b, b);

    let normal = RowVector4::new(1.0, 0.0, -1.0, 0.0);
    let approach = (normal * f_before)[0];
    jump + (f_after - jump * f_before) * normal / approach
}
