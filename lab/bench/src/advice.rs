//! Advice after a run without the expected lock, from the exact orbits of the scene.

use vines_model::numerics::range;
use vines_model::orbit::{Orbit, exact_backbone, phase_resonant};
use vines_model::regime::Regime;

use crate::identification::classify;
use crate::plan::Plan;
use crate::record::Sample;
use crate::scene::{Dimensionless, Scene};

/// Detunings at which the backbone is searched for stable orbits, and their distance.
const SEARCHED: [f64; 2] = [-6.0, 3.0];
const STEP: f64 = 0.005;

/// The stable symmetric 1:1 orbits at phase resonance, at any drive, by rising detuning.
pub fn stable_orbits(d: &Dimensionless) -> Vec<Orbit> {
    let steps = ((SEARCHED[1] - SEARCHED[0]) / STEP) as i32;
    let omega = |n: i32| 1.0 + d.epsilon * (SEARCHED[0] + STEP * f64::from(n));
    let orbits = (0..=steps).flat_map(|n| exact_backbone(d, omega(n)));
    orbits.filter(|orbit| orbit.stable).collect()
}

/// The range of drives, base amplitude over `b epsilon`, with a stable symmetric 1:1 orbit at phase resonance; there may be gaps in it.
pub fn stable_range(d: &Dimensionless) -> Option<[f64; 2]> {
    let (low, high) = range((f64::INFINITY, 0.0), stable_orbits(d).iter().map(|orbit| orbit.g));
    (low <= high).then_some([low, high])
}

/// Why a run that was expected to lock the symmetric 1:1 motion may not have done so, from the scene, the numbers of its rig and the
/// regime of the last periods.
/// `None` where the exact orbits give no reason.
pub fn reason(scene: &Scene, d: &Dimensionless, regime: Option<Regime>) -> Option<String> {
    let reason = ideal_reason(scene, d, regime)?;
    Some(match scene.left_out() {
        Some(left_out) => format!("{reason}. This holds for the ideal cavity, without {left_out}"),
        None => reason,
    })
}

fn ideal_reason(scene: &Scene, d: &Dimensionless, regime: Option<Regime>) -> Option<String> {
    let mut stable = phase_resonant(d);
    stable.retain(|orbit| orbit.stable);
    if stable.is_empty() {
        let range = stable_range(d).map_or_else(
            || "at no G".into(),
            |[low, high]| {
                let gaps = if (low..=high).contains(&d.g) { ", with gaps" } else { "" };
                format!("for G from {low:.3} to {high:.3}{gaps}")
            },
        );
        return Some(format!(
            "there is no stable symmetric 1:1 orbit at G = {:.4}; it is stable {range}",
            d.g
        ));
    }
    let place = |orbit: &Orbit| format!("sigma = {:.4}, C = {:.4}", orbit.sigma, orbit.c);
    let places: Vec<String> = stable.iter().map(place).collect();
    let place = format!(
        "at this G, the stable symmetric 1:1 motion is at {}",
        places.join(" and at ")
    );
    let [low, high] = [scene.controller.omega_min, scene.controller.omega_max];
    if !stable.iter().any(|orbit| (low..=high).contains(&orbit.omega)) {
        return Some(format!(
            "{place}, thus at omega = {:.4} omega0, which controller.omega_min = {low} and controller.omega_max = {high} exclude",
            stable[0].omega
        ));
    }
    match regime? {
        Regime::Unknown | Regime::Unresolved | Regime::NotEstablished => None,
        Regime::NoImpacts => Some(format!(
            "the particle does not reach the walls: under a constant drive, impacts begin at G = {:.3}; give it a velocity in [start]; {place}",
            d.lambda
        )),
        Regime::Symmetric => Some(place),
        regime => Some(format!(
            "the motion is {}, and coexists with the wanted one: {place}. Try another G or another [start]",
            regime.name()
        )),
    }
}

/// The regime of the last periods of a record that did not lock, from the impacts that the rig reports.
pub fn last_regime(samples: &[Sample], plan: &Plan) -> Option<Regime> {
    let last = &samples[samples.len().saturating_sub(plan.hold)..];
    let omega = last.last()?.command.drive.omega;
    Some(classify(last, plan.knowledge.sample_time, omega).1)
}
