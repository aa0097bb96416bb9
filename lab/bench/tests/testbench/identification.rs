//! Guards lock, decay and identification on the simulated plant: accuracy against exact orbits, regimes, advice where several or no orbits are
//! stable, and experiments that end early.

use vines_bench::advice::reason;
use vines_bench::comparison::Comparison;
use vines_bench::experiment::{self, ExperimentError};
use vines_bench::identification::{DecayEnd, IdentificationError, Regime, identify};
use vines_bench::plan::Plan;
use vines_bench::record::Sample;
use vines_bench::rig::{BuiltIn, Controller, Fault, Rig, SensorsOnly, Simulated};
use vines_bench::scene::Scene;
use vines_model::orbit::Orbit;

use super::{Foreign, dimensionless, paper, record_of};

/// How an experiment ends early, and its samples.
fn ended(scene: &Scene) -> (ExperimentError, Vec<Sample>) {
    let (mut rig, mut samples) = (Simulated::of(scene).unwrap(), Vec::new());
    let mut controller = BuiltIn::new(&scene.plan().lock).unwrap();
    let record = experiment::run(&mut samples, &mut *rig, &mut controller, &scene.plan(), |_, _| {});
    (record.unwrap_err(), samples)
}

/// A controller that cannot control the response: it holds the drive.
fn constant_drive(scene: &Scene) -> impl Controller {
    Foreign::new(&scene.plan().lock, |_: &mut _, _| Ok(()))
}

/// What is identified on a rig.
fn identified_by(
    rig: &mut dyn Rig,
    controller: &mut dyn Controller,
    scene: &Scene,
    plan: &Plan,
) -> Result<Comparison, IdentificationError> {
    let record = experiment::run(&mut Vec::new(), rig, controller, plan, |_, _| {}).unwrap();
    Ok(Comparison::of(&identify(&record, plan)?, scene))
}

fn identified_in(scene: &Scene) -> Comparison {
    Comparison::of(&super::identified(scene).unwrap(), scene)
}

fn identified(settings: &str) -> Comparison {
    identified_in(&dimensionless(settings))
}

/// The exact orbit at the requested drive that a lock followed.
fn followed(found: &Comparison) -> Orbit {
    let apart = |orbit: &Orbit| (orbit.sigma - found.lock.at.sigma).hypot(orbit.c - found.lock.at.c);
    let orbits = found.orbits.iter().copied();
    orbits.min_by(|one, other| apart(one).total_cmp(&apart(other))).unwrap()
}

/// How far a lock is off the exact orbit of the same C: in sigma and G.
fn off(found: &Comparison) -> [f64; 2] {
    let (at, periods) = (found.lock.at, found.lock.periods_to_lock);
    let exact = found.curve.distance(at.c, at.sigma, at.g).unwrap();
    let [sigma, g] = [exact.sigma, exact.g].map(Option::unwrap);
    assert!((at.g / 1.1 - 1.0).abs() < 0.01, "{at:?}");
    println!(
        "after {periods:.0} periods: sigma off by {sigma:.1e}; G {:.5}, off by {g:.1e}",
        at.g
    );
    [sigma, g].map(f64::abs)
}

/// What sensors measure.
const QUANTITIES: [&str; 3] = ["displacement", "velocity", "acceleration"];

#[test]
fn the_lock_is_the_exact_orbit_for_every_sensor_and_reference_and_nearer_to_it_after_a_longer_wait() {
    for reference in ["resonance.reference='base'", "resonance.reference='force'"] {
        for sensor in ["v", "q1", "q1' resonance.sensor_quantity='acceleration"] {
            // The impacts leave a ripple on an accelerometer, which averages out over a long hold.
            let settings = format!("{reference} resonance.sensor='{sensor}' record.hold_periods=200");
            let found = identified(&settings);
            assert!(off(&found).iter().all(|off| *off < 2e-4), "{reference} {sensor}");
        }
    }
    for of_response in QUANTITIES {
        for of_base in QUANTITIES {
            let settings = format!(
                "resonance.sensor='q1' resonance.sensor_quantity='{of_response}' resonance.reference_quantity='{of_base}' record.hold_periods=200"
            );
            let found = identified(&settings);
            assert!(off(&found).iter().all(|off| *off < 2e-4), "{settings}");
            assert!(found.lock.at.phase_error_deg.abs() < 0.3);
        }
    }
    let found = identified("phase_lock.lock.amplitude_drift=3.8e-9 phase_lock.lock.frequency_drift=4.5e-10");
    assert!(off(&found).iter().all(|off| *off < 1e-5));
    assert!(found.exact.unwrap().stable && found.lock.regime == Regime::Symmetric);
    let found = identified_in(&paper(&[]));
    assert!(off(&found)[0] < 1.2e-4 && found.lock.periods_to_lock <= 155.0);
}

