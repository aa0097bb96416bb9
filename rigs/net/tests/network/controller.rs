//! Guards a controller across the network: late and missing answers, moves of the response, and who judges the lock.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::sleep;
use std::time::Duration;

use vines_bench::rig::{Command, Controller, LoopState, Move, Sensors};
use vines_net::{Ended, LinkError};

use crate::{Answers, PATIENT, SCENE, Served, drive, link_error, serve_built_in, serve_controller};

fn reading(n: usize) -> Sensors {
    Sensors { response: n as f64, reference: None }
}

/// Serves a controller that answers with the number of the reading. Every tenth answer waits until `done` exceeds that number. Its readings
/// are logged.
fn serve_echo(done: &Arc<AtomicUsize>) -> (Served, Arc<Mutex<Vec<f64>>>) {
    let asked = Arc::<Mutex<Vec<f64>>>::default();
    let (log, done) = (Arc::clone(&asked), Arc::clone(done));
    let echo = Answers(move |response| {
        let number = log.lock().unwrap().len();
        log.lock().unwrap().push(response);
        while number % 10 == 4 && done.load(Ordering::Relaxed) <= number {
            sleep(Duration::from_micros(100));
        }
        Command {
            drive: drive(number),
            settled: Some(true),
            ..Command::default()
        }
    });
    (serve_controller(&SCENE, PATIENT, echo), asked)
}

#[test]
fn beside_a_rig_in_real_time_the_last_answer_replaces_a_late_one_and_no_reading_is_missing() {
    let done = Arc::default();
    let (server, asked) = serve_echo(&done);
    let mut peer = server.controller(Some(PATIENT));
    let sample = |n| {
        let answer = peer.sample(reading(n), true).unwrap();
        done.store(n + 1, Ordering::Relaxed);
        answer
    };
    let answers: Vec<Command> = (0..200).map(sample).collect();
    println!("{}", peer.counters());
    assert!(peer.counters().held >= 20);
    // Until the first answer nothing is driven. A held drive is that of an earlier sample, and never counts as settled.
    let first = answers.iter().position(|answer| *answer != Command::default()).unwrap();
    for (n, answer) in answers.iter().enumerate().skip(first) {
        let own = answer.drive == drive(n);
        assert!(own || (answer.settled == Some(false) && answer.drive.omega < drive(n).omega));
    }
    // It is zero when the drive is not requested.
    let held = peer.sample(reading(200), false).unwrap();
    assert!(held.settled == Some(true) || held.drive.amplitude == 0.0);
    drop(peer);
    server.session();
    let asked = asked.lock().unwrap();
    assert!(asked.iter().enumerate().all(|(n, reading)| n as f64 == *reading));
}

#[test]
fn a_controller_that_stops_answering_is_a_permanent_error_and_a_client_that_was_silent_gets_no_drive() {
    for pace in [None, Some(0.2)] {
        let done = Arc::default();
        let (server, _) = serve_echo(&done);
        let mut peer = server.controller(pace);
        let error = (0..).find_map(|n| peer.sample(reading(n), true).err()).unwrap();
        assert!(matches!(link_error(&error), LinkError::Silent { .. }), "{error}");
        assert!(peer.sample(reading(0), true).is_err());
        done.store(usize::MAX, Ordering::Relaxed);
    }
    let (server, _) = serve_echo(&Arc::default());
    let mut peer = server.controller(None);
    peer.sample(reading(0), true).unwrap();
    assert_eq!(server.session().ended, Ended::Silence);
    let error = peer.sample(reading(1), true).unwrap_err();
    assert!(matches!(link_error(&error), LinkError::Closed { .. }), "{error}");
}

#[test]
fn a_controller_that_reports_no_state_does_not_judge_its_lock() {
    let state = LoopState::of_number(2);
    for (command, expected) in [
        (Command::default(), None),
        (Command { state, ..Command::default() }, Some(false)),
        (Command { settled: Some(true), ..Command::default() }, Some(true)),
    ] {
        let server = serve_controller(&SCENE, PATIENT, Answers(move |_| command));
        let settled = server.controller(None).sample(reading(0), true).unwrap().settled;
        assert_eq!(settled, expected);
    }
}

#[test]
fn a_move_that_the_controller_cannot_make_ends_the_session_with_the_reason() {
    let server = serve_built_in(&SCENE);
    // The loop is open.
    let open = "closed loop only, state 2 (acquiring) or 3 (locked), and is in this state: 0";
    for (response, reason) in [(0.0, "not above 0: 0"), (0.1, open)] {
        let mut peer = server.controller(None);
        peer.sample(reading(0), false).unwrap();
        peer.hold_response(Move { response, ..Move::default() }, 0.0).unwrap();
        let error = peer.sample(reading(1), false).unwrap_err();
        assert!(error.to_string().contains(reason), "{error}");
    }
}
