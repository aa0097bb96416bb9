//! Advice after a run without the expected lock, from the exact orbits of the scene.

use std::f64::consts::FRAC_PI_4;

use vines_model::numerics::range;
use vines_model::orbit::Orbit;
use vines_model::regime::Regime;

use crate::identification::{Cycle, classify};
use crate::record::Sample;
use crate::survey::{phase_resonant, stable_backbone};
use vines_scene::plan::Plan;
use vines_scene::scene::{Dimensionless, Measurand, Scene};

/// Why a run that was expected to lock the symmetric 1:1 motion may not have done so.
#[derive(Debug, Clone, PartialEq)]
#[expect(missing_docs, reason = "each variant explains its fields")]
pub enum Reason {
    /// The loop runs away from resonance ([`runs_away`]).
    WrongSign,
    /// The first impacts are of a particle that moves at the start ([`is_hit_at_once`]).
    HitAtOnce,
    /// No orbit at the drive `g` is stable; on the exact backbone they are stable for drives in a range, in which there may be gaps.
    Unstable { g: f64, range: Option<[f64; 2]> },
    /// The controller may not set the frequency of any of these stable orbits.
    Excluded { stable: Vec<Orbit> },
    /// No phase loop can hold any of these stable orbits ([`can_be_held`]).
    LagsLess { stable: Vec<Orbit> },
    /// The particle does not reach the walls; under a constant drive, impacts begin at `G = onset`.
    NoImpacts { stable: Vec<Orbit>, onset: f64 },
    /// The motion is of this regime, and coexists with these stable orbits.
    Coexists { stable: Vec<Orbit>, regime: Regime },
    /// A limit has cut the motion off on its way; these orbits are stable.
    CutOff { stable: Vec<Orbit> },
}

/// Whether the loop runs away from resonance: its frequency has left the first one in the direction opposite to the one that the phase asks for,
/// and the phase is beyond that of the half-power point. Above resonance the response lags, and the frequency must fall.
pub fn runs_away(samples: &[Sample], plan: &Plan) -> bool {
    // Before that many periods a phase says nothing yet.
    let Some(begin) = samples.len().checked_sub(plan.hold) else {
        return false;
    };
    let cycle = Cycle::of(&samples[begin..], 0.0, &plan.knowledge);
    let first = samples.iter().find(|sample| sample.command.drive.amplitude > 0.0);
    cycle.zip(first).is_some_and(|(cycle, first)| {
        let moved = cycle.omega - first.command.drive.omega;
        cycle.phase_error.abs() > FRAC_PI_4 && moved * cycle.phase_error < 0.0
    })
}

/// Whether the sensor of a simulated rig reads velocities or accelerations, and the particle moves at the start: it then hits before the controller
/// knows the signal, which shows an impact as a step or a peak.
pub fn is_hit_at_once(scene: &Scene, samples: &[Sample]) -> bool {
    let is_simulated = samples.iter().any(|sample| sample.ground_truth.is_some());
    is_simulated && scene.resonance.sensor_quantity != Measurand::Displacement && scene.start.dq2 != 0.0
}

/// Whether a phase loop can hold an orbit of a scene under its drive. Its control is integral: the response has to lag more at a higher frequency, as it
/// does on one oscillator. `d` has the numbers of the driven mode.
pub fn can_be_held(scene: &Scene, d: &Dimensionless, orbit: &Orbit) -> bool {
    if scene.structure.is_none() {
        return true;
    }
    // Degrees by which the frequency of an orbit changes without rounding and without a bend.
    let [before, after] = [-0.02, 0.02].map(|turn| {
        let mut scene = scene.clone();
        scene.controller.phase_target += turn;
        let sigmas = phase_resonant(&scene, d).into_iter().map(|orbit| orbit.sigma);
        sigmas.min_by(|one, other| (one - orbit.sigma).abs().total_cmp(&(other - orbit.sigma).abs()))
    });
    after < before
}

/// The reason from the scene, the numbers of its rig and the regime of the last periods; it holds for the ideal cavity.
/// `None` where the exact orbits give no reason.
pub fn reason(scene: &Scene, d: &Dimensionless, regime: Option<Regime>) -> Option<Reason> {
    let mut stable = phase_resonant(scene, d);
    stable.retain(|orbit| orbit.stable);
    if stable.is_empty() {
        let drives = stable_backbone(scene, d).into_iter().map(|orbit| orbit.g);
        let (low, high) = range((f64::INFINITY, 0.0), drives);
        return Some(Reason::Unstable { g: d.g, range: (low <= high).then_some([low, high]) });
    }
    let allowed = scene.controller.omega_min..=scene.controller.omega_max;
    if !stable.iter().any(|orbit| allowed.contains(&orbit.omega)) {
        return Some(Reason::Excluded { stable });
    }
    if !stable.iter().any(|orbit| can_be_held(scene, d, orbit)) {
        return Some(Reason::LagsLess { stable });
    }
    match regime? {
        Regime::Unknown | Regime::Unresolved | Regime::NotEstablished => None,
        Regime::NoImpacts => Some(Reason::NoImpacts { stable, onset: d.lambda }),
        regime => Some(Reason::Coexists { stable, regime }),
    }
}

/// The reason after a limit has cut the motion off, whose regime says nothing then.
pub fn cut_off(scene: &Scene, d: &Dimensionless) -> Option<Reason> {
    match reason(scene, d, Some(Regime::Other))? {
        Reason::Coexists { stable, .. } => Some(Reason::CutOff { stable }),
        reason => Some(reason),
    }
}

/// The regime of the last periods of a record that did not lock, from the impacts that the rig reports.
pub fn last_regime(samples: &[Sample], plan: &Plan) -> Option<Regime> {
    let last = &samples[samples.len().saturating_sub(plan.hold)..];
    let omega = last.last()?.command.drive.omega;
    Some(classify(last, plan.knowledge.sample_time, omega).1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rig::{Command, Drive, Simulated};

    #[test]
    fn a_frequency_that_leaves_resonance_against_the_phase_shows_the_wrong_sign() {
        let mut scene = Scene::load(None, &[]).unwrap().at_rest();
        scene.amplitude *= 0.01;
        let (plan, omega0) = (scene.plan(), scene.plant.natural_frequency());
        for (from, to, is_wrong) in [
            (1.0, 1.05, true),
            (1.0, 0.95, true),
            (1.1, 1.05, false),
            (0.9, 0.95, false),
        ] {
            let mut rig = Simulated::of(&scene).unwrap();
            let mut phase: f64 = 0.0;
            let mut sample = |n: usize| {
                let omega = omega0 * if n == 0 { from } else { to };
                let amplitude = scene.amplitude;
                let displacement = amplitude * phase.sin();
                let drive = Drive { omega, amplitude, displacement, is_held: false };
                let sensors = rig.sense().unwrap();
                rig.advance(drive, plan.knowledge.sample_time).unwrap();
                phase += omega * plan.knowledge.sample_time;
                Sample {
                    time: n as f64 * plan.knowledge.sample_time,
                    sensors,
                    command: Command { drive, ..Command::default() },
                    ..Sample::default()
                }
            };
            let samples: Vec<Sample> = (0..plan.knowledge.samples(300.0)).map(&mut sample).collect();
            assert_eq!(runs_away(&samples, &plan), is_wrong, "from {from} to {to}");
            // A phase before the response has come says nothing.
            assert!(!runs_away(&samples[..plan.hold - 1], &plan));
        }
    }
}
