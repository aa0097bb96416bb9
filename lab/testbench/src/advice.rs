//! Advice after a run without the expected lock, from the exact orbits of the scene.

use vines_model::numerics::range;
use vines_model::orbit::{Orbit, exact_backbone};
use vines_model::regime::Regime;

use crate::identification::classify;
use crate::plan::Plan;
use crate::record::Sample;
use crate::scene::{Dimensionless, Scene};
use crate::survey::{phase_resonant, structure_backbone};

/// Detunings at which the backbone is searched for stable orbits, and their distance.
const SEARCHED: [f64; 2] = [-6.0, 3.0];
const STEP: f64 = 0.005;

/// The stable symmetric 1:1 orbits of a scene at phase resonance, at any drive; `d` has the numbers of its oscillator or driven mode.
pub fn stable_orbits_of(scene: &Scene, d: &Dimensionless) -> Vec<Orbit> {
    let of_structure = structure_backbone(scene, d).map(|curves| curves.into_iter().flatten());
    of_structure.map_or_else(
        || stable_orbits(d),
        |orbits| orbits.filter(|orbit| orbit.stable).collect(),
    )
}

/// The stable symmetric 1:1 orbits at phase resonance, at any drive, by rising detuning.
pub fn stable_orbits(d: &Dimensionless) -> Vec<Orbit> {
    let steps = ((SEARCHED[1] - SEARCHED[0]) / STEP) as i32;
    let omega = |n: i32| 1.0 + d.epsilon * (SEARCHED[0] + STEP * f64::from(n));
    let orbits = (0..=steps).flat_map(|n| exact_backbone(d, omega(n)));
    orbits.filter(|orbit| orbit.stable).collect()
}

/// The range of drives, base amplitude over `b epsilon`, with a stable symmetric 1:1 orbit at phase resonance; there may be gaps in it.
pub fn stable_range(d: &Dimensionless) -> Option<[f64; 2]> {
    drives(&stable_orbits(d))
}

/// The smallest and the largest drive of orbits.
fn drives(orbits: &[Orbit]) -> Option<[f64; 2]> {
    let (low, high) = range((f64::INFINITY, 0.0), orbits.iter().map(|orbit| orbit.g));
    (low <= high).then_some([low, high])
}

/// Why a run that was expected to lock the symmetric 1:1 motion may not have done so.
#[derive(Debug, Clone, PartialEq)]
#[expect(missing_docs, reason = "each variant explains its fields")]
pub enum Reason {
    /// No orbit at the drive `g` is stable; the range of drives is that of [`stable_range`].
    Unstable { g: f64, range: Option<[f64; 2]> },
    /// The controller may not set the frequency of any of these stable orbits.
    Excluded { stable: Vec<Orbit> },
    /// The particle does not reach the walls; under a constant drive, impacts begin at `G = onset`.
    NoImpacts { stable: Vec<Orbit>, onset: f64 },
    /// The motion is of this regime, and coexists with these stable orbits.
    Coexists { stable: Vec<Orbit>, regime: Regime },
}

/// The reason from the scene, the numbers of its rig and the regime of the last periods; it holds for the ideal cavity.
/// `None` where the exact orbits give no reason.
pub fn reason(scene: &Scene, d: &Dimensionless, regime: Option<Regime>) -> Option<Reason> {
    let mut stable = phase_resonant(scene, d);
    stable.retain(|orbit| orbit.stable);
    if stable.is_empty() {
        return Some(Reason::Unstable { g: d.g, range: drives(&stable_orbits_of(scene, d)) });
    }
    let allowed = scene.controller.omega_min..=scene.controller.omega_max;
    if !stable.iter().any(|orbit| allowed.contains(&orbit.omega)) {
        return Some(Reason::Excluded { stable });
    }
    match regime? {
        Regime::Unknown | Regime::Unresolved | Regime::NotEstablished => None,
        Regime::NoImpacts => Some(Reason::NoImpacts { stable, onset: d.lambda }),
        regime => Some(Reason::Coexists { stable, regime }),
    }
}

/// The regime of the last periods of a record that did not lock, from the impacts that the rig reports.
pub fn last_regime(samples: &[Sample], plan: &Plan) -> Option<Regime> {
    let last = &samples[samples.len().saturating_sub(plan.hold)..];
    let omega = last.last()?.command.drive.omega;
    Some(classify(last, plan.knowledge.sample_time, omega).1)
}
