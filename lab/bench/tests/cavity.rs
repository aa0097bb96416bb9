//! Guards scenes of a real cavity: their keys, the lock of the four presets from rest, and what the record says about friction.

use std::path::Path;

use lovines::Restitution;
use vines_model::orbit::phase_resonant;
use vines_testbench::experiment::{Plan, run};
use vines_testbench::identification::{Lock, Regime, identify};
use vines_testbench::rig::{BuiltIn, Simulated};
use vines_testbench::scene::{Dimensionless, Override, Scene, SceneError, plant_keys};

fn set(arguments: &[&str]) -> Vec<Override> {
    arguments.iter().map(|one| one.parse().unwrap()).collect()
}

fn paper(arguments: &[&str]) -> Result<Scene, SceneError> {
    Scene::load(None, &set(arguments))
}

fn preset(name: &str) -> Scene {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../../scenes/{name}.toml"));
    let scene = Scene::load(Some(&path), &[]).unwrap();
    assert_eq!(
        scene.start,
        lovines::State::default(),
        "{name} does not start from rest"
    );
    scene
}

/// The lock, and the relative speed of its last impact, m/s.
fn locked(scene: &Scene) -> (Lock, f64) {
    let plan = Plan { decay: 0, ..Plan::of(scene) };
    let mut controller = BuiltIn::new(&scene.controller_config()).unwrap();
    let record = run(
        Simulated::of(scene).unwrap().as_mut(),
        &mut controller,
        &plan,
        |_, _, _| {},
    );
    let record = record.unwrap();
    let last = record.samples.last().unwrap().ground_truth.unwrap();
    (identify(&record, scene).unwrap().lock, last.impact_velocity.abs())
}

/// The stable exact orbit of an ideal cavity at the scene's drive: sigma and C.
fn exact(scene: &Scene, r: f64) -> [f64; 2] {
    let orbits = phase_resonant(&Dimensionless { r, ..scene.dimensionless() });
    let orbit = orbits.iter().find(|orbit| orbit.stable).unwrap();
    [orbit.sigma, orbit.c]
}

fn is_near(lock: &Lock, [sigma, c]: [f64; 2]) {
    let [sigma, c] = [lock.at.sigma - sigma, lock.at.c - c];
    assert!(sigma.abs() < 1e-4 && c.abs() < 1e-4, "{sigma:.1e} {c:.1e}");
}

#[test]
fn unequal_gaps_move_the_middle_of_the_cavity_only() {
    let scene = preset("skewed");
    let (lock, _) = locked(&scene);
    assert_eq!(lock.regime, Regime::Symmetric);
    is_near(&lock, exact(&scene, 0.65));
    assert!(lock.friction.is_none());
}

#[test]
fn friction_takes_its_force_times_the_path_through_the_cavity() {
    let scene = preset("rough");
    let (lock, _) = locked(&scene);
    assert_eq!(lock.regime, Regime::Symmetric);
    let friction = lock.friction.unwrap();
    assert_eq!(friction.sticks_per_period, 0.0);
    let p = scene.plant;
    let path = 4.0 * p.half_width;
    let expected = 0.05 * p.particle_mass * 9.80665 * path;
    assert!((friction.loss / expected - 1.0).abs() < 1e-2, "{friction:?} {expected}");
}

#[test]
fn a_restitution_of_the_speed_locks_the_orbit_of_its_value_at_that_speed() {
    let scene = preset("viscoelastic");
    let (lock, speed) = locked(&scene);
    assert_eq!(lock.regime, Regime::Symmetric);
    let [plus, minus] = scene.plant.cavity.restitution;
    assert_eq!(plus, minus);
    let Some(Restitution::Viscoelastic(k)) = plus else {
        panic!("{plus:?}")
    };
    is_near(&lock, exact(&scene, 1.0 - k * speed.powf(0.2)));
}

#[test]
fn gravity_along_the_axis_makes_the_locked_motion_asymmetric() {
    let scene = preset("vertical");
    let (lock, _) = locked(&scene);
    assert_eq!(lock.regime, Regime::Asymmetric);
    assert!((lock.impacts_per_period - 2.0).abs() < 0.01);
}

