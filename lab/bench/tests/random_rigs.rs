//! Random rigs, locked from rest.

use vines_model::orbit::{Orbit, phase_resonant};
use vines_testbench::experiment::{self, Plan};
use vines_testbench::identification::{Lock, Regime, identify};
use vines_testbench::random_rigs::{Outcome, locks};
use vines_testbench::rig::{BuiltIn, Simulated};
use vines_testbench::scene::Scene;

#[test]
fn random_rigs_lock_from_rest_or_say_why_not() {
    let rows = locks(24, 5, &[]).unwrap();
    for row in rows.iter().filter(|row| row.outcome != Outcome::Locked) {
        println!("{row:?}");
        assert!(row.message.as_ref().is_some_and(|message| !message.is_empty()));
    }
    let count = |outcome| rows.iter().filter(|row| row.outcome == outcome).count();
    assert_eq!((count(Outcome::Failed), count(Outcome::Inaccurate)), (0, 0));
    assert_eq!(count(Outcome::Locked), 24);
}

/// The lock of a rig at rest.
fn lock(settings: [&str; 4]) -> Lock {
    let settings: Vec<_> = settings.iter().map(|setting| setting.parse().unwrap()).collect();
    let scene = Scene::parse(
        "rig",
        "[record]\ndecay_periods = 3\n[excitation]\nG = 1.0\n[plant]\nepsilon = 0.01\nlambda = 1.0\nr = 0.65\n",
        &settings,
    )
    .unwrap();
    let mut rig = Simulated::new(scene.plant, scene.start).unwrap();
    let mut controller = BuiltIn::new(&scene.controller_config()).unwrap();
    let record = experiment::run(&mut rig, &mut controller, &Plan::of(&scene), |_, _, _| {}).unwrap();
    identify(&record, &scene).unwrap().lock
}

/// Rigs at rest lock on the symmetric motion of this amplitude over b.
fn assert_locks(rigs: &[([&str; 4], f64)]) {
    for (settings, c) in rigs {
        let lock = lock(*settings);
        assert_eq!(lock.regime, Regime::Symmetric);
        assert!((lock.at.c - c).abs() < 2e-3, "{lock:?}");
    }
}

#[test]
fn orbits_just_above_the_fold_and_just_below_symmetry_breaking_are_reached() {
    assert_locks(&[
        // The drive belongs to a large asymmetric motion, too.
        (
            [
                "plant.epsilon=0.0204",
                "plant.lambda=0.11",
                "plant.r=0.455",
                "excitation.G=0.8023",
            ],
            0.2327,
        ),
        (
            [
                "plant.epsilon=0.0063",
                "plant.lambda=0.651",
                "plant.r=0.862",
                "excitation.G=0.592",
            ],
            0.6817,
        ),
        // Hardly more drive holds the orbit that is unstable under it.
        (
            [
                "plant.epsilon=0.015225885",
                "plant.lambda=0.43366104",
                "plant.r=0.52438008",
                "excitation.G=0.90622505",
            ],
            0.2150,
        ),
        // The first descent ends far above the orbit, and the response falls past it.
        (
            [
                "plant.epsilon=0.044486103",
                "plant.lambda=0.29395524",
                "plant.r=0.46215017",
                "excitation.G=0.81962723",
            ],
            0.2295,
        ),
        // A modulation that decays over 540 periods resembles noise.
        (
            [
                "plant.epsilon=0.046079366",
                "plant.lambda=0.68301824",
                "plant.r=0.27802309",
                "excitation.G=0.89886111",
            ],
            0.3386,
        ),
    ]);
}

#[test]
fn subharmonic_motions_of_the_same_drive_are_left_for_the_symmetric_one() {
    assert_locks(&[
        (
            [
                "plant.epsilon=0.014429842",
                "plant.lambda=0.80932254",
                "plant.r=0.76757213",
                "excitation.G=0.75737775",
            ],
            0.6190,
        ),
        (
            [
                "plant.epsilon=0.0048763899",
                "plant.lambda=2.4297409",
                "plant.r=0.94889327",
                "excitation.G=1.1322403",
            ],
            0.4485,
        ),
    ]);
}

#[test]
fn rigs_are_drawn_within_the_limits_of_the_frequency() {
    let limits = ["controller.omega_min=0.995", "controller.omega_max=1.005"].map(|setting| setting.parse().unwrap());
    for row in locks(3, 9, &limits).unwrap() {
        let orbits = phase_resonant(&row.parameters);
        let is_within = |orbit: &Orbit| orbit.stable && (0.995..=1.005).contains(&orbit.omega);
        assert!(orbits.iter().any(is_within), "{row:?}");
    }
}
