//! Bifurcation curves of the 1:1 motions in (sigma, G), by the same continuation with G as a second free parameter.

use serde::Serialize;

use super::{Bifurcation, Branch, Condition, Limits, Special, continue_both_ways, response};
use crate::Dimensionless;
use crate::numerics::equally_spaced;

/// A curve in (sigma, G) on which 1:1 motions bifurcate.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct BifurcationCurve {
    /// What happens on it.
    pub kind: Bifurcation,
    /// The motions on it. Where the others of their multipliers are inside the unit circle, the curve bounds stability.
    #[serde(flatten)]
    pub branch: Branch,
}

/// Excitations at which the curves are searched for.
const LEVELS: usize = 25;

/// The curves of folds, symmetry breakings, period doublings and Neimark-Sacker bifurcations of the symmetric and asymmetric 1:1
/// motions that cross one of 25 levels of G in `limits`.
pub fn bifurcation_curves(scene: &Dimensionless, limits: &Limits) -> Vec<BifurcationCurve> {
    let mut found: Vec<BifurcationCurve> = Vec::new();
    let [low, high] = limits.g;
    for g in equally_spaced(low, high, LEVELS).filter(|g| *g > 0.0) {
        let scene = Dimensionless { g, ..*scene };
        for component in response(&scene, limits, 1).components {
            if !component.branch.points[0].pattern.is_one_to_one() {
                continue;
            }
            for special in &component.branch.special {
                if !found.iter().any(|curve| curve.passes(&scene, special)) {
                    let condition = Condition::Bifurcation(special.kind);
                    let branch = continue_both_ways(&scene, &special.motion, condition, limits);
                    found.push(BifurcationCurve { kind: special.kind, branch });
                }
            }
        }
    }
    found.sort_by_key(|one| (one.kind.name(), !one.branch.points[0].pattern.mirrored));
    found
}

impl BifurcationCurve {
    /// As in a table: the bifurcation and the motions.
    pub fn name(&self) -> String {
        format!("{} of {}", self.kind.name(), self.branch.points[0].pattern.name())
    }

    fn passes(&self, scene: &Dimensionless, special: &Special) -> bool {
        let motion = &special.motion;
        if self.kind != special.kind || self.branch.points[0].pattern.mirrored != motion.pattern.mirrored {
            return false;
        }
        let conditions = [Condition::Excitation(motion.g), Condition::Bifurcation(self.kind)];
        self.branch.leads_to(scene, motion, conditions, |one| one.g, 1e-4)
    }
}
