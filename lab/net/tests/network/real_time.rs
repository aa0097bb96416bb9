//! A rig in real time: it never waits, holds the last valid drive, and shuts it down after a silence.
//!
//! A busy machine misses deadlines now and then. The tests assert only what must hold nevertheless.

use std::net::UdpSocket;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::sleep;
use std::time::Duration;

use vines_net::frame::{Frame, Kind};
use vines_net::{Counters, Ended, LinkError, NetController, NetRig, RAMP_SAMPLES, ReportLost, Session, Timing};
use vines_testbench::experiment::{self, ExperimentError, Plan};
use vines_testbench::rig::{Command, Controller, ControllerError, Drive, Rig, Sensors, Simulated};

use crate::bench::{drive, real_time_rig, scene, serve_controller, shake, socket};
use crate::proxy::{Fate, Proxy};

/// A silence, s, longer than the pauses of a busy machine.
const PATIENT: f64 = 2.0;

/// Drives the rig through a proxy. Returns the counters of the client, the session and the drives of the rig.
fn shaken(fate: impl FnMut(Kind, u64) -> Fate + Send + 'static) -> (Counters, Session, Vec<Drive>) {
    let (client, session, drives, _) = shaken_with_report(fate);
    (client, session, drives)
}

fn shaken_with_report(
    fate: impl FnMut(Kind, u64) -> Fate + Send + 'static,
) -> (Counters, Session, Vec<Drive>, Option<Result<Timing, ReportLost>>) {
    let scene = scene(&[]);
    let (server, log) = real_time_rig(&scene, PATIENT);
    let proxy = Proxy::before(socket(server.address), fate);
    let mut rig = NetRig::connect(proxy.address, scene.sample_time(), None).unwrap();
    shake(&mut rig, &scene, 400).unwrap();
    let (client, timing) = (rig.counters(), rig.timing());
    drop(rig);
    let session = server.sessions(1).remove(0);
    let drives = log.lock().unwrap().clone();
    println!("client: {client}\n{session}\n{timing:?}");
    assert_eq!(session.ended, Ended::Farewell);
    assert!(session.samples >= 399);
    // Whatever the network did, the rig only got drives of this client, in their order.
    let driven = &drives[..399];
    assert!(driven.windows(2).all(|pair| pair[0].omega <= pair[1].omega));
    assert!(driven.iter().all(|given| (0..400).any(|n| *given == drive(n))));
    (client, session, drives, timing.get().copied())
}

#[test]
fn the_rig_keeps_its_rate_and_reports_the_lateness_of_its_samples() {
    let (_, session, drives, timing) = shaken_with_report(|_, _| Fate::Pass);
    let punctuality = session.punctuality.unwrap();
    // However busy the machine is, the samples are as late as the report says.
    let late = session.seconds - session.samples as f64 * session.sample_time;
    let allowed = -2.0 * session.sample_time..punctuality.worst + 0.1;
    assert!(allowed.contains(&late), "{late} s, {allowed:?}");
    assert_eq!(punctuality.samples(), session.samples);
    assert!(punctuality.missed <= session.samples && punctuality.worst >= 0.0);
    // The client gets the figures of the time before its farewell.
    let timing = timing.unwrap().expect("the report arrives");
    assert!((399..=session.samples).contains(&timing.samples));
    assert!(timing.missed <= punctuality.missed && timing.worst <= punctuality.worst);
    // After the farewell the drive ramps down.
    assert_eq!(drives.last().unwrap().amplitude, 0.0);
    let steps = drives.windows(2).map(|pair| pair[0].amplitude - pair[1].amplitude);
    assert!(steps.fold(0.0, f64::max) < 1.5e-4 / f64::from(RAMP_SAMPLES));
}

#[test]
fn a_lost_drive_is_held_and_a_lost_reading_replaced() {
    let (client, session, _) = shaken(|kind, n| match (kind, n % 10) {
        (Kind::Drive | Kind::Sensors, 5) => Fate::Lose,
        _ => Fate::Pass,
    });
    assert!(session.counters.unwrap().held >= 35 && client.held >= 35);
}

#[test]
fn drives_and_readings_that_arrive_after_a_later_one_are_not_used() {
    let (client, session, _) = shaken(|kind, n| match (kind, n % 10) {
        (Kind::Drive | Kind::Sensors, 5) => Fate::Swap,
        _ => Fate::Pass,
    });
    assert!(session.counters.unwrap().late >= 35);
    assert!(client.late >= 35 && client.held >= 35);
}

#[test]
fn a_report_that_is_lost_is_sent_again_even_after_the_session_and_one_that_never_comes_is_an_error() {
    // Twelve repetitions take 0.6 s; the session ends after a ramp of 0.11 s.
    let lose = |most: u64| {
        let mut reports = 0;
        move |kind: Kind, _: u64| {
            reports += u64::from(kind == Kind::Report);
            if kind == Kind::Report && reports <= most {
                Fate::Lose
            } else {
                Fate::Pass
            }
        }
    };
    assert!(shaken_with_report(lose(12)).3.unwrap().unwrap().samples >= 399);
    assert_eq!(shaken_with_report(lose(u64::MAX)).3, Some(Err(ReportLost)));
}

