//! The curves of a scene: its exact backbone, and its exact frequency response with what branches off.

use serde::Serialize;

use super::{
    Bifurcation, Branch, Condition, Limits, Orbit, Periodic, Shape, asymmetric_branch,
    continue_both_ways, phase_resonant,
};
use crate::scene::Dimensionless;

/// The exact frequency response at one excitation.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Response {
    /// Base amplitude over `b epsilon`.
    #[serde(rename = "G")]
    pub g: f64,
    /// Symmetric 1:1 motions.
    pub symmetric: Branch,
    /// Asymmetric ones, one branch for each symmetry breaking; their mirror images have the same sigma and C.
    pub asymmetric: Vec<Branch>,
}

/// The phase-resonant symmetric motion with the fastest particle: the one on the right branch.
fn right_branch(scene: &Dimensionless) -> Option<Periodic> {
    let fastest = |one: &Orbit, other: &Orbit| one.b.total_cmp(&other.b);
    let orbit = phase_resonant(scene).into_iter().max_by(fastest)?;
    let conditions = [Condition::Excitation(scene.g), Condition::PhaseResonance];
    Periodic::find(scene, &Shape::symmetric(), &orbit.unknowns(), conditions)
}

/// The exact backbone through the scene's phase-resonant motion; None where it has none.
#[must_use]
pub fn backbone(scene: &Dimensionless, limits: &Limits) -> Option<Branch> {
    let start = right_branch(scene)?;
    Some(continue_both_ways(
        scene,
        &start,
        Condition::PhaseResonance,
        limits,
    ))
}

/// The exact frequency response through the scene's phase-resonant motion; None where it has none.
#[must_use]
pub fn response(scene: &Dimensionless, limits: &Limits) -> Option<Response> {
    let start = right_branch(scene)?;
    let condition = Condition::Excitation(scene.g);
    let symmetric = continue_both_ways(scene, &start, condition, limits);
    let mut asymmetric: Vec<Branch> = Vec::new();
    for special in &symmetric.special {
        // A branch that joins two symmetry breakings is found once.
        let known = asymmetric
            .iter()
            .any(|branch| passes(branch, &special.motion));
        if special.kind == Bifurcation::SymmetryBreaking && !known {
            asymmetric.extend(asymmetric_branch(scene, special, condition, limits));
        }
    }
    Some(Response {
        g: scene.g,
        symmetric,
        asymmetric,
    })
}

/// Whether a branch comes as close to a motion as its own points are apart.
fn passes(branch: &Branch, motion: &Periodic) -> bool {
    branch.points.windows(2).any(|pair| {
        let apart =
            |one: &Periodic, other: &Periodic| (one.sigma - other.sigma).hypot(one.c - other.c);
        apart(&pair[0], motion) <= apart(&pair[0], &pair[1])
    })
}
