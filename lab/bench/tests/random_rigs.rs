//! Guards that rigs at rest, drawn at random or difficult, lock on the exact orbit of their drive; `studies/locks.rs` takes more of them.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use vines_model::Dimensionless;
use vines_model::orbit::phase_resonant;
use vines_testbench::advice;
use vines_testbench::experiment::{self, Plan};
use vines_testbench::identification::{Lock, Regime, identify};
use vines_testbench::rig::{BuiltIn, Simulated};
use vines_testbench::scene::Scene;

#[test]
fn random_rigs_lock_from_rest_within_2e_3_of_a_stable_orbit() {
    let mut random = ChaCha8Rng::seed_from_u64(5);
    let mut uniform = move |low: f64, high: f64| low + (high - low) * (random.next_u64() as f64 / u64::MAX as f64);
    let mut locked = 0;
    while locked < 24 {
        let (epsilon, lambda) = (
            uniform(1e-3_f64.ln(), 0.05_f64.ln()).exp(),
            uniform(0.1_f64.ln(), 3_f64.ln()).exp(),
        );
        let (r, share) = (uniform(0.2, 0.97), uniform(0.0, 1.0));
        let d = Dimensionless::new(epsilon, lambda, r, 0.0);
        let Some([low, high]) = advice::stable_range(&d) else {
            continue;
        };
        let d = Dimensionless { g: low + share * (high - low), ..d };
        let mut orbits = phase_resonant(&d);
        if !orbits
            .iter()
            .any(|orbit| orbit.stable && (0.8..=1.2).contains(&orbit.omega))
        {
            continue;
        }
        let values = [
            ("plant.epsilon", epsilon),
            ("plant.lambda", lambda),
            ("plant.r", r),
            ("excitation.G", d.g),
        ];
        let settings = values.map(|(key, value)| format!("{key}={value:?}"));
        let limits = ["controller.omega_min=0.8", "controller.omega_max=1.2"];
        let lock = lock(settings.iter().map(String::as_str).chain(limits));
        // A held response needs no stability under a constant drive.
        orbits.retain(|orbit| orbit.stable || lock.held);
        let is_near = |c: f64, sigma: f64| (c - lock.at.c).abs().max((sigma - lock.at.sigma).abs()) <= 2e-3;
        assert!(
            orbits.iter().any(|orbit| is_near(orbit.c, orbit.sigma)),
            "{settings:?}: {lock:?}"
        );
        locked += 1;
    }
}

/// The lock of a rig at rest.
fn lock<'a>(settings: impl IntoIterator<Item = &'a str>) -> Lock {
    let settings: Vec<_> = settings.into_iter().map(|setting| setting.parse().unwrap()).collect();
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