#[test]
fn a_rig_that_does_not_report_its_impacts_is_identified_from_its_response() {
    let scene = dimensionless("");
    let mut rig = SensorsOnly(Simulated::of(&scene).unwrap());
    assert_eq!(rig.ground_truth().unwrap(), None);
    let mut controller = BuiltIn::new(&scene.plan().lock).unwrap();
    let mute = identified_by(&mut rig, &mut controller, &scene, &scene.plan()).unwrap();
    let telling = identified("");
    assert_eq!(mute.lock.regime, Regime::Symmetric);
    assert!(mute.lock.impacts_per_period.is_nan());
    assert_eq!(mute.lock.at.sigma, telling.lock.at.sigma);
    // The decay ends where the impacts do, below the fold, and is the same until there.
    let fold = 0.134;
    assert!(mute.decay.iter().all(|one| one.point.c > 0.6 * fold));
    assert_eq!(mute.rms_sigma_error, telling.rms_sigma_error);
}

#[test]
fn a_lock_of_the_linear_mode_or_of_an_asymmetric_motion_is_refused() {
    // Under a constant drive nothing ever hits a particle at rest in the middle, and the loop locks all the same, at sigma = 0.
    let rest = dimensionless("start.dq2=0");
    // Only the loop check knows the linear response of such a rig.
    let stated = rest.knowledge();
    let checked = stated.measured(rest.knowledge().linear);
    for (knowledge, expected) in [(stated, Regime::NotEstablished), (checked, Regime::NoImpacts)] {
        let mut rig = SensorsOnly(Simulated::of(&rest).unwrap());
        let found = identified_by(&mut rig, &mut constant_drive(&rest), &rest, &rest.plan_on(knowledge));
        let refusal = found.unwrap_err();
        let is_expected = matches!(refusal, IdentificationError::Regime { regime, .. } if regime == expected);
        assert!(is_expected, "{refusal}");
    }
    // With the response held, the experiment would search for the symmetric motion.
    for (scene, expected, detunings) in [
        (rest, Regime::NoImpacts, -0.05..0.05),
        (dimensionless("excitation.G=1.7"), Regime::Asymmetric, -5.0..5.0),
    ] {
        let mut rig = Simulated::of(&scene).unwrap();
        let refusal = identified_by(&mut *rig, &mut constant_drive(&scene), &scene, &scene.plan()).unwrap_err();
        let IdentificationError::Regime { regime, sigma, .. } = refusal else {
            panic!("{refusal}");
        };
        assert!(regime == expected && detunings.contains(&sigma), "{regime} {sigma}");
    }
}

#[test]
fn the_slow_flow_predicts_the_measured_decay_better_than_the_backbone() {
    for settings in ["", "plant.epsilon=0.02", "plant.r=0.8"] {
        let found = identified(settings);
        let (raw, predicted) = (found.rms_sigma_exact.unwrap(), found.rms_sigma_slow_flow.unwrap());
        println!("{settings}: against the backbone {raw:.4}, against the slow flow {predicted:.5}");
        assert!(predicted <= raw / 2.0);
        assert_eq!(found.decay_end, DecayEnd::Synchrony);
    }
}

#[test]
fn a_decay_too_short_for_points_keeps_the_lock_and_says_that_the_record_ended() {
    let scene = dimensionless("record.hold_periods=3 record.decay_periods=1");
    let record = record_of(&scene);
    // The sample at which the lock had settled opens the hold.
    assert_eq!((record.hold().len(), record.decay().len()), (301, 100));
    let mut drives = record.decay().iter().map(|sample| sample.command.drive);
    assert!(drives.all(|drive| drive.amplitude == 0.0 && drive.displacement == 0.0));
    let found = Comparison::of(&identify(&record, &scene.plan()).unwrap(), &scene);
    assert!(found.decay.is_empty() && found.exact.is_some());
    assert_eq!(found.decay_end, DecayEnd::Record);
}

