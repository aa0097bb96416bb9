//! Guards a controller across the network: late, missing and invalid answers, moves of the response, and a lock that the bench judges.

use std::sync::{Arc, Mutex};
use std::thread::sleep;
use std::time::Duration;

use vines_net::{Ended, LinkError};
use vines_testbench::rig::{BuiltIn, Command, Controller, ControllerError, LoopState, Move, Rig, Sensors, Simulated};
use vines_testbench::scene::Scene;

use crate::{PATIENT, drive, scene, serve_built_in, serve_controller};

fn reading(n: usize) -> Sensors {
    Sensors { response: n as f64, reference: None }
}

/// A controller that logs its readings, and answers with their number; every tenth answer takes the stated time.
#[derive(Clone)]
struct Echo(Arc<Mutex<Vec<f64>>>, Duration);

impl Controller for Echo {
    fn sample(&mut self, sensors: Sensors, _: bool) -> Result<Command, ControllerError> {
        let mut asked = self.0.lock().unwrap();
        asked.push(sensors.response);
        if asked.len() % 10 == 5 {
            sleep(self.1);
        }
        let drive = drive(asked.len() - 1);
        Ok(Command { drive, settled: true, ..Command::default() })
    }
}

#[test]
fn beside_a_rig_in_real_time_the_last_answer_replaces_a_late_one_and_no_reading_is_missing() {
    let (scene, echo) = (scene(&[]), Echo(Arc::default(), Duration::from_millis(5)));
    let server = serve_controller(&scene, PATIENT, echo.clone());
    let mut peer = server.controller(&scene, Some(PATIENT));
    let answers: Vec<Command> = (0..200).map(|n| peer.sample(reading(n), true).unwrap()).collect();
    println!("{}", peer.counters());
    assert!(peer.counters().held >= 15);
    // A held drive is that of an earlier sample, and never counts as settled.
    for (n, answer) in answers.iter().enumerate() {
        let own = answer.drive == drive(n);
        assert!(own || (!answer.settled && answer.drive.omega < drive(n).omega));
    }
    // It is zero when the drive is not requested.
    let held = peer.sample(reading(200), false).unwrap();
    assert!(held.settled || held.drive.amplitude == 0.0);
    drop(peer);
    server.session();
    let asked = echo.0.lock().unwrap();
    assert!(asked.iter().enumerate().all(|(n, reading)| n as f64 == *reading));
}

#[test]
fn a_controller_that_stops_answering_is_a_permanent_error_and_a_client_that_was_silent_gets_no_drive() {
    let scene = scene(&[]);
    for pace in [None, Some(0.2)] {
        let server = serve_controller(&scene, 0.3, Echo(Arc::default(), Duration::from_secs(1)));
        let mut peer = server.controller(&scene, pace);
        let error = (0..5000).find_map(|n| peer.sample(reading(n), true).err()).unwrap();
        assert!(matches!(error.cause(), Some(LinkError::Silent { .. })), "{error}");
        assert!(peer.sample(reading(0), true).is_err());
    }
    let server = serve_controller(&scene, 0.2, Echo(Arc::default(), Duration::ZERO));
    let mut peer = server.controller(&scene, None);
    peer.sample(reading(0), true).unwrap();
    assert_eq!(server.session().ended, Ended::Silence);
    let error = peer.sample(reading(1), true).unwrap_err();
    assert!(matches!(error.cause(), Some(LinkError::Closed { .. })), "{error}");
}

/// A controller that answers always the same.
#[derive(Clone, Copy)]
struct Constant(Command);

impl Controller for Constant {
    fn sample(&mut self, _: Sensors, _: bool) -> Result<Command, ControllerError> {
        Ok(self.0)
    }
}

#[test]
fn an_answer_that_is_not_finite_is_an_error_and_the_bench_judges_the_lock_of_a_controller_that_reports_no_state() {
    let scene = scene(&[]);
    let broken = Command { phase_error: Some(f64::NAN), ..Command::default() };
    let server = serve_controller(&scene, PATIENT, Constant(broken));
    let error = server.controller(&scene, None).sample(reading(0), true).unwrap_err();
    assert!(matches!(error.cause(), Some(LinkError::Invalid { .. })), "{error}");

    let locked = Command {
        drive: drive(0),
        phase_error: Some(1e-4),
        ..Command::default()
    };
    let state = LoopState::of_number(2);
    let silent = Command { phase_error: None, ..locked };
    let samples = (f64::from(scene.controller_config().lock.dwell) + 1.0) * scene.controller.samples_per_period;
    for (command, expected) in [(locked, true), (Command { state, ..locked }, false), (silent, false)] {
        let server = serve_controller(&scene, PATIENT, Constant(command));
        let mut peer = server.controller(&scene, None);
        let [inactive, active] = [false, true].map(|active| {
            let mut settled = (0..(1.2 * samples) as usize).map(|n| peer.sample(reading(n), active).unwrap().settled);
            settled.by_ref().filter(|settled| *settled).count() as f64
        });
        assert_eq!((inactive, active > 0.0), (0.0, expected), "{command:?}");
        assert!(active < 0.5 * samples, "{active} of {samples} samples settled");
    }
}

/// Drives the plant with a controller, moves the response at half the samples, and returns the commands.
fn moved(scene: &Scene, controller: &mut dyn Controller, samples: usize) -> Vec<Command> {
    let mut rig = Simulated::new(scene.plant, scene.start).unwrap();
    let response = 0.6 * scene.plant.half_width;
    let to = Move {
        response,
        duration: 2.0,
        amplitude: -1e-6,
        omega: 0.01,
        growth: 0.0,
    };
    let mut sample = |n| {
        if n == samples / 2 {
            controller.hold_response(to, -1.5).unwrap();
        }
        let command = controller.sample(rig.sense().unwrap(), true).unwrap();
        rig.advance(command.drive, scene.sample_time()).unwrap();
        command
    };
    (0..samples).map(&mut sample).collect()
}

#[test]
fn the_response_is_controlled_across_the_network_with_the_same_bits() {
    let scene = scene(&["phase_lock.harmonics=4", "phase_lock.base_bandwidth=0.5"]);
    let far = moved(&scene, &mut serve_built_in(&scene).controller(&scene, None), 4000);
    let near = moved(&scene, &mut BuiltIn::new(&scene.controller_config()).unwrap(), 4000);
    assert_eq!(far, near);
    // The move did something.
    assert!(far[3999].drive.amplitude != far[1999].drive.amplitude);
}

#[test]
fn a_move_that_the_controller_cannot_make_ends_the_session_with_the_reason() {
    let scene = scene(&[]);
    let server = serve_built_in(&scene);
    // The loop is open.
    let open = "closed loop only, state 2 (acquiring) or 3 (locked), and is in this state: 0";
    for (response, reason) in [(0.0, "not above 0: 0"), (0.1, open)] {
        let mut peer = server.controller(&scene, None);
        peer.sample(reading(0), false).unwrap();
        peer.hold_response(Move { response, ..Move::default() }, 0.0).unwrap();
        let error = peer.sample(reading(1), false).unwrap_err();
        assert!(error.to_string().contains(reason), "{error}");
    }
}
