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

/// Whether the loop runs away from resonance: its frequency has left the first one in the direction opposite to the one that the phase asks for,
/// and the phase is beyond that of the half-power point. Above resonance the response lags, and the frequency must fall.
pub fn runs_away(samples: &[Sample], plan: &Plan) -> Option<String> {
    // Before that many periods a phase says nothing yet.
    let begin = samples.len().checked_sub(plan.hold)?;
    let cycle = Cycle::of(&samples[begin..], 0.0, &plan.knowledge)?;
    let first = samples.iter().find(|sample| sample.command.drive.amplitude > 0.0)?;
    let moved = cycle.omega - first.command.drive.omega;
    let is_away = cycle.phase_error.abs() > FRAC_PI_4 && moved * cycle.phase_error < 0.0;
    is_away.then(|| {
        "the loop runs away from resonance: its frequency rises while the response lags, or falls while it leads. The sign of the controller's gain, or \
         of its phase, is wrong"
            .into()
    })
}

/// Whether the sensor of a simulated rig reads velocities or accelerations, and the particle moves at the start: it then hits before the controller
/// knows the signal, which shows an impact as a step or a peak.
pub fn hit_at_once(scene: &Scene, samples: &[Sample]) -> Option<String> {
    let is_simulated = samples.iter().any(|sample| sample.ground_truth.is_some());
    let is_hit = is_simulated && scene.resonance.sensor_quantity != Measurand::Displacement && scene.start.dq2 != 0.0;
    is_hit.then(|| {
        "the particle moves at the start and hits before the controller knows the signal, in which an impact is a step or a peak; set start.dq2 = 0: \
         the search brings impacts about"
            .into()
    })
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

/// Why a run that was expected to lock the symmetric 1:1 motion has not done so, and what to do: from the exact orbits of the scene, which are those of
/// the ideal cavity, the numbers of its rig and the regime of the last periods. `None` where they give no reason.
pub fn reason(scene: &Scene, d: &Dimensionless, regime: Option<Regime>) -> Option<String> {
    let ideal = |text| in_ideal_cavity(text, scene.left_out_of_cavity());
    let places = match can_lock(scene, d) {
        Err(reason) => return Some(ideal(reason)),
        Ok(places) => places,
    };
    Some(match regime? {
        Regime::Unknown | Regime::Unresolved | Regime::NotEstablished => return None,
        // The exact orbits are those of all modes of a structure; only the onset of impacts is of one oscillator.
        Regime::NoImpacts => in_ideal_cavity(
            format!(
                "the particle does not reach the walls: under a constant drive, impacts begin at G = {:.3}; give it a velocity in [start]; {places}",
                d.lambda
            ),
            scene.left_out(),
        ),
        Regime::Symmetric => ideal(places),
        regime => ideal(format!(
            "the motion is {}, and coexists with the wanted one: {places}. Try another G or another [start]",
            regime.name()
        )),
    })
}

/// The reason after a limit has cut the motion off, whose regime says nothing then.
pub fn cut_off(scene: &Scene, d: &Dimensionless) -> String {
    let text = match can_lock(scene, d) {
        Ok(places) => format!("the limit cut the motion off before it settled; {places}"),
        Err(reason) => reason,
    };
    in_ideal_cavity(text, scene.left_out_of_cavity())
}

/// What a statement that holds for the ideal cavity leaves out.
fn in_ideal_cavity(text: String, left_out: Option<String>) -> String {
    match left_out {
        Some(left_out) => format!("{text}. This holds for the ideal cavity, without {left_out}"),
        None => text,
    }
}

/// Where the stable exact orbits under the drive are, if the loop may and can hold one of them; otherwise why not. On the exact backbone, orbits are
/// stable for drives in a range, in which there may be gaps.
fn can_lock(scene: &Scene, d: &Dimensionless) -> Result<String, String> {
    let mut stable = phase_resonant(scene, d);
    stable.retain(|orbit| orbit.stable);
    if stable.is_empty() {
        let drives = stable_backbone(scene, d).into_iter().map(|orbit| orbit.g);
        let (low, high) = range((f64::INFINITY, 0.0), drives);
        let gaps = if (low..=high).contains(&d.g) { ", with gaps" } else { "" };
        let range = match low <= high {
            true => format!("for G from {low:.3} to {high:.3}{gaps}"),
            false => "at no G".into(),
        };
        let g = d.g;
        return Err(format!(
            "there is no stable symmetric 1:1 orbit at G = {g:.4}; it is stable {range}"
        ));
    }
    let place = |orbit: &Orbit| format!("sigma = {:.4}, C = {:.4}", orbit.sigma, orbit.c);
    let places: Vec<String> = stable.iter().map(place).collect();
    let places = format!(
        "at this G, the stable symmetric 1:1 motion is at {}",
        places.join(" and at ")
    );
    let [least, most] = [scene.controller.omega_min, scene.controller.omega_max];
    if !stable.iter().any(|orbit| (least..=most).contains(&orbit.omega)) {
        return Err(format!(
            "{places}, thus at omega = {:.4} omega0, which controller.omega_min = {least} and controller.omega_max = {most} exclude",
            stable[0].omega
        ));
    }
    if !stable.iter().any(|orbit| can_be_held(scene, d, orbit)) {
        return Err(format!(
            "{places}, where under a constant drive the response lags less at a higher frequency: no phase loop holds it. Try another G"
        ));
    }
    Ok(places)
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
            assert_eq!(runs_away(&samples, &plan).is_some(), is_wrong, "from {from} to {to}");
            // A phase before the response has come says nothing.
            assert_eq!(runs_away(&samples[..plan.hold - 1], &plan), None);
        }
    }
}
