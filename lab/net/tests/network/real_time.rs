//! A rig in real time: it never waits, holds the last valid drive, and shuts it down after a silence.
//!
//! A busy machine misses deadlines now and then. The tests assert only what must hold nevertheless.

use std::io::ErrorKind;
use std::net::{SocketAddr, UdpSocket};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, sleep};
use std::time::{Duration, Instant};

use vines_net::frame::{Frame, Kind};
use vines_net::{Address, Counters, Ended, LinkError, NetRig, RAMP_SAMPLES, ReportLost, Session, Timing};
use vines_testbench::experiment::{self, ExperimentError, Plan};
use vines_testbench::rig::{Command, Controller, ControllerError, Drive, Rig, Sensors, Simulated};

use crate::{LONGEST, PATIENT, drive, scene, serve_controller, serve_rig, shake};

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

/// A proxy that loses, repeats, reorders and changes datagrams; it stops when it is dropped.
struct Proxy {
    address: Address,
    stop: Arc<AtomicBool>,
}

impl Proxy {
    /// Forwards to `server`. `fate` determines the treatment of the n-th frame in a direction; handshake and farewell pass.
    fn before(server: SocketAddr, fate: impl FnMut(Kind, u64) -> Fate + Send + 'static) -> Self {
        let [front, back, stranger] = [(); 3].map(|()| {
            let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
            socket.set_nonblocking(true).unwrap();
            socket
        });
        let address = Address::Udp(front.local_addr().unwrap());
        let stop = Arc::new(AtomicBool::new(false));
        let stopped = Arc::clone(&stop);
        let mut carrier = Carrier { fate, stranger, count: [0; 2], kept: [None, None] };
        thread::spawn(move || {
            let (end, mut client, mut bytes) = (Instant::now() + LONGEST, None, [0; 256]);
            while !stopped.load(Ordering::Relaxed) && Instant::now() < end {
                let request = receive(&front, &mut bytes);
                if let Some((size, from)) = request {
                    client = Some(from);
                    carrier.carry(0, &mut bytes[..size], &back, server);
                }
                let answer = receive(&back, &mut bytes);
                if let (Some((size, _)), Some(client)) = (answer, client) {
                    carrier.carry(1, &mut bytes[..size], &front, client);
                }
                if request.is_none() && answer.is_none() {
                    sleep(Duration::from_micros(20));
                }
            }
        });
        Self { address, stop }
    }
}

impl Drop for Proxy {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
    }
}

fn receive(socket: &UdpSocket, bytes: &mut [u8]) -> Option<(usize, SocketAddr)> {
    let received = socket.recv_from(bytes);
    if let Err(error) = &received {
        let expected = [ErrorKind::ConnectionRefused, ErrorKind::WouldBlock];
        assert!(expected.contains(&error.kind()), "{error}");
    }
    received.ok()
}

struct Carrier<F> {
    fate: F,
    stranger: UdpSocket,
    /// Number of frames, and the delayed one, in each direction.
    count: [u64; 2],
    kept: [Option<Vec<u8>>; 2],
}

impl<F: FnMut(Kind, u64) -> Fate> Carrier<F> {
    fn carry(&mut self, direction: usize, bytes: &mut [u8], via: &UdpSocket, to: SocketAddr) {
        let send = |bytes: &[u8]| assert_eq!(via.send_to(bytes, to).unwrap(), bytes.len());
        let mut frame = Frame::decode(bytes).unwrap();
        if !matches!(frame.kind, Kind::Sensors | Kind::Drive | Kind::Report) {
            return send(bytes);
        }
        let fate = (self.fate)(frame.kind, self.count[direction]);
        self.count[direction] += 1;
        match fate {
            Fate::Pass => send(bytes),
            Fate::Lose => {}
            Fate::Repeat => (0..2).for_each(|_| send(bytes)),
            Fate::Swap => {
                self.kept[direction] = Some(bytes.to_vec());
                return;
            }
            Fate::Corrupt => {
                bytes[37] ^= 0x50;
                send(bytes);
            }
            Fate::Copy => {
                self.stranger.send_to(bytes, to).unwrap();
                send(bytes);
            }
            Fate::Rewrite(change) => {
                change(&mut frame);
                send(&frame.encode());
            }
        }
        if let Some(kept) = self.kept[direction].take() {
            send(&kept);
        }
    }
}

