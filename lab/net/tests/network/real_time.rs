//! Guards a rig in real time: it never waits, holds the last valid drive, and shuts it down after a silence.
//!
//! A busy machine misses deadlines now and then. The tests assert only what must hold nevertheless.

use std::net::{SocketAddr, UdpSocket};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, sleep};
use std::time::Duration;

use vines_net::frame::{Frame, Kind};
use vines_net::{Address, Counters, Ended, LinkError, NetRig, RAMP_SAMPLES, ReportLost, Session, Timing};
use vines_testbench::experiment::{self, ExperimentError};
use vines_testbench::rig::{Command, Controller, ControllerError, Drive, Rig, Sensors};

use crate::{PATIENT, drive, link_error, scene, serve_controller, serve_rig, shake};

/// Treatment of a datagram by a proxy.
#[derive(Clone, Copy)]
enum Fate {
    Pass,
    Lose,
    Repeat,
    /// Delayed until the next one in the same direction has passed.
    Swap,
    /// Some bits are inverted.
    Corrupt,
    /// Passes; another sender sends a copy, too.
    Copy,
    /// Passes with changed content and a correct checksum.
    Rewrite(fn(&mut Frame)),
}

/// A proxy before `server` that ends when the second value is dropped. `fate` determines the treatment of the n-th frame in a direction;
/// handshake and farewell pass.
fn proxy(server: SocketAddr, mut fate: impl FnMut(Kind, u64) -> Fate + Send + 'static) -> (Address, Arc<()>) {
    let [front, back, stranger] = [(); 3].map(|()| {
        let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
        socket.set_nonblocking(true).unwrap();
        socket
    });
    let (address, used) = (Address::Udp(front.local_addr().unwrap()), Arc::new(()));
    let is_used = Arc::clone(&used);
    thread::spawn(move || {
        let (mut client, mut count, mut kept) = (server, [0; 2], [None, None]);
        while Arc::strong_count(&is_used) > 1 {
            for (direction, at, via) in [(0, &front, &back), (1, &back, &front)] {
                let mut bytes = [0; 256];
                let Ok((size, from)) = at.recv_from(&mut bytes) else {
                    continue;
                };
                client = if direction == 0 { from } else { client };
                let (to, bytes) = (if direction == 0 { server } else { client }, &mut bytes[..size]);
                let send = |bytes: &[u8]| assert_eq!(via.send_to(bytes, to).unwrap(), bytes.len());
                let mut frame = Frame::decode(bytes).unwrap();
                if !matches!(frame.kind, Kind::Sensors | Kind::Drive | Kind::Report) {
                    send(bytes);
                    continue;
                }
                let held: Option<Vec<u8>> = kept[direction].take();
                match fate(frame.kind, count[direction]) {
                    Fate::Pass => send(bytes),
                    Fate::Lose => {}
                    Fate::Repeat => (0..2).for_each(|_| send(bytes)),
                    Fate::Swap => kept[direction] = Some(bytes.to_vec()),
                    Fate::Corrupt => {
                        bytes[37] ^= 0x50;
                        send(bytes);
                    }
                    Fate::Copy => {
                        stranger.send_to(bytes, to).unwrap();
                        send(bytes);
                    }
                    Fate::Rewrite(change) => {
                        change(&mut frame);
                        send(&frame.encode());
                    }
                }
                count[direction] += 1;
                held.iter().for_each(|held| send(held));
            }
            sleep(Duration::from_micros(20));
        }
    });
    (address, used)
}

/// What a run through a proxy leaves: counters of client and server, session and drives of the rig, and the report to the client.
struct Run {
    counters: [Counters; 2],
    session: Session,
    drives: Vec<Drive>,
    report: Option<Result<Timing, ReportLost>>,
}

impl Run {
    fn through(fate: impl FnMut(Kind, u64) -> Fate + Send + 'static) -> Self {
        let scene = scene(&[]);
        let (server, log) = serve_rig(Address::Udp, &scene, PATIENT);
        let (address, _used) = proxy(server.address.socket(), fate);
        let mut rig = NetRig::connect(address, scene.sample_time(), None).unwrap();
        shake(&mut rig, &scene, 400).unwrap();
        let (client, timing) = (rig.counters(), rig.timing());
        drop(rig);
        let (session, drives) = (server.session(), log.all());
        println!("client: {client}\n{session}\n{timing:?}");
        assert_eq!(session.ended, Ended::Farewell);
        assert!(session.samples >= 399);
        // Whatever the network did, the rig only got drives of this client, in their order.
        let driven = &drives[..399];
        assert!(driven.windows(2).all(|pair| pair[0].omega <= pair[1].omega));
        assert!(driven.iter().all(|given| (0..400).any(|n| *given == drive(n))));
        let (counters, report) = ([client, session.counters.unwrap()], timing.get().copied());
        Self { counters, session, drives, report }
    }
}