#[test]
fn a_particle_that_sticks_is_counted_and_timed() {
    // With this much friction the particle rides on the floor for a part of every period.
    let scene = paper(&["plant.mu_k=0.4", "excitation.G=2", "start.dq2=1.0"]).unwrap();
    let mut rig = Simulated::of(&scene).unwrap();
    let omega = 0.98 * scene.dimensionless().omega0;
    for _ in 0..5000 {
        let drive = vines_testbench::rig::Drive { omega, amplitude: scene.amplitude, displacement: 0.0 };
        rig.advance(drive, scene.sample_time()).unwrap();
    }
    let friction = rig.ground_truth().unwrap().unwrap().friction.unwrap();
    let elapsed = 5000.0 * scene.sample_time();
    assert!(friction.sticks > 1 && friction.loss > 0.0, "{friction:?}");
    assert!(
        friction.stuck_time > 0.0 && friction.stuck_time < 0.5 * elapsed,
        "{friction:?}"
    );
}

#[test]
fn every_effect_has_a_key_that_the_plant_checks_and_settings_repeat() {
    let settings = [
        "plant.b_plus=0.011",
        "plant.b_minus=0.009",
        "plant.theta=0.1",
        "plant.mu_k=0.05",
        "plant.mu_s=0.07",
        "plant.r_law=plastic",
        "plant.r_plus=0.2",
        "plant.r_minus=0.3",
        "plant.r_min=0.1",
        "plant.r_scatter=0.02",
        "plant.seed=7",
    ];
    let scene = paper(&settings).unwrap();
    let written = serde_json::to_value(&scene).unwrap()["plant"].clone();
    for setting in settings {
        let (key, value) = setting.split_once('=').unwrap();
        let text = written[key.trim_start_matches("plant.")].to_string();
        assert_eq!(text.trim_matches('"'), value, "{key}");
    }
    // What is written is a scene again, and what an FMU gets has the same names.
    let plant = plant_keys(&scene.plant).into_iter();
    let plant: String = plant.map(|(key, value)| format!("{key} = {value}\n")).collect();
    let again = Scene::parse("again.toml", &format!("[plant]\n{plant}[excitation]\nG = 1.1\n"), &[]);
    assert_eq!(again.unwrap().plant, scene.plant);
    let names: Vec<&str> = scene.start_values().iter().map(|(name, _)| *name).collect();
    for name in written.as_object().unwrap().keys() {
        assert!(names.contains(&name.as_str()), "{name}");
    }
    for (setting, allowed) in [
        ("plant.b_plus=-1", "1e-100"),
        ("plant.theta=2", "pi/2"),
        ("plant.mu_k=-0.1", "0 to 100"),
        ("plant.mu_s=0.01", "mu_k"),
        ("plant.r_law=rubber", "viscoelastic"),
        ("plant.r_plus=0", "from 1e-100"),
        ("plant.r_min=2", "0 to 1"),
        ("plant.r_scatter=-1", "0 to 1"),
        ("plant.seed=-1", "whole number"),
    ] {
        let all: Vec<&str> = settings
            .into_iter()
            .filter(|one| !one.starts_with("plant.seed"))
            .collect();
        let error = paper(&[&all[..], &[setting]].concat()).unwrap_err().to_string();
        assert!(error.contains(allowed), "{setting}: {error}");
    }
    let error = paper(&["plant.r_law=plastic"]).unwrap_err().to_string();
    assert!(error.contains("give r_plus"), "{error}");
}

#[test]
fn an_ideal_scene_is_written_as_before_and_leaves_nothing_out() {
    let scene = paper(&["plant.mu_k=0", "plant.theta=0"]).unwrap();
    assert_eq!(scene, paper(&[]).unwrap());
    let written = serde_json::to_value(&scene).unwrap();
    assert_eq!(written["plant"].as_object().unwrap().len(), 6);
    assert_eq!((scene.left_out(), scene.has_mirror_images()), (None, true));
}

#[test]
fn what_theory_leaves_out_is_named() {
    let left_out = |settings: &[&str]| paper(settings).unwrap().left_out().unwrap();
    assert_eq!(left_out(&["plant.mu_k=0.05"]), "friction");
    assert_eq!(
        left_out(&["plant.mu_k=0.05", "plant.theta=0.1", "plant.b_plus=0.011"]),
        "friction, the gaps b_plus and b_minus and tilt"
    );
    assert!(left_out(&["plant.r_minus=0.7"]).starts_with("the restitution"));
    assert!(!paper(&["plant.r_minus=0.7"]).unwrap().has_mirror_images());
    assert_eq!(left_out(&["plant.r_scatter=0.01"]), "the scatter of the restitution");
}
