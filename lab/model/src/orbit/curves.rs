//! The exact backbone of a scene.

use super::{
    Branch, Condition, ImpactPattern, Limits, Orbit, Periodic, continue_both_ways, exact_backbone, phase_resonant,
};
use crate::Dimensionless;
use crate::theory::Manifold;

/// The phase-resonant symmetric motion with the fastest particle: the one on the right branch.
fn right_branch(scene: &Dimensionless) -> Option<Periodic> {
    let fastest = |one: &Orbit, other: &Orbit| one.b.total_cmp(&other.b);
    let orbit = phase_resonant(scene).into_iter().max_by(fastest)?;
    let conditions = [Condition::Excitation(scene.g), Condition::backbone(scene)];
    Periodic::find(scene, &ImpactPattern::symmetric(), &orbit.unknowns(), conditions)
}

/// Detunings at which the backbone is searched for if it has no motion at the scene's G.
const MET_AT: [f64; 6] = [-1.0, -0.7, -1.4, -0.5, -2.0, 0.0];

/// A phase-resonant motion on the right branch, at any G (zero without damping and losses).
fn at_any_excitation(scene: &Dimensionless) -> Option<Periodic> {
    let right = Manifold::new(scene.r).b_min();
    MET_AT.into_iter().find_map(|sigma| {
        let fastest = |one: &Orbit, other: &Orbit| one.b.total_cmp(&other.b);
        let met = exact_backbone(scene, 1.0 + scene.epsilon * sigma);
        let orbit = met.into_iter().max_by(fastest).filter(|one| one.b > right)?;
        let conditions = [Condition::Sigma(sigma), Condition::backbone(scene)];
        Periodic::find(scene, &ImpactPattern::symmetric(), &orbit.unknowns(), conditions)
    })
}

/// The exact backbone, through the scene's phase-resonant motion or, without one, through another. Without damping and with
/// r = 1 it is the conservative nonlinear mode.
#[must_use]
pub fn backbone(scene: &Dimensionless, limits: &Limits) -> Option<Branch> {
    let start = right_branch(scene).or_else(|| at_any_excitation(scene))?;
    Some(continue_both_ways(scene, &start, Condition::backbone(scene), limits))
}
