//! The whole experiment on the plant itself, with no FMU in between.

mod failures;
mod orbits;

use vines::comparison::Comparison;
use vines::experiment::{self, Plan};
use vines::identification::{DecayEnd, IdentificationError, Regime, identify};
use vines::record::Record;
use vines::rig::{
    BuiltIn, Chain, Command, Controller, ControllerError, GroundTruth, Rig, Sensors, SensorsOnly, Simulated,
};
use vines::scene::{LinearResponse, Override, Scene};

fn scene(settings: &[&str]) -> Scene {
    let overrides: Vec<Override> = settings.iter().map(|s| s.parse().unwrap()).collect();
    let text = include_str!("../../../scenes/dimensionless.toml");
    Scene::parse("dimensionless.toml", text, &overrides).unwrap()
}

fn plan(scene: &Scene) -> Plan<'_> {
    Plan::of(scene)
}

fn measure(scene: &Scene) -> Record {
    let mut rig = Simulated::new(scene.plant, scene.start)
        .unwrap()
        .with_sensors(scene.resonance);
    let mut controller = BuiltIn::new(&scene.controller_config()).unwrap();
    experiment::run(&mut rig, &mut controller, &plan(scene), |_, _, _| {}).unwrap()
}

/// A controller that cannot control the response: it holds the drive.
struct ConstantDrive(BuiltIn);

impl ConstantDrive {
    fn new(scene: &Scene) -> Self {
        Self(BuiltIn::new(&scene.controller_config()).unwrap())
    }
}

impl Controller for ConstantDrive {
    fn sample(&mut self, sensors: Sensors, active: bool) -> Result<Command, ControllerError> {
        self.0.sample(sensors, active)
    }
}

fn identified(settings: &[&str]) -> Comparison {
    let scene = scene(settings);
    Comparison::of(&identify(&measure(&scene), &scene).unwrap(), &scene)
}

#[test]
fn the_lock_is_the_exact_orbit_within_5e_3_in_sigma_and_half_a_percent_in_amplitude() {
    let found = identified(&[]);
    let exact = found.exact.unwrap();
    let (sigma, c) = (found.lock.at.sigma - exact.sigma, found.lock.at.c / exact.c - 1.0);
    println!("sigma off by {sigma:.1e}, C by {:.2} %", 100.0 * c);
    assert!(sigma.abs() < 5e-3 && c.abs() < 5e-3);
    assert!(exact.stable && found.lock.regime == Regime::Symmetric);
    assert!(found.lock.at.phase_error_deg.abs() < 0.3);
}

#[test]
fn a_longer_wait_brings_the_lock_closer_to_the_exact_orbit() {
    let strict = [
        "controller.amplitude_tolerance=1e-7",
        "controller.frequency_tolerance=1e-6",
    ];
    let found = identified(&strict);
    let exact = found.exact.unwrap();
    let (sigma, c) = (found.lock.at.sigma - exact.sigma, found.lock.at.c / exact.c - 1.0);
    println!(
        "after {:.0} periods: sigma off by {sigma:.1e}, C by {c:.1e}",
        found.lock.periods_to_lock
    );
    assert!(sigma.abs() < 1e-5 && c.abs() < 1e-5);
}

#[test]
fn the_lock_is_the_exact_orbit_for_every_sensor_and_reference() {
    let lock = |settings: &[&str]| {
        let found = identified(settings);
        let (exact, lock) = (found.exact.unwrap(), found.lock);
        let (sigma, c) = (lock.at.sigma - exact.sigma, lock.at.c / exact.c - 1.0);
        println!(
            "{settings:?}: sigma {:.5}, off by {sigma:.1e}; C {:.5}, off by {c:.1e}",
            lock.at.sigma, lock.at.c
        );
        (sigma.abs(), c.abs())
    };
    for reference in ["resonance.reference='base'", "resonance.reference='force'"] {
        for sensor in ["v", "q1", "acceleration"] {
            let sensor = format!("resonance.sensor='{sensor}'");
            // The impacts leave a ripple on an accelerometer, which averages out over a long hold.
            let (sigma, c) = lock(&[reference, &sensor, "record.hold_periods=200"]);
            assert!(sigma < 2e-3 && c < 2e-3, "{reference} {sensor}");
        }
    }
}

#[test]
fn the_decay_follows_theory_and_the_distance_halves_with_epsilon() {
    let rms = |settings: &[&str]| identified(settings).rms_sigma_error.unwrap();
    let (full, half) = (rms(&[]), rms(&["plant.epsilon=0.0042"]));
    println!("RMS of sigma over C > 0.2: {full:.4}, at half epsilon {half:.4}");
    assert!(full <= 0.08);
    assert!((0.4..0.6).contains(&(half / full)));
}

#[test]
fn a_lock_of_the_linear_mode_is_not_taken_for_the_impacting_one() {
    // Under a constant drive nothing ever hits a particle at rest in the middle, and the loop locks all the same, at sigma = 0.
    let scene = scene(&["start.dq2=0"]);
    let mut rig = Simulated::new(scene.plant, scene.start).unwrap();
    let record = experiment::run(&mut rig, &mut ConstantDrive::new(&scene), &plan(&scene), |_, _, _| {}).unwrap();
    let refusal = identify(&record, &scene).unwrap_err();
    let IdentificationError::Regime { regime, sigma, .. } = refusal else {
        panic!("{refusal}");
    };
    assert_eq!(regime, Regime::NoImpacts);
    assert!(sigma.abs() < 0.05, "{sigma}");
}