#[test]
fn a_lock_through_30_db_takes_less_than_twice_the_periods_and_states_how_far_off_it_is() {
    let found = identified("chain.snr=30");
    let lock = found.lock;
    let exact = found.curve.distance(lock.at.c, lock.at.sigma, lock.at.g).unwrap();
    println!("{lock:?}");
    assert!(lock.periods_to_lock <= 2.0 * identified("").lock.periods_to_lock);
    assert!(exact.sigma.unwrap().abs() <= 4.0 * lock.at.u_sigma && lock.at.u_sigma < 0.01);
    assert!(exact.g.unwrap().abs() <= 4.0 * lock.at.u_g && lock.at.u_g < 0.01);
}

#[test]
fn of_two_stable_orbits_the_one_that_was_not_followed_is_named_and_so_are_gaps_between_them() {
    let settings = "plant.epsilon=0.0038 plant.lambda=0.512 plant.r=0.506 excitation.G=0.93 start.dq2=0";
    let found = identified(settings);
    let stable: Vec<_> = found.orbits.iter().filter(|orbit| orbit.stable).collect();
    assert_eq!(stable.len(), 2);
    let exact = found.exact.unwrap();
    assert!((exact.c / found.lock.at.c - 1.0).abs() < 1e-9, "{:?}", found.lock);
    let followed = followed(&found);
    assert!((found.lock.at.c - followed.c).abs() < 2e-3, "{:?}", found.lock);
    // A motion that is neither of them is told about both.
    let refused = dimensionless(settings);
    let places = stable
        .iter()
        .map(|orbit| format!("sigma = {:.4}, C = {:.4}", orbit.sigma, orbit.c));
    let places = places.collect::<Vec<_>>().join(" and at ");
    assert_eq!(
        reason(&refused, &refused.dimensionless(), Some(Regime::Asymmetric)),
        Some(format!(
            "the motion is asymmetric 1:1, and coexists with the wanted one: at this G, the stable symmetric 1:1 motion is at {places}. Try another G or \
             another [start]"
        ))
    );
    for orbit in stable {
        assert_eq!(found.others().any(|other| other == orbit), *orbit != followed);
    }
    let gap = dimensionless("plant.epsilon=0.02 plant.lambda=0.4 plant.r=0.8 excitation.G=0.7");
    let unstable =
        "there is no stable symmetric 1:1 orbit at G = 0.7000; it is stable for G from 0.415 to 0.824, with gaps";
    assert_eq!(reason(&gap, &gap.dimensionless(), None).as_deref(), Some(unstable));
    // The file names all of them, and the one with the measured response.
    let file = serde_json::to_value(&found).unwrap();
    assert_eq!(file["orbits"].as_array().unwrap().len(), found.orbits.len());
    assert_eq!(file["exact"]["C"], exact.c);
}

#[test]
fn a_sensor_of_two_bits_has_no_phase_rather_than_a_phase_error_of_zero() {
    let coarse = "chain.adc_bits=2 phase_lock.signal_timeout='none' phase_lock.residual_max='none'";
    let coarse = dimensionless(&format!("{coarse} phase_lock.acquire_timeout=31.4"));
    let message = ended(&coarse).0.to_string();
    assert!(message.contains("the phase cannot be measured"), "{message}");
}

#[test]
fn a_response_above_its_limit_ends_the_experiment_at_once_and_keeps_what_was_measured() {
    let scene = dimensionless("phase_lock.response_max=0.3");
    let (error, samples) = ended(&scene);
    let ExperimentError::Tripped { periods, fault: Fault::ResponseTooLarge, .. } = error else {
        panic!("{error}");
    };
    let message = error.to_string();
    for words in [
        "the response exceeded its limit; the response read",
        "phase_lock.response_max is 0.3 m",
    ] {
        assert!(periods < 50.0 && message.contains(words), "{message}");
    }
    let last = samples.last().unwrap();
    assert!(last.sensors.response.abs() > 0.3 && samples.len() > 100);
    let table = vines_bench::record::table(&samples, &scene.knowledge().target);
    assert_eq!(table.lines().count(), samples.len() + 1);
}