#[test]
fn the_readings_of_a_blackout_repeat_the_period_before() {
    let scene = scene(&[]);
    let (server, log) = real_time_rig(&scene, PATIENT);
    let lost = 250..277;
    let blackout = lost.clone();
    let proxy = Proxy::before(socket(server.address), move |kind, n| match kind {
        Kind::Sensors if blackout.contains(&(n as usize)) => Fate::Lose,
        _ => Fate::Pass,
    });
    let mut rig = NetRig::connect(proxy.address, scene.sample_time(), None).unwrap();
    let readings = shake(&mut rig, &scene, 400).unwrap();
    let client = rig.counters();
    assert!(client.held >= 27 && client.longest >= 27);
    assert!(
        client
            .to_string()
            .contains(&format!("at most {} in a row", client.longest))
    );
    drop(rig);
    server.sessions(1);
    // What the sensors read in truth.
    let mut plant = Simulated::new(scene.plant, scene.start).unwrap();
    let mut worst = 0.0_f64;
    for (n, given) in log.lock().unwrap()[..399].iter().enumerate() {
        let expected = plant.sense().unwrap().reference.unwrap();
        if lost.contains(&n) {
            worst = worst.max((readings[n].0.reference.unwrap() - expected).abs());
        }
        plant.advance(*given, scene.sample_time()).unwrap();
    }
    println!("largest error {worst:e} m of 1e-4 m");
    assert!(worst < 5e-6, "{worst}");
}

#[test]
fn neither_garbage_nor_a_repeated_hello_keeps_a_session_without_a_drive() {
    let scene = scene(&[]);
    let (server, _) = real_time_rig(&scene, PATIENT);
    let client = UdpSocket::bind("127.0.0.1:0").unwrap();
    client.connect(socket(server.address)).unwrap();
    let mut hello = Frame::new(Kind::Hello, 1);
    hello.values[0] = scene.sample_time();
    let stop = Arc::new(AtomicBool::new(false));
    let stopped = Arc::clone(&stop);
    let noise = std::thread::spawn(move || {
        for n in 0_u64.. {
            if stopped.load(Ordering::Relaxed) {
                break;
            }
            let bytes = if n % 1000 == 0 {
                hello.encode().to_vec()
            } else {
                vec![0; 84]
            };
            let _ = client.send(&bytes);
            sleep(Duration::from_micros(500));
        }
    });
    let session = server.sessions(1).remove(0);
    stop.store(true, Ordering::Relaxed);
    noise.join().unwrap();
    assert_eq!(session.ended, Ended::Silence);
    assert!((5.0..8.0).contains(&session.seconds), "{}", session.seconds);
}

#[test]
fn repeated_corrupted_and_copied_frames_are_counted_one_by_one() {
    let (client, session, _) = shaken(|_, n| match n % 12 {
        3 => Fate::Repeat,
        6 => Fate::Corrupt,
        9 => Fate::Copy,
        _ => Fate::Pass,
    });
    for counters in [client, session.counters.unwrap()] {
        assert!(counters.late >= 25 && counters.malformed >= 25);
    }
    // The client's socket takes datagrams of its server only.
    assert!(session.counters.unwrap().foreign >= 25 && client.foreign == 0);
}

#[test]
fn an_invalid_drive_is_refused_and_the_last_valid_one_held() {
    let (_, session, drives) = shaken(|kind, n| match (kind, n % 30) {
        (Kind::Drive, 5) => Fate::Rewrite(|frame| frame.values[1] = f64::NAN),
        (Kind::Drive, 15) => Fate::Rewrite(|frame| frame.values[1] = 1e3),
        (Kind::Drive, 25) => Fate::Rewrite(|frame| frame.values[0] = 1e9),
        _ => Fate::Pass,
    });
    assert!(session.counters.unwrap().malformed >= 35 && session.counters.unwrap().held >= 35);
    assert!(drives.iter().all(|drive| drive.amplitude <= 1e-4 && drive.omega < 52.0));
}

#[test]
fn a_drive_of_a_future_sample_is_refused() {
    let (_, session, _) = shaken(|kind, n| match (kind, n) {
        (Kind::Drive, 50) => Fate::Rewrite(|frame| frame.sequence = u64::MAX),
        (Kind::Drive, 60) => Fate::Rewrite(|frame| frame.sequence += 1000),
        _ => Fate::Pass,
    });
    assert!(session.counters.unwrap().malformed >= 2);
}

