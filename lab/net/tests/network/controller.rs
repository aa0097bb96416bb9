//! A controller across the network.

use std::sync::{Arc, Mutex};
use std::time::Duration;

use vines_net::frame::Kind;
use vines_net::{Ended, LinkError, NetController};
use vines_testbench::rig::{Command, Controller, ControllerError, Sensors};

use crate::bench::{controller, drive, scene, serve_controller};
use crate::proxy::{Fate, Proxy};

/// A silence, s, longer than the pauses of a busy machine.
const PATIENT: f64 = 2.0;

fn reading(n: usize) -> Sensors {
    Sensors { response: n as f64, reference: None }
}

/// A controller that logs its readings, and answers with their number.
struct Echo(Arc<Mutex<Vec<f64>>>);

impl Controller for Echo {
    fn sample(&mut self, sensors: Sensors, _: bool) -> Result<Command, ControllerError> {
        let mut asked = self.0.lock().unwrap();
        asked.push(sensors.response);
        Ok(Command {
            drive: drive(asked.len() - 1),
            settled: true,
            ..Command::default()
        })
    }
}

#[test]
fn the_last_valid_reading_replaces_a_lost_one_so_that_no_sample_is_missing() {
    let (scene, asked) = (scene(&[]), Arc::default());
    let log = Arc::clone(&asked);
    let server = serve_controller(&scene, PATIENT, move || Box::new(Echo(Arc::clone(&log))));
    let proxy = Proxy::before(server.address, |kind, n| match (kind, n % 10) {
        (Kind::Sensors, 5) => Fate::Lose,
        _ => Fate::Pass,
    });
    let mut peer = NetController::connect(proxy.address, scene.sample_time(), Some(PATIENT)).unwrap();
    let answers: Vec<Command> = (0..200).map(|n| peer.sample(reading(n), true).unwrap()).collect();
    println!("{}", peer.counters());
    assert!(peer.counters().held >= 15);
    // A held drive is that of an earlier sample, and never counts as settled.
    for (n, answer) in answers.iter().enumerate() {
        let own = answer.drive == drive(n);
        assert!(own || (!answer.settled && answer.drive.omega < drive(n).omega));
    }
    drop(peer);
    let session = server.sessions(1).remove(0);
    assert!(session.counters.lost >= 15 && session.counters.held >= 15);
    // One reading per sample up to the last one that arrived; a lost one repeats the one before.
    let asked = asked.lock().unwrap();
    assert!(asked.len() >= 195);
    assert!(asked.iter().enumerate().all(|(n, reading)| n as f64 - reading >= 0.0));
}

#[test]
fn a_held_drive_is_zero_when_the_drive_is_not_requested() {
    let scene = scene(&[]);
    let server = serve_controller(&scene, PATIENT, move || Box::new(Echo(Arc::default())));
    let proxy = Proxy::before(server.address, |kind, n| match kind {
        Kind::Drive if n >= 10 => Fate::Lose,
        _ => Fate::Pass,
    });
    let mut peer = NetController::connect(proxy.address, scene.sample_time(), Some(PATIENT)).unwrap();
    for n in 0..20 {
        peer.sample(reading(n), true).unwrap();
    }
    let held = peer.sample(reading(20), true).unwrap();
    let released = peer.sample(reading(21), false).unwrap();
    assert!(held.drive.amplitude > 0.0);
    assert_eq!((released.drive.amplitude, released.settled), (0.0, false));
}

#[test]
fn a_controller_that_stops_answering_is_a_permanent_error() {
    let scene = scene(&[]);
    let server = controller(&scene, 0.3);
    let proxy = Proxy::before(server.address, |kind, n| match kind {
        Kind::Drive if n >= 30 => Fate::Lose,
        _ => Fate::Pass,
    });
    for pace in [None, Some(0.3)] {
        let mut peer = NetController::connect(proxy.address, scene.sample_time(), pace).unwrap();
        let error = (0..5000).find_map(|n| peer.sample(reading(n), true).err()).unwrap();
        let Some(LinkError::Silent { .. }) = error.cause::<LinkError>() else {
            panic!("{error}");
        };
        assert!(peer.sample(reading(0), true).is_err());
    }
}

#[test]
fn a_client_that_was_silent_for_too_long_gets_no_drive() {
    let scene = scene(&[]);
    let server = controller(&scene, 0.2);
    let mut peer = NetController::connect(server.address, scene.sample_time(), None).unwrap();
    peer.sample(reading(0), true).unwrap();
    assert_eq!(server.sessions(1)[0].ended, Ended::Silence);
    std::thread::sleep(Duration::from_millis(20));
    let error = peer.sample(reading(1), true).unwrap_err();
    let Some(LinkError::ShutDown { .. }) = error.cause::<LinkError>() else {
        panic!("{error}");
    };
}
