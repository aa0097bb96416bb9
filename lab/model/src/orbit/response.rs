//! Exact curves by continuation: all components of the frequency response, and the bifurcation curves of the 1:1 motions.
//!
//! Symmetric 1:1 motions have a closed form at every sigma, so that none is missed on the grid of detunings that is searched, both ends of
//! the range and isolas between two of its detunings included. Motions of other patterns are reached by switching branches at symmetry
//! breakings and period doublings; branches that are not connected with these are missed.

use serde::Serialize;

use super::continuation::{Branch, BranchBifurcation, ContinuationLimits, branch_off, continue_both_ways};
use super::impacts::ImpactPattern;
use super::periodic::{LONGEST_PATTERN, Periodic, SAME_MOTION};
use super::return_map::{Bifurcation, Condition};
use super::study::{least_excitation, symmetric_orbits};
use crate::Dimensionless;
use crate::numerics::{equally_spaced, golden_section};

/// The exact frequency response at one excitation.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FrequencyResponse {
    /// Base amplitude over `b epsilon`.
    #[serde(rename = "G")]
    pub g: f64,
    /// Its components, ordered by pattern, symmetric 1:1 first.
    pub components: Vec<Component>,
}

/// A curve of motions that continuation follows without a break.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Component {
    /// Pattern and number, as in "symmetric 1:1, 2 of 3".
    pub name: String,
    /// Its motions.
    #[serde(flatten)]
    pub branch: Branch,
}

/// Number of symmetry breakings and period doublings in a row that [`response`] usually follows.
pub const DOUBLINGS: usize = 3;

/// Detunings at which symmetric motions are computed, over the range.
const DETUNINGS_SEARCHED: usize = 1200;

/// The exact frequency response at the scene's G over the range of sigma in `limits`: symmetric 1:1 motions, and what branches off them at
/// `doublings` symmetry breakings and period doublings in a row.
pub fn response(scene: &Dimensionless, limits: &ContinuationLimits, doublings: usize) -> FrequencyResponse {
    let condition = Condition::Excitation(scene.g);
    let found = FrequencyResponse { g: scene.g, components: Vec::new() };
    let mut search = Search { scene, limits, doublings, found };
    let [low, high] = limits.sigma;
    let grid: Vec<f64> = equally_spaced(low, high, DETUNINGS_SEARCHED).collect();
    let least = |sigma: f64| least_excitation(scene, sigma);
    // An isola between two detunings of the grid surrounds a minimum of the least excitation.
    let narrow = grid
        .windows(3)
        .filter(|near| least(near[1]) <= least(near[0]).min(least(near[2])));
    let narrow = narrow.map(|near| golden_section(near[0], near[2], least));
    for sigma in grid.iter().copied().chain(narrow) {
        for orbit in symmetric_orbits(scene, sigma) {
            let motion = orbit.periodic(scene, [Condition::Sigma(sigma), condition]);
            if let Some(motion) = motion.filter(|motion| !search.found.contains(scene, motion)) {
                search.follow(continue_both_ways(scene, &motion, condition, limits), 0);
            }
        }
    }
    search.numbered()
}

/// The branches found so far; their names follow when all are found.
struct Search<'a> {
    scene: &'a Dimensionless,
    limits: &'a ContinuationLimits,
    doublings: usize,
    found: FrequencyResponse,
}

impl Search<'_> {
    /// Follows a branch, and those that branch off it.
    fn follow(&mut self, branch: Branch, depth: usize) {
        let breaking = [Bifurcation::SymmetryBreaking, Bifurcation::PeriodDoubling];
        let mut special = branch.special.clone();
        special.retain(|bifurcation| breaking.contains(&bifurcation.kind));
        // One that ended early, where continuation failed, may be a part of this one.
        let part = |old: &Branch| old.typical().all(|motion| branch.passes(self.scene, motion));
        self.found.components.retain(|old| !part(&old.branch));
        let impacts = branch.pattern().impacts();
        self.found
            .components
            .push(Component { name: branch.pattern().name(), branch });
        if depth == self.doublings || 2 * impacts > LONGEST_PATTERN {
            return;
        }
        for special in special {
            let condition = Condition::Excitation(self.scene.g);
            let Some(branch) = branch_off(self.scene, &special, condition, self.limits) else {
                continue;
            };
            // A branch that joins two such points is found from both.
            let is_found = branch.typical().all(|motion| self.found.contains(self.scene, motion));
            if branch.points.len() > 1 && !is_found {
                self.follow(branch, depth + 1);
            }
        }
    }

    /// The components in order, numbered.
    fn numbered(mut self) -> FrequencyResponse {
        let components = &mut self.found.components;
        components.sort_by_key(|component| {
            let pattern = component.branch.pattern();
            let periods = pattern.periods();
            (periods as usize * pattern.impacts(), periods, !pattern.mirrored)
        });
        let names: Vec<String> = components.iter().map(|component| component.name.clone()).collect();
        for (n, component) in components.iter_mut().enumerate() {
            let count = |names: &[String]| names.iter().filter(|name| **name == component.name).count();
            component.name = format!("{}, {} of {}", component.name, count(&names[..=n]), count(&names));
        }
        self.found
    }
}

