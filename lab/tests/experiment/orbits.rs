//! Drives with several stable orbits or with none: which one was followed, and what the messages say about the others.

use vines::experiment;
use vines::identification::{IdentificationError, Regime, identify};
use vines::record::Record;
use vines::rig::{BuiltIn, Simulated};

use crate::{ConstantDrive, identified, plan, scene};

#[test]
fn of_two_stable_orbits_the_one_that_was_not_followed_is_named() {
    let settings = [
        "plant.epsilon=0.0038",
        "plant.lambda=0.512",
        "plant.r=0.506",
        "excitation.G=0.93",
        "start.dq2=0",
    ];
    let found = identified(&settings);
    let stable: Vec<_> = found.orbits.iter().filter(|orbit| orbit.stable).collect();
    assert_eq!(stable.len(), 2);
    let followed = found.exact.unwrap();
    assert!((found.lock.at.c - followed.c).abs() < 2e-3, "{:?}", found.lock);
    let other = stable.into_iter().find(|orbit| **orbit != followed).unwrap();
    let table = vines::report::summary::identification(&found);
    let line = format!(
        "(another stable orbit at this G, not followed: sigma = {:.4}, C = {:.4}",
        other.sigma, other.c
    );
    assert!(table.contains(&line), "{table}");
    // A motion that is neither of them is told about both.
    let refused = vines::advice::reason(&scene(&settings), Some(Regime::Asymmetric)).unwrap();
    for orbit in found.orbits.iter().filter(|orbit| orbit.stable) {
        let place = format!("sigma = {:.4}, C = {:.4}", orbit.sigma, orbit.c);
        assert!(refused.contains(&place), "{refused}");
    }
    // The file names all of them, and the one that was followed.
    let file = serde_json::to_value(&found).unwrap();
    assert_eq!(file["orbits"].as_array().unwrap().len(), found.orbits.len());
    assert_eq!(file["exact"]["C"], followed.c);
}

#[test]
fn of_an_asymmetric_pair_the_motion_that_was_followed_is_named() {
    let scene = scene(&["excitation.G=1.7"]);
    let mut rig = Simulated::new(scene.plant, scene.start).unwrap();
    // With the response held, the experiment searches for the symmetric motion.
    let mut controller = ConstantDrive::new(&scene);
    let record = experiment::run(&mut rig, &mut controller, &plan(&scene), |_, _, _| {}).unwrap();
    let mut image = record.clone();
    for truth in image
        .samples
        .iter_mut()
        .filter_map(|sample| sample.ground_truth.as_mut())
    {
        truth.impact_velocity = -truth.impact_velocity;
    }
    let wall = |record: &Record| {
        let refusal = identify(record, &scene).unwrap_err();
        assert!(
            refusal.to_string().contains("mirror image with the same sigma and C"),
            "{refusal}"
        );
        let IdentificationError::Regime { regime: Regime::Asymmetric, longer, .. } = refusal else {
            panic!("{refusal}");
        };
        longer.unwrap()
    };
    assert_eq!(wall(&record), -wall(&image));
}

#[test]
fn a_drive_without_a_stable_orbit_ends_the_search_with_a_reason() {
    let scene = scene(&["excitation.G=0.9", "start.dq2=0"]);
    let mut rig = Simulated::new(scene.plant, scene.start).unwrap();
    let mut controller = BuiltIn::new(&scene.controller_config()).unwrap();
    let mut samples = Vec::new();
    let ended = experiment::run_into(&mut samples, &mut rig, &mut controller, &plan(&scene), |_, _, _| {});
    assert!(
        matches!(
            ended,
            Err(experiment::ExperimentError::NotReached { .. } | experiment::ExperimentError::NoLock { .. })
        ),
        "{ended:?}"
    );
    let reason = vines::advice::reason(&scene, None).unwrap();
    assert!(
        reason.contains("no stable symmetric 1:1 orbit at G = 0.9000; it is stable for G from"),
        "{reason}"
    );
}

#[test]
fn a_gap_in_the_range_of_stable_orbits_is_stated() {
    let scene = scene(&[
        "plant.epsilon=0.02",
        "plant.lambda=0.4",
        "plant.r=0.8",
        "excitation.G=0.7",
    ]);
    let reason = vines::advice::reason(&scene, None).unwrap();
    assert!(
        reason.ends_with("it is stable for G from 0.415 to 0.486 and from 0.822 to 0.824"),
        "{reason}"
    );
}