#[test]
fn a_silence_shuts_the_drive_down_and_a_client_that_returns_is_informed() {
    let scene = scene(&[]);
    let (server, log) = real_time_rig(&scene, 0.3);
    let mut rig = NetRig::connect(server.address, scene.sample_time(), None).unwrap();
    shake(&mut rig, &scene, 50).unwrap();
    let session = server.sessions(1).remove(0);
    assert_eq!(session.ended, Ended::Silence);
    assert!(session.counters.unwrap().held as f64 * session.sample_time > 0.3);
    let drives = log.lock().unwrap().clone();
    let held = drives.iter().filter(|given| **given == drive(49)).count();
    assert!(held as f64 * session.sample_time > 0.29, "{held}");
    assert_eq!(drives.last().unwrap().amplitude, 0.0);

    let error = loop {
        if let Err(error) = shake(&mut rig, &scene, 1) {
            break error;
        }
    };
    let Some(LinkError::ShutDown { .. } | LinkError::Silent { .. }) = error.cause() else {
        panic!("{error}");
    };
    assert!(error.to_string().contains("0.3 s"), "{error}");
    // Latched: no frame of this client moves the rig again.
    let _ = rig.advance(drive(51), scene.sample_time());
    sleep(Duration::from_millis(50));
    assert_eq!(log.lock().unwrap().len(), drives.len());
}

#[test]
fn after_a_shutdown_another_client_may_start_a_session() {
    let scene = scene(&[]);
    let (server, log) = real_time_rig(&scene, 0.3);
    let mut gone = NetRig::connect(server.address, scene.sample_time(), None).unwrap();
    shake(&mut gone, &scene, 20).unwrap();
    server.sessions(1);
    log.lock().unwrap().clear();
    let mut next = NetRig::connect(server.address, scene.sample_time(), None).unwrap();
    shake(&mut next, &scene, 20).unwrap();
    assert_eq!(log.lock().unwrap()[0], drive(0));
    drop(next);
    assert_eq!(server.sessions(2)[1].ended, Ended::Farewell);
}

#[test]
fn a_rig_that_stops_answering_ends_the_experiment() {
    let scene = scene(&[]);
    let (server, _) = real_time_rig(&scene, 0.3);
    let proxy = Proxy::before(socket(server.address), |kind, n| match kind {
        Kind::Sensors if n >= 50 => Fate::Lose,
        _ => Fate::Pass,
    });
    let mut rig = NetRig::connect(proxy.address, scene.sample_time(), None).unwrap();
    let error = shake(&mut rig, &scene, 100).unwrap_err();
    assert!(matches!(error.cause(), Some(LinkError::Silent { .. })), "{error}");
}

#[test]
fn a_client_that_falls_behind_is_shut_down_and_no_drive_older_than_the_silence_is_applied() {
    let (scene, silence) = (scene(&[]), 0.2);
    let (server, log) = real_time_rig(&scene, silence);
    let mut rig = NetRig::connect(server.address, scene.sample_time(), None).unwrap();
    // Every answer is valid and arrives soon after the one before, but each takes two sample periods.
    let slow = Duration::from_secs_f64(2.0 * scene.sample_time());
    let outcome = (0..2000).try_for_each(|n| {
        rig.sense()?;
        sleep(slow);
        rig.advance(drive(n), scene.sample_time())
    });
    let error = outcome.unwrap_err();
    assert!(matches!(error.cause(), Some(LinkError::ShutDown { .. })), "{error}");
    assert_eq!(server.sessions(1)[0].ended, Ended::Silence);
    let oldest = (silence / scene.sample_time()).ceil() + 1.0;
    for (n, had) in log
        .lock()
        .unwrap()
        .iter()
        .enumerate()
        .filter(|(_, had)| had.amplitude == 1e-4)
    {
        let age = n as f64 - 1024.0 * (had.omega - 50.0);
        assert!(age <= oldest, "the drive of sample {n} is {age} samples old");
    }
}

/// A controller that answers this many readings, and hangs at the next.
#[derive(Clone, Copy)]
struct StopsAt(usize);

impl Controller for StopsAt {
    fn sample(&mut self, _: Sensors, _: bool) -> Result<Command, ControllerError> {
        if self.0 == 0 {
            sleep(Duration::from_secs(2));
        }
        self.0 = self.0.saturating_sub(1);
        Ok(Command { drive: drive(self.0), ..Command::default() })
    }
}

#[test]
fn a_controller_that_stops_answering_ramps_the_drive_of_the_rig_down() {
    let scene = scene(&[]);
    let (rig_server, log) = real_time_rig(&scene, PATIENT);
    let stuck = StopsAt(200);
    let controller_server = serve_controller(&scene, 10.0, move || Box::new(stuck));
    let mut rig = NetRig::connect(rig_server.address, scene.sample_time(), None).unwrap();
    let mut peer =
        NetController::connect(socket(controller_server.address), scene.sample_time(), Some(0.5), None).unwrap();
    let outcome = experiment::run(&mut rig, &mut peer, &Plan::of(&scene), |_, _, _| {});
    let Err(ExperimentError::Controller(error)) = outcome else {
        panic!("{outcome:?}");
    };
    println!("{error}");
    drop(rig);
    assert_eq!(rig_server.sessions(1)[0].ended, Ended::Farewell);
    let drives = log.lock().unwrap();
    assert!(drives.iter().any(|had| had.amplitude > 9e-5));
    assert_eq!(drives.last().unwrap().amplitude, 0.0);
}