/// What a run through a proxy leaves: counters of the client, session and drives of the rig, and the report to the client.
struct Run {
    client: Counters,
    session: Session,
    drives: Vec<Drive>,
    report: Option<Result<Timing, ReportLost>>,
}

impl Run {
    fn through(fate: impl FnMut(Kind, u64) -> Fate + Send + 'static) -> Self {
        let scene = scene(&[]);
        let (server, log) = serve_rig(Address::Udp, &scene, PATIENT);
        let proxy = Proxy::before(server.address.socket(), fate);
        let mut rig = NetRig::connect(proxy.address, scene.sample_time(), None).unwrap();
        shake(&mut rig, &scene, 400).unwrap();
        let (client, timing) = (rig.counters(), rig.timing());
        drop(rig);
        let (session, drives) = (server.session(1), log.lock().unwrap().clone());
        println!("client: {client}\n{session}\n{timing:?}");
        assert_eq!(session.ended, Ended::Farewell);
        assert!(session.samples >= 399);
        // Whatever the network did, the rig only got drives of this client, in their order.
        let driven = &drives[..399];
        assert!(driven.windows(2).all(|pair| pair[0].omega <= pair[1].omega));
        assert!(driven.iter().all(|given| (0..400).any(|n| *given == drive(n))));
        let report = timing.get().copied();
        Self { client, session, drives, report }
    }

