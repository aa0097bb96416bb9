//! Experiments that end early, and other rigs and controllers than the simulated ones.

use vines::experiment::{self, ExperimentError};
use vines::net::LinkError;
use vines::rig::{
    BuiltIn, Chain, Command, Controller, ControllerError, Drive, Fault, Rig, RigError, Sensors, Simulated,
};

use crate::{plan, scene};

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
    let mut controller = BuiltIn::new(&scene.controller_config()).unwrap();
    let mut samples = Vec::new();
    let outcome = experiment::run_into(
        &mut samples,
        &mut Noise(1),
        &mut controller,
        &plan(&scene),
        |_, _, _| {},
    );
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
        "record.lock_periods=5",
    ]);
    let plant = Simulated::new(scene.plant, scene.start).unwrap();
    let mut rig = Chain::around(Box::new(plant), &scene);
    let mut controller = BuiltIn::new(&scene.controller_config()).unwrap();
    let outcome = experiment::run(&mut *rig, &mut controller, &plan(&scene), |_, _, _| {});
    let message = outcome.unwrap_err().to_string();
    assert!(message.contains("the phase cannot be measured"), "{message}");
}

#[test]
fn a_response_above_its_limit_ends_the_experiment_at_once_and_keeps_what_was_measured() {
    let scene = scene(&["controller.C_max=0.3"]);
    let mut rig = Simulated::new(scene.plant, scene.start).unwrap();
    let mut controller = BuiltIn::new(&scene.controller_config()).unwrap();
    let mut samples = Vec::new();
    let outcome = experiment::run_into(&mut samples, &mut rig, &mut controller, &plan(&scene), |_, _, _| {});
    let Err(error @ ExperimentError::Tripped { periods, fault, .. }) = &outcome else {
        panic!("{outcome:?}");
    };
    assert!(
        *fault == Fault::ResponseTooLarge && *periods < 50.0,
        "{periods} {fault}"
    );
    let message = error.to_string();
    assert!(
        message.contains("the response exceeded its limit; it read 0.3")
            && message.contains("controller.C_max allows 0.3 m"),
        "{message}"
    );
    let last = samples.last().unwrap();
    assert!(last.sensors.response.abs() > 0.3 && samples.len() > 100);
    assert_eq!(vines::record::table(&samples).lines().count(), samples.len() + 1);
}

#[test]
fn a_drive_that_is_not_a_number_never_reaches_the_rig() {
    let (scene, mut rig) = (scene(&[]), Shaken(Drive::default()));
    for drive in [(f64::NAN, 0.1), (1.0, f64::INFINITY)] {
        let drive = Drive { omega: drive.0, amplitude: drive.1, displacement: 0.0 };
        let outcome = experiment::run(&mut rig, &mut OpenLoop(drive), &plan(&scene), |_, _, _| {});
        assert!(matches!(outcome, Err(ExperimentError::NotANumber(_))));
        assert_eq!(rig.0, Drive::default());
    }
}

/// A controller that drives for a while, then fails.
struct Failing(usize);

impl Controller for Failing {
    fn sample(&mut self, _: Sensors, _: bool) -> Result<Command, ControllerError> {
        let left = self.0.checked_sub(1);
        self.0 = left.ok_or_else(|| LinkError::System(std::io::ErrorKind::NotConnected.into()))?;
        Ok(Command {
            drive: Drive { omega: 1.0, amplitude: 0.01, displacement: 0.0 },
            ..Command::default()
        })
    }
}

/// A rig that keeps its last drive.
struct Shaken(Drive);

impl Rig for Shaken {
    fn sense(&mut self) -> Result<Sensors, RigError> {
        Ok(Sensors::default())
    }

    fn advance(&mut self, drive: Drive, _: f64) -> Result<(), RigError> {
        self.0 = drive;
        Ok(())
    }
}

#[test]
fn a_controller_that_fails_does_not_leave_the_rig_driven() {
    let (scene, mut rig) = (scene(&[]), Shaken(Drive::default()));
    let outcome = experiment::run(&mut rig, &mut Failing(10), &plan(&scene), |_, _, _| {});
    assert!(matches!(outcome, Err(ExperimentError::Controller(_))));
    assert_eq!(rig.0, Drive::default());
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
    let scene = scene(&[
        "record.hold_periods=3",
        "record.decay_periods=2",
        "record.window_periods=1.5",
    ]);
    let mut rig = Simulated::new(scene.plant, scene.start).unwrap();
    let drive = Drive { omega: 1.0, amplitude: 0.01, displacement: 0.0 };
    let record = experiment::run(&mut rig, &mut OpenLoop(drive), &plan(&scene), |_, _, _| {}).unwrap();
    // The sample at which the lock had settled opens the hold.
    assert_eq!((record.hold().len(), record.decay().len()), (301, 200));
    assert!(
        record
            .decay()
            .iter()
            .all(|sample| sample.command.drive == Drive::default())
    );
}

#[test]
fn limits_of_a_scene_reach_the_controller() {
    let run = |settings: &[&str]| {
        let scene = scene(settings);
        let mut rig = Simulated::new(scene.plant, scene.start).unwrap();
        let mut controller = BuiltIn::new(&scene.controller_config()).unwrap();
        let mut drives = Vec::new();
        for _ in 0..4000 {
            let command = controller.sample(rig.sense().unwrap(), true).unwrap();
            drives.push(command.drive.amplitude);
            rig.advance(command.drive, scene.sample_time()).unwrap();
        }
        (scene.amplitude, drives)
    };
    let (amplitude, drives) = run(&["controller.ramp_periods=10"]);
    assert!((drives[500] / amplitude - 0.5).abs() < 0.01);
    // A response too large takes the drive away for good.
    let (_, drives) = run(&["controller.C_max=0.2"]);
    assert!(drives[0] > 0.0 && drives[3999] == 0.0);
    let (_, drives) = run(&["record.lock_periods=20"]);
    assert!(drives[1900] > 0.0 && drives[3999] == 0.0);
    let refused = vines::scene::Scene::load(None, &["controller.G_max=1.0".parse().unwrap()]).unwrap_err();
    assert!(refused.to_string().starts_with("excitation.G: amplitude"), "{refused}");
}