#[test]
fn the_rig_keeps_its_rate_and_reports_the_lateness_of_its_samples() {
    let Run { session, drives, report, .. } = Run::through(|_, _| Fate::Pass);
    let timing = session.timing.unwrap();
    // However busy the machine is, the samples are as late as the report says.
    let late = session.seconds - session.samples as f64 * session.sample_time;
    let allowed = -2.0 * session.sample_time..timing.worst + 0.1;
    assert!(allowed.contains(&late), "{late} s, {allowed:?}");
    assert_eq!(timing.samples, session.samples);
    let counted: u64 = session.histogram.iter().map(|class| class.1).sum();
    assert_eq!(counted, session.samples);
    assert!(timing.missed <= session.samples && timing.worst >= 0.0);
    // The client gets the figures of the time before its farewell.
    let early = report.unwrap().expect("the report arrives");
    assert!((399..=session.samples).contains(&early.samples));
    assert!(early.missed <= timing.missed && early.worst <= timing.worst);
    // After the farewell the drive ramps down.
    assert_eq!(drives.last().unwrap().amplitude, 0.0);
    let steps = drives.windows(2).map(|pair| pair[0].amplitude - pair[1].amplitude);
    assert!(steps.fold(0.0, f64::max) < 1.5e-4 / f64::from(RAMP_SAMPLES));
}

#[test]
fn lost_late_repeated_corrupted_and_foreign_frames_are_counted_and_what_is_missing_is_held() {
    let run = Run::through(|kind, n| match (kind, n % 16) {
        (Kind::Report, _) => Fate::Pass,
        (_, 2) => Fate::Lose,
        (_, 5) => Fate::Swap,
        (_, 8) => Fate::Repeat,
        (_, 11) => Fate::Corrupt,
        (_, 14) => Fate::Copy,
        _ => Fate::Pass,
    });
    let [client, server] = run.counters;
    for Counters { late, malformed, held, .. } in [client, server] {
        assert!(late >= 45 && malformed >= 20 && held >= 45, "{client}\n{server}");
    }
    // The client's socket takes datagrams of its server only.
    assert!(server.foreign >= 20 && client.foreign == 0);
}

#[test]
fn a_report_that_is_lost_is_sent_again_even_after_the_session_and_one_that_never_comes_is_an_error() {
    // Twelve repetitions take 0.6 s; the session ends after a ramp of 0.11 s.
    let report = |lost: u64| {
        let mut reports = 0;
        let run = Run::through(move |kind, _| {
            reports += u64::from(kind == Kind::Report);
            match kind {
                Kind::Report if reports <= lost => Fate::Lose,
                _ => Fate::Pass,
            }
        });
        run.report.unwrap()
    };
    assert!(report(12).unwrap().samples >= 399);
    assert_eq!(report(u64::MAX), Err(ReportLost));
}

#[test]
fn an_invalid_drive_or_one_of_a_future_sample_is_refused_and_the_last_valid_one_held() {
    let run = Run::through(|kind, n| match (kind, n % 30) {
        (Kind::Drive, 5) => Fate::Rewrite(|frame| frame.values[1] = f64::NAN),
        (Kind::Drive, 10) => Fate::Rewrite(|frame| frame.values[1] = 1e3),
        (Kind::Drive, 15) => Fate::Rewrite(|frame| frame.values[0] = 1e9),
        (Kind::Drive, 20) => Fate::Rewrite(|frame| frame.sequence = u64::MAX),
        (Kind::Drive, 25) => Fate::Rewrite(|frame| frame.sequence += 1000),
        _ => Fate::Pass,
    });
    let [_, server] = run.counters;
    assert!(server.malformed >= 60 && server.held >= 60, "{server}");
    let mut drives = run.drives.iter();
    assert!(drives.all(|drive| drive.amplitude <= 1e-4 && drive.omega < 52.0));
}