    /// The counters of client and server.
    fn counters(&self) -> [Counters; 2] {
        [self.client, self.session.counters.unwrap()]
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
    assert_eq!(
        session.histogram.iter().map(|class| class.1).sum::<u64>(),
        session.samples
    );
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
fn what_is_lost_is_held_and_what_arrives_after_a_later_frame_is_not_used() {
    let run = Run::through(|kind, n| match (kind, n % 10) {
        (Kind::Drive | Kind::Sensors, 2) => Fate::Lose,
        (Kind::Drive | Kind::Sensors, 6) => Fate::Swap,
        _ => Fate::Pass,
    });
    for counters in run.counters() {
        assert!(counters.late >= 35 && counters.held >= 35, "{counters}");
    }
    assert!(run.client.held >= 70, "{}", run.client);
}

#[test]
fn a_report_that_is_lost_is_sent_again_even_after_the_session_and_one_that_never_comes_is_an_error() {
    // Twelve repetitions take 0.6 s; the session ends after a ramp of 0.11 s.
    let report = |lost: u64| {
        let mut reports = 0;
        let run = Run::through(move |kind, _| {
            reports += u64::from(kind == Kind::Report);
            if kind == Kind::Report && reports <= lost {
                Fate::Lose
            } else {
                Fate::Pass
            }
        });
        run.report.unwrap()
    };
    assert!(report(12).unwrap().samples >= 399);
    assert_eq!(report(u64::MAX), Err(ReportLost));
}

#[test]
fn repeated_corrupted_and_copied_frames_are_counted_one_by_one() {
    let run = Run::through(|_, n| match n % 12 {
        3 => Fate::Repeat,
        6 => Fate::Corrupt,
        9 => Fate::Copy,
        _ => Fate::Pass,
    });
    let [client, server] = run.counters();
    for counters in [client, server] {
        assert!(counters.late >= 25 && counters.malformed >= 25, "{counters}");
    }
    // The client's socket takes datagrams of its server only.
    assert!(server.foreign >= 25 && client.foreign == 0);
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
    let [_, server] = run.counters();
    assert!(server.malformed >= 60 && server.held >= 60, "{server}");
    assert!(
        run.drives
            .iter()
            .all(|drive| drive.amplitude <= 1e-4 && drive.omega < 52.0)
    );
}

#[test]
fn the_readings_of_a_blackout_repeat_the_period_before() {
    let scene = scene(&[]);
    let (server, log) = serve_rig(Address::Udp, &scene, PATIENT);
    let lost = 250..277;
    let blackout = lost.clone();
    let proxy = Proxy::before(server.address.socket(), move |kind, n| match kind {
        Kind::Sensors if blackout.contains(&(n as usize)) => Fate::Lose,
        _ => Fate::Pass,
    });
    let mut rig = NetRig::connect(proxy.address, scene.sample_time(), None).unwrap();
    let readings = shake(&mut rig, &scene, 400).unwrap();
    let client = rig.counters();
    assert!(client.held >= 27 && client.longest >= 27);
    let longest = format!("at most {} in a row", client.longest);
    assert!(client.to_string().contains(&longest), "{client}");
    drop(rig);
    server.session(1);
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
    let (server, _) = serve_rig(Address::Udp, &scene, PATIENT);
    let client = UdpSocket::bind("127.0.0.1:0").unwrap();
    client.connect(server.address.socket()).unwrap();
    let mut hello = Frame::new(Kind::Hello, 1);
    hello.values[0] = scene.sample_time();
    let stop = Arc::new(AtomicBool::new(false));
    let stopped = Arc::clone(&stop);
    let noise = thread::spawn(move || {
        let running = (0_u64..).take_while(|_| !stopped.load(Ordering::Relaxed));
        running.for_each(|n| {
            let bytes = if n.is_multiple_of(1000) {
                hello.encode()
            } else {
                [0; 84]
            };
            let _ = client.send(&bytes);
            sleep(Duration::from_micros(500));
        });
    });
    let session = server.session(1);
    stop.store(true, Ordering::Relaxed);
    noise.join().unwrap();
    assert_eq!(session.ended, Ended::Silence);
    assert!((5.0..8.0).contains(&session.seconds), "{}", session.seconds);
}

#[test]
fn a_silence_shuts_the_drive_down_until_another_session_and_a_client_that_returns_is_informed() {
    let scene = scene(&[]);
    let (server, log) = serve_rig(Address::Udp, &scene, 0.3);
    let mut rig = server.rig(&scene);
    shake(&mut rig, &scene, 50).unwrap();
    let session = server.session(1);
    assert_eq!(session.ended, Ended::Silence);
    assert!(session.counters.unwrap().held as f64 * session.sample_time > 0.3);
    let drives = log.lock().unwrap().clone();
    let held = drives.iter().filter(|given| **given == drive(49)).count();
    assert!(held as f64 * session.sample_time > 0.29, "{held}");
    assert_eq!(drives.last().unwrap().amplitude, 0.0);

    let error = (0..).find_map(|_| shake(&mut rig, &scene, 1).err()).unwrap();
    let Some(LinkError::ShutDown { .. } | LinkError::Silent { .. }) = error.cause() else {
        panic!("{error}");
    };
    assert!(error.to_string().contains("0.3 s"), "{error}");
    // Latched: no frame of this client moves the rig again.
    let _ = rig.advance(drive(51), scene.sample_time());
    sleep(Duration::from_millis(50));
    assert_eq!(log.lock().unwrap().len(), drives.len());
    // Another session does.
    let mut next = server.rig(&scene);
    shake(&mut next, &scene, 20).unwrap();
    assert_eq!(log.lock().unwrap()[drives.len()], drive(0));
    drop(next);
    assert_eq!(server.session(2).ended, Ended::Farewell);
}

#[test]
fn a_rig_that_stops_answering_ends_the_experiment() {
    let scene = scene(&[]);
    let (server, _) = serve_rig(Address::Udp, &scene, 0.3);
    let proxy = Proxy::before(server.address.socket(), |kind, n| match kind {
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
    assert!(matches!(error.cause(), Some(LinkError::ShutDown { .. })), "{error}");
    assert_eq!(server.session(1).ended, Ended::Silence);
    let oldest = (silence / scene.sample_time()).ceil() + 1.0;
    for (n, had) in log.lock().unwrap().iter().enumerate() {
        let age = n as f64 - 1024.0 * (had.omega - 50.0);
        assert!(
            had.amplitude < 1e-4 || age <= oldest,
            "the drive of sample {n} is {age} samples old"
        );
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
    let controller_server = serve_controller(&scene, 10.0, || StopsAt(200));
    let (mut rig, mut peer) = (rig_server.rig(&scene), controller_server.controller(&scene, Some(0.5)));
    let outcome = experiment::run(&mut rig, &mut peer, &Plan::of(&scene), |_, _, _| {});
    let Err(ExperimentError::Controller(error)) = outcome else {
        panic!("{outcome:?}");
    };
    println!("{error}");
    drop(rig);
    assert_eq!(rig_server.session(1).ended, Ended::Farewell);
    let drives = log.lock().unwrap();
    assert!(drives.iter().any(|had| had.amplitude > 9e-5));
    assert_eq!(drives.last().unwrap().amplitude, 0.0);
}
