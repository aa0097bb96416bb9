//! The exact backbone of a scene.

use super::{Branch, Condition, Limits, Orbit, continue_both_ways, exact_backbone, phase_resonant};
use crate::Dimensionless;
use crate::theory::Manifold;

/// Detunings at which the backbone is searched for if it has no motion at the scene's G.
const MET_AT: [f64; 6] = [-1.0, -0.7, -1.4, -0.5, -2.0, 0.0];

/// The exact backbone, through the scene's phase-resonant motion or, without one, through another (with G = 0 where there is neither
/// damping nor loss): the one with the fastest particle, on the right branch. Without damping and with r = 1 it is the conservative
/// nonlinear mode.
pub fn backbone(scene: &Dimensionless, limits: &Limits) -> Option<Branch> {
    let condition = Condition::backbone(scene);
    let fastest = |orbits: Vec<Orbit>| orbits.into_iter().max_by(|one, other| one.b.total_cmp(&other.b));
    let right = Manifold::new(scene.r).b_min();
    let at_any_excitation = |sigma: f64| {
        let met = exact_backbone(scene, 1.0 + scene.epsilon * sigma);
        let orbit = fastest(met).filter(|one| one.b > right)?;
        orbit.periodic(scene, [Condition::Sigma(sigma), condition])
    };
    let start = fastest(phase_resonant(scene))
        .and_then(|orbit| orbit.periodic(scene, [Condition::Excitation(scene.g), condition]))
        .or_else(|| MET_AT.into_iter().find_map(at_any_excitation))?;
    Some(continue_both_ways(scene, &start, condition, limits))
}