impl FrequencyResponse {
    /// A motion of the scene lies on one of the components.
    pub fn contains(&self, scene: &Dimensionless, motion: &Periodic) -> bool {
        self.components
            .iter()
            .any(|component| component.branch.passes(scene, motion))
    }
}

impl Branch {
    /// The pattern of its motions.
    pub fn pattern(&self) -> &ImpactPattern {
        &self.points[0].pattern
    }

    /// The middle motion of all, and the middle one of the motions that are not unstable: a branch that contains both contains this branch.
    fn typical(&self) -> impl Iterator<Item = &Periodic> {
        let stable: Vec<&Periodic> = self
            .points
            .iter()
            .filter(|motion| !motion.stability.is_unstable())
            .collect();
        let middle = stable.get(stable.len() / 2).copied();
        [self.points.get(self.points.len() / 2), middle].into_iter().flatten()
    }

    /// Whether this branch of a frequency response passes a motion or its mirror image.
    pub fn passes(&self, scene: &Dimensionless, motion: &Periodic) -> bool {
        let kind = |pattern: &ImpactPattern| (pattern.impacts(), pattern.periods(), pattern.mirrored);
        if kind(self.pattern()) != kind(&motion.pattern) {
            return false;
        }
        let conditions = [Condition::Sigma(motion.sigma), Condition::Excitation(motion.g)];
        self.leads_to(scene, motion, conditions, |motion| motion.sigma, SAME_MOTION)
    }

    /// Whether Newton's method for `conditions` leads from this branch to a motion, within `same`. `along` is a coordinate that the
    /// conditions fix.
    pub(super) fn leads_to(
        &self,
        scene: &Dimensionless,
        motion: &Periodic,
        conditions: [Condition; 2],
        along: impl Fn(&Periodic) -> f64,
        same: f64,
    ) -> bool {
        self.points.windows(2).any(|pair| {
            let [from, to] = [&pair[0], &pair[1]];
            // Where the curve bends, its points are close together.
            if from.distance(motion).max(to.distance(motion)) > 1.2 * (from.distance(to) + SAME_MOTION) {
                return false;
            }
            let part = ((along(motion) - along(from)) / (along(to) - along(from))).clamp(0.0, 1.0);
            let guess = from.unknowns() + (to.unknowns() - from.unknowns()) * if part.is_nan() { 0.5 } else { part };
            // At a fold Newton's method may fail.
            Periodic::find(scene, &from.pattern, &guess, conditions).is_none_or(|found| found.distance(motion) < same)
        })
    }
}

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
pub fn bifurcation_curves(scene: &Dimensionless, limits: &ContinuationLimits) -> Vec<BifurcationCurve> {
    let mut found: Vec<BifurcationCurve> = Vec::new();
    let [low, high] = limits.g;
    for g in equally_spaced(low, high, LEVELS).filter(|g| *g > 0.0) {
        let scene = Dimensionless { g, ..*scene };
        for component in response(&scene, limits, 1).components {
            if !component.branch.pattern().is_one_to_one() {
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
    found.sort_by_key(|curve| (curve.kind.name(), !curve.branch.pattern().mirrored));
    found
}

impl BifurcationCurve {
    /// As in a table: the bifurcation and the motions.
    pub fn name(&self) -> String {
        format!("{} of {}", self.kind.name(), self.branch.pattern().name())
    }

    fn passes(&self, scene: &Dimensionless, special: &BranchBifurcation) -> bool {
        let motion = &special.motion;
        if self.kind != special.kind || self.branch.pattern().mirrored != motion.pattern.mirrored {
            return false;
        }
        let conditions = [Condition::Excitation(motion.g), Condition::Bifurcation(self.kind)];
        self.branch.leads_to(scene, motion, conditions, |motion| motion.g, 1e-4)
    }
}