#[test]
fn from_rest_the_experiment_reaches_the_symmetric_orbit() {
    let found = identified(&["start.dq2=0.0"]);
    let exact = found.exact.unwrap();
    let (sigma, c) = (found.lock.at.sigma - exact.sigma, found.lock.at.c - exact.c);
    println!(
        "after {:.0} periods: sigma off by {sigma:.1e}, C by {c:.1e}",
        found.lock.periods_to_lock
    );
    assert!(sigma.abs() < 1e-3 && c.abs() < 1e-3 && found.lock.regime == Regime::Symmetric);
    assert!(found.lock.periods_to_lock < 400.0);
}

#[test]
fn the_default_lock_takes_at_most_150_periods() {
    let scene = Scene::load(None, &[]).unwrap();
    let found = Comparison::of(&identify(&measure(&scene), &scene).unwrap(), &scene);
    let exact = found.exact.unwrap();
    assert!(found.lock.periods_to_lock <= 150.0, "{}", found.lock.periods_to_lock);
    assert!((found.lock.at.sigma - exact.sigma).abs() < 1.2e-4);
}

/// What is identified on a rig that does not report its impacts.
fn identified_without_ground_truth(scene: &Scene) -> Result<Comparison, IdentificationError> {
    let mut rig = SensorsOnly::around(Box::new(Simulated::new(scene.plant, scene.start).unwrap()));
    assert_eq!(rig.ground_truth().unwrap(), None::<GroundTruth>);
    let record = if scene.start.dq2 == 0.0 {
        experiment::run(&mut rig, &mut ConstantDrive::new(scene), &plan(scene), |_, _, _| {}).unwrap()
    } else {
        let mut controller = BuiltIn::new(&scene.controller_config()).unwrap();
        experiment::run(&mut rig, &mut controller, &plan(scene), |_, _, _| {}).unwrap()
    };
    Ok(Comparison::of(&identify(&record, scene)?, scene))
}

#[test]
fn a_rig_that_does_not_report_its_impacts_is_identified_from_its_response() {
    let (mute, telling) = (identified_without_ground_truth(&scene(&[])).unwrap(), identified(&[]));
    assert_eq!(mute.lock.regime, Regime::Symmetric);
    assert!(mute.lock.impacts_per_period.is_nan());
    assert_eq!(mute.lock.at.sigma, telling.lock.at.sigma);
    // The decay ends where the impacts do, below the fold, and is the same until there.
    let fold = 0.134;
    assert!(mute.decay.iter().all(|one| one.point.c > 0.6 * fold));
    assert_eq!(mute.rms_sigma_error, telling.rms_sigma_error);
    let table = vines::report::summary::identification(&mute);
    assert!(
        table.contains("symmetric 1:1, determined from the response alone"),
        "{table}"
    );
}

#[test]
fn the_linear_mode_of_a_rig_that_does_not_report_its_impacts_is_refused() {
    let mut scene = scene(&["start.dq2=0"]);
    // Only the loop check knows the linear response of such a rig.
    let checked = Some(LinearResponse::of(&scene));
    for (measured, expected) in [(None, Regime::NotEstablished), (checked, Regime::NoImpacts)] {
        scene.measured = measured;
        let refusal = identified_without_ground_truth(&scene).unwrap_err();
        let IdentificationError::Regime { regime, .. } = refusal else {
            panic!("{refusal}");
        };
        assert_eq!(regime, expected);
    }
}

#[test]
fn the_decay_of_the_exact_plant_predicts_the_measured_one_a_hundred_times_better_than_the_backbone() {
    for settings in [&[][..], &["plant.epsilon=0.02"], &["plant.r=0.8"]] {
        let found = identified(settings);
        let (raw, predicted) = (found.rms_sigma_exact.unwrap(), found.rms_sigma_predicted.unwrap());
        println!("{settings:?}: against the backbone {raw:.4}, against the prediction {predicted:.5}");
        assert!(predicted <= raw / 100.0);
        assert_eq!(found.decay_end, DecayEnd::Synchrony);
    }
}

#[test]
fn a_decay_too_short_for_points_keeps_the_lock_and_says_that_the_record_ended() {
    let found = identified(&["record.decay_periods=1", "record.window_periods=1"]);
    assert!(found.decay.is_empty() && found.exact.is_some());
    assert_eq!(found.decay_end, DecayEnd::Record);
    assert!(vines::report::summary::identification(&found).contains("no points"));
}

#[test]
fn a_lock_through_30_db_takes_less_than_twice_the_periods_and_states_how_far_off_it_is() {
    let scene = scene(&["chain.snr=30"]);
    let plant = Box::new(Simulated::new(scene.plant, scene.start).unwrap());
    let mut rig = Chain::new(plant, &scene);
    let mut controller = BuiltIn::new(&scene.controller_config()).unwrap();
    let record = experiment::run(&mut rig, &mut controller, &plan(&scene), |_, _, _| {}).unwrap();
    let found = Comparison::of(&identify(&record, &scene).unwrap(), &scene);
    let (lock, exact) = (found.lock, found.exact.unwrap());
    println!("{lock:?}");
    assert!(lock.periods_to_lock <= 2.0 * identified(&[]).lock.periods_to_lock);
    assert!((lock.at.sigma - exact.sigma).abs() <= 4.0 * lock.at.u_sigma && lock.at.u_sigma < 0.01);
    assert!((lock.at.c - exact.c).abs() <= 4.0 * lock.at.u_c && lock.at.u_c < 0.01);
}