#[test]
fn neither_garbage_nor_a_repeated_hello_keeps_a_session_without_a_drive() {
    let scene = scene(&[]);
    let (server, _) = serve_rig(Address::Udp, &scene, PATIENT);
    let client = UdpSocket::bind("127.0.0.1:0").unwrap();
    client.connect(server.address.socket()).unwrap();
    let mut hello = Frame::new(Kind::Hello, 1);
    hello.values[0] = scene.sample_time();
    let stop = AtomicBool::new(false);
    let session = thread::scope(|scope| {
        scope.spawn(|| {
            for n in (0_u64..).take_while(|_| !stop.load(Ordering::Relaxed)) {
                let bytes = if n.is_multiple_of(1000) {
                    hello.encode()
                } else {
                    [0; 84]
                };
                let _ = client.send(&bytes);
                sleep(Duration::from_micros(500));
            }
        });
        let session = server.session();
        stop.store(true, Ordering::Relaxed);
        session
    });
    assert_eq!(session.ended, Ended::Silence);
    assert!((5.0..8.0).contains(&session.seconds), "{}", session.seconds);
}

#[test]
fn a_silence_shuts_the_drive_down_until_another_session_and_a_client_that_returns_is_informed() {
    let scene = scene(&[]);
    let (server, log) = serve_rig(Address::Udp, &scene, 0.3);
    let mut rig = server.rig(&scene);
    shake(&mut rig, &scene, 50).unwrap();
    let session = server.session();
    assert_eq!(session.ended, Ended::Silence);
    assert!(session.counters.unwrap().held as f64 * session.sample_time > 0.3);
    let drives = log.all();
    let held = drives.iter().filter(|given| **given == drive(49)).count();
    assert!(held as f64 * session.sample_time > 0.29, "{held}");
    assert_eq!(drives.last().unwrap().amplitude, 0.0);

    let error = (0..).find_map(|_| shake(&mut rig, &scene, 1).err()).unwrap();
    let informed = matches!(
        link_error(&error),
        LinkError::ShutDown { .. } | LinkError::Silent { .. }
    );
    assert!(informed && error.to_string().contains("0.3 s"), "{error}");
    // Latched: no frame of this client moves the rig again.
    let _ = rig.advance(drive(51), scene.sample_time());
    sleep(Duration::from_millis(50));
    assert_eq!(log.all().len(), drives.len());
    // Another session does.
    let mut next = server.rig(&scene);
    shake(&mut next, &scene, 20).unwrap();
    assert_eq!(log.all()[drives.len()], drive(0));
    drop(next);
    assert_eq!(server.session().ended, Ended::Farewell);
}

#[test]
fn a_rig_that_stops_answering_ends_the_experiment() {
    let scene = scene(&[]);
    let (server, _) = serve_rig(Address::Udp, &scene, 0.3);
    let (address, _used) = proxy(server.address.socket(), |kind, n| match kind {
        Kind::Sensors if n >= 50 => Fate::Lose,
        _ => Fate::Pass,
    });
    let mut rig = NetRig::connect(address, scene.sample_time(), None).unwrap();
    let error = shake(&mut rig, &scene, 100).unwrap_err();
    assert!(matches!(link_error(&error), LinkError::Silent { .. }), "{error}");
}

#[test]
fn a_client_that_falls_behind_is_shut_down_and_no_drive_older_than_the_silence_is_applied() {
    let (scene, silence) = (scene(&[]), 0.2);
    let (server, log) = serve_rig(Address::Udp, &scene, silence);
    let mut rig = server.rig(&scene);
    // Every answer is valid and arrives soon after the one before, but each takes two sample periods.
    let slow = Duration::from_secs_f64(2.0 * scene.sample_time());
    let outcome = (0..2000).try_for_each(|n| {
        rig.sense()?;
        sleep(slow);
        rig.advance(drive(n), scene.sample_time())
    });
    let error = outcome.unwrap_err();
    assert!(matches!(link_error(&error), LinkError::ShutDown { .. }), "{error}");
    assert_eq!(server.session().ended, Ended::Silence);
    let oldest = (silence / scene.sample_time()).ceil() + 1.0;
    for (n, had) in log.all().iter().enumerate() {
        let age = n as f64 - 1024.0 * (had.omega - 50.0);
        assert!(had.amplitude < 1e-4 || age <= oldest, "sample {n}: {age} samples old");
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
    let (rig_server, log) = serve_rig(Address::Udp, &scene, PATIENT);
    let controller_server = serve_controller(&scene, 10.0, StopsAt(200));
    let (mut rig, mut peer) = (rig_server.rig(&scene), controller_server.controller(&scene, Some(0.5)));
    let outcome = experiment::run(&mut rig, &mut peer, &scene, |_, _, _| {});
    let Err(ExperimentError::Controller(error)) = outcome else {
        panic!("{outcome:?}");
    };
    println!("{error}");
    drop(rig);
    assert_eq!(rig_server.session().ended, Ended::Farewell);
    let drives = log.all();
    assert!(drives.iter().any(|had| had.amplitude > 9e-5));
    assert_eq!(drives.last().unwrap().amplitude, 0.0);
}
