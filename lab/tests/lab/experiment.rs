//! Guards lock, decay and identification on the simulated plant: accuracy against exact orbits, regimes, advice where several or no orbits are
//! stable, and experiments that end early.

use vines::comparison::Comparison;
use vines::experiment::{self, ExperimentError};
use vines::identification::{DecayEnd, IdentificationError, Regime, identify};
use vines::record::Record;
use vines::rig::{
    BuiltIn, Chain, Command, Controller, ControllerError, Drive, Fault, GroundTruth, Rig, RigError, Sensors,
    SensorsOnly, Simulated,
};
use vines::scene::{LinearResponse, Scene};

use crate::{built_in, plant, scene};

fn run(
    rig: &mut (impl Rig + ?Sized),
    controller: &mut impl Controller,
    scene: &Scene,
) -> Result<Record, ExperimentError> {
    experiment::run(rig, controller, scene, |_, _, _| {})
}

fn measure(scene: &Scene) -> Record {
    run(&mut plant(scene), &mut built_in(scene), scene).unwrap()
}

/// A controller that cannot control the response: it holds the drive.
pub struct ConstantDrive(BuiltIn);

impl ConstantDrive {
    pub fn new(scene: &Scene) -> Self {
        Self(built_in(scene))
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
fn a_longer_wait_brings_the_lock_closer_to_the_exact_orbit() {
    let strict = [
        "phase_lock.lock.amplitude_drift=3.8e-9",
        "phase_lock.lock.frequency_drift=4.5e-10",
    ];
    let found = identified(&strict);
    let exact = found.exact.unwrap();
    let (sigma, c) = (found.lock.at.sigma - exact.sigma, found.lock.at.c / exact.c - 1.0);
    println!(
        "after {:.0} periods: sigma off by {sigma:.1e}, C by {c:.1e}",
        found.lock.periods_to_lock
    );
    assert!(sigma.abs() < 1e-5 && c.abs() < 1e-5);
    assert!(exact.stable && found.lock.regime == Regime::Symmetric);
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
        run(&mut rig, &mut ConstantDrive::new(scene), scene).unwrap()
    } else {
        let mut controller = built_in(scene);
        run(&mut rig, &mut controller, scene).unwrap()
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
fn a_lock_of_the_linear_mode_is_not_taken_for_the_impacting_one() {
    // Under a constant drive nothing ever hits a particle at rest in the middle, and the loop locks all the same, at sigma = 0.
    let mut scene = scene(&["start.dq2=0"]);
    // Only the loop check knows the linear response of such a rig.
    let checked = Some(LinearResponse::of(&scene));
    for (measured, expected) in [(None, Regime::NotEstablished), (checked, Regime::NoImpacts)] {
        scene.measured = measured;
        let refusal = identified_without_ground_truth(&scene).unwrap_err();
        assert!(
            matches!(refusal, IdentificationError::Regime { regime, .. } if regime == expected),
            "{refusal}"
        );
    }
    let record = run(&mut plant(&scene), &mut ConstantDrive::new(&scene), &scene).unwrap();
    let refusal = identify(&record, &scene).unwrap_err();
    let IdentificationError::Regime { regime: Regime::NoImpacts, sigma, .. } = refusal else {
        panic!("{refusal}");
    };
    assert!(sigma.abs() < 0.05, "{sigma}");
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
    let found = identified(&["record.decay_periods=1"]);
    assert!(found.decay.is_empty() && found.exact.is_some());
    assert_eq!(found.decay_end, DecayEnd::Record);
    assert!(vines::report::summary::identification(&found).contains("no points"));
}

#[test]
fn a_lock_through_30_db_takes_less_than_twice_the_periods_and_states_how_far_off_it_is() {
    let scene = scene(&["chain.snr=30"]);
    let plant = Box::new(Simulated::new(scene.plant, scene.start).unwrap());
    let mut rig = Chain::new(plant, &scene);
    let mut controller = built_in(&scene);
    let record = run(&mut rig, &mut controller, &scene).unwrap();
    let found = Comparison::of(&identify(&record, &scene).unwrap(), &scene);
    let (lock, exact) = (found.lock, found.exact.unwrap());
    println!("{lock:?}");
    assert!(lock.periods_to_lock <= 2.0 * identified(&[]).lock.periods_to_lock);
    assert!((lock.at.sigma - exact.sigma).abs() <= 4.0 * lock.at.u_sigma && lock.at.u_sigma < 0.01);
    assert!((lock.at.c - exact.c).abs() <= 4.0 * lock.at.u_c && lock.at.u_c < 0.01);
}

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
fn an_asymmetric_lock_is_refused() {
    let scene = scene(&["excitation.G=1.7"]);
    let mut rig = plant(&scene);
    // With the response held, the experiment searches for the symmetric motion.
    let mut controller = ConstantDrive::new(&scene);
    let record = run(&mut rig, &mut controller, &scene).unwrap();
    let refusal = identify(&record, &scene).unwrap_err();
    let IdentificationError::Regime { regime: Regime::Asymmetric, .. } = refusal else {
        panic!("{refusal}");
    };
}

#[test]
fn a_drive_without_a_stable_orbit_ends_the_search_with_a_reason() {
    let scene = scene(&["excitation.G=0.9", "start.dq2=0"]);
    let mut rig = plant(&scene);
    let mut controller = built_in(&scene);
    let mut samples = Vec::new();
    let ended = experiment::run_into(&mut samples, &mut rig, &mut controller, &scene, |_, _, _| {});
    assert!(
        matches!(
            ended,
            Err(ExperimentError::NotReached { .. } | ExperimentError::NoLock { .. })
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
        reason.ends_with("it is stable for G from 0.415 to 0.824, with gaps"),
        "{reason}"
    );
}

/// A rig whose response is noise of a shift register.
struct Noise(u32);

impl Rig for Noise {
    fn sense(&mut self) -> Result<Sensors, RigError> {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 17;
        self.0 ^= self.0 << 5;
        Ok(Sensors {
            response: f64::from(self.0) / f64::from(u32::MAX) - 0.5,
            reference: None,
        })
    }

    fn advance(&mut self, _: Drive, _: f64) -> Result<(), RigError> {
        Ok(())
    }
}

#[test]
fn noise_is_never_locked_and_ends_the_experiment_with_its_reason() {
    let scene = scene(&[]);
    let mut controller = built_in(&scene);
    let mut samples = Vec::new();
    let outcome = experiment::run_into(&mut samples, &mut Noise(1), &mut controller, &scene, |_, _, _| {});
    assert!(matches!(
        outcome,
        Err(ExperimentError::Tripped { fault: Fault::NoSignal, .. })
    ));
    assert!(samples.len() < 2500, "{}", samples.len());
}

#[test]
fn a_sensor_of_two_bits_has_no_phase_rather_than_a_phase_error_of_zero() {
    let scene = scene(&[
        "chain.adc_bits=2",
        "phase_lock.signal_timeout='none'",
        "phase_lock.residual_max='none'",
        "phase_lock.acquire_timeout=31.4",
    ]);
    let plant = Simulated::new(scene.plant, scene.start).unwrap();
    let mut rig = Chain::around(Box::new(plant), &scene);
    let mut controller = built_in(&scene);
    let outcome = run(&mut *rig, &mut controller, &scene);
    let message = outcome.unwrap_err().to_string();
    assert!(message.contains("the phase cannot be measured"), "{message}");
}

#[test]
fn a_response_above_its_limit_ends_the_experiment_at_once_and_keeps_what_was_measured() {
    let scene = scene(&["phase_lock.response_max=0.3"]);
    let mut rig = plant(&scene);
    let mut controller = built_in(&scene);
    let mut samples = Vec::new();
    let outcome = experiment::run_into(&mut samples, &mut rig, &mut controller, &scene, |_, _, _| {});
    let Err(error @ ExperimentError::Tripped { periods, fault, .. }) = &outcome else {
        panic!("{outcome:?}");
    };
    assert!(
        *fault == Fault::ResponseTooLarge && *periods < 50.0,
        "{periods} {fault}"
    );
    let message = error.to_string();
    assert!(
        message.contains("the response exceeded its limit; the response read")
            && message.contains("phase_lock.response_max is 0.3 m"),
        "{message}"
    );
    let last = samples.last().unwrap();
    assert!(last.sensors.response.abs() > 0.3 && samples.len() > 100);
    assert_eq!(vines::record::table(&samples).lines().count(), samples.len() + 1);
}

/// A controller that runs open loop.
struct OpenLoop(Drive);

impl Controller for OpenLoop {
    fn sample(&mut self, _: Sensors, active: bool) -> Result<Command, ControllerError> {
        Ok(Command {
            drive: if active { self.0 } else { Drive::default() },
            settled: true,
            ..Command::default()
        })
    }
}

#[test]
fn an_experiment_takes_any_controller_and_records_every_stage() {
    let scene = scene(&["record.hold_periods=3", "record.decay_periods=2"]);
    let mut rig = plant(&scene);
    let drive = Drive { omega: 1.0, amplitude: 0.01, displacement: 0.0 };
    let record = run(&mut rig, &mut OpenLoop(drive), &scene).unwrap();
    // The sample at which the lock had settled opens the hold.
    assert_eq!((record.hold().len(), record.decay().len()), (301, 200));
    assert!(
        record
            .decay()
            .iter()
            .all(|sample| sample.command.drive == Drive::default())
    );
}
