//! Guards a rig in real time: it never waits, holds the last valid drive, and shuts it down after a silence.
//!
//! A busy machine misses deadlines and delays every thread. The tests assert only what must hold nevertheless; a silence that is not to be
//! reached is [`PATIENT`].

use std::net::SocketAddr;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, sleep};
use std::time::Duration;

use vines_bench::rig::{Drive, Rig};
use vines_net::frame::{Frame, Kind};
use vines_net::{Address, Counters, Ended, LinkError, NetRig, RAMP_SAMPLES, ReportLost, Session, Timing};

use crate::fixture::socket;
use crate::{PATIENT, SCENE, drive, link_error, serve_rig, shake};

/// Treatment of a datagram by a proxy.
#[derive(Clone, Copy)]
enum Fate {
    /// Passes as this number of equal datagrams; 0: it is lost.
    Pass(u64),
    /// Delayed until the next one in the same direction has passed.
    Swap,
    /// Some bits are inverted.
    Corrupt,
    /// Passes; another sender sends a copy, too.
    Copy,
}

/// A proxy before `server` that ends when the second value is dropped. `fate` determines the treatment of the n-th frame in a direction, and
/// may change its content; the checksum is then correct. Handshake and farewell pass.
fn proxy(server: SocketAddr, mut fate: impl FnMut(&mut Frame, u64) -> Fate + Send + 'static) -> (Address, Arc<()>) {
    let [front, back, stranger] = [(); 3].map(|()| socket());
    for socket in [&front, &back] {
        socket.set_nonblocking(true).unwrap();
    }
    let (address, used) = (Address::Udp(front.local_addr().unwrap()), Arc::new(()));
    let is_used = Arc::clone(&used);
    thread::spawn(move || {
        let (mut client, mut count, mut kept) = (server, [0; 2], [None; 2]);
        while Arc::strong_count(&is_used) > 1 {
            // A pause after every frame would be too slow on a busy machine, and frames would be lost in full buffers.
            let mut is_idle = true;
            for (direction, at, via) in [(0, &front, &back), (1, &back, &front)] {
                let mut bytes = [0; 256];
                let Ok((size, from)) = at.recv_from(&mut bytes) else {
                    continue;
                };
                is_idle = false;
                client = if direction == 0 { from } else { client };
                let to = if direction == 0 { server } else { client };
                let mut frame = Frame::decode(&bytes[..size]).unwrap();
                let (mut treatment, mut held) = (Fate::Pass(1), None);
                if matches!(frame.kind, Kind::Sensors | Kind::Drive | Kind::Report) {
                    (treatment, held) = (fate(&mut frame, count[direction]), kept[direction].take());
                    count[direction] += 1;
                }
                let mut bytes = frame.encode();
                let mut copies = 1;
                match treatment {
                    Fate::Pass(number) => copies = number,
                    Fate::Swap => (copies, kept[direction]) = (0, Some(bytes)),
                    Fate::Corrupt => bytes[37] ^= 0x50,
                    Fate::Copy => drop(stranger.send_to(&bytes, to).unwrap()),
                }
                for bytes in (0..copies).map(|_| bytes).chain(held) {
                    assert_eq!(via.send_to(&bytes, to).unwrap(), bytes.len());
                }
            }
            if is_idle {
                sleep(Duration::from_micros(20));
            }
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
    fn through(fate: impl FnMut(&mut Frame, u64) -> Fate + Send + 'static) -> Self {
        let server = serve_rig(Address::Udp, &SCENE, PATIENT);
        let (address, _used) = proxy(server.address.socket(), fate);
        let mut rig = NetRig::connect(address, SCENE.sample_time(), None).unwrap();
        shake(&mut rig, 400).unwrap();
        let (client, timing) = (rig.counters(), rig.timing());
        drop(rig);
        let (session, drives) = (server.session(), server.drives());
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
    let Run { session, drives, report, .. } = Run::through(|_, _| Fate::Pass(1));
    let timing = session.timing.unwrap();
    // However busy the machine is, no sample is early, and the last one is at most as late as the report says. (Instants have 1 ns.)
    let late = session.seconds - session.samples as f64 * session.sample_time;
    assert!((-1e-9..=timing.worst + 1e-9).contains(&late), "{late} s, {timing}");
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
    let text = Session { samples: 0, seconds: 0.0, ..session }.to_string();
    assert!(text.contains("0 samples in 0.000 s: 0.0 per second"), "{text}");
}

#[test]
fn lost_late_repeated_corrupted_and_foreign_frames_are_counted_and_what_is_missing_is_held() {
    let run = Run::through(|frame, n| match (frame.kind, n % 16) {
        (Kind::Report, _) => Fate::Pass(1),
        (_, 2) => Fate::Pass(0),
        (_, 5) => Fate::Swap,
        (_, 8) => Fate::Pass(2),
        (_, 11) => Fate::Corrupt,
        (_, 14) => Fate::Copy,
        _ => Fate::Pass(1),
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
        let run = Run::through(move |frame, _| {
            let is_report = frame.kind == Kind::Report;
            reports += u64::from(is_report);
            Fate::Pass(u64::from(!is_report || reports > lost))
        });
        run.report.unwrap()
    };
    assert!(report(12).unwrap().samples >= 399);
    assert_eq!(report(u64::MAX), Err(ReportLost));
}

#[test]
fn an_invalid_drive_or_one_of_a_future_sample_is_refused_and_the_last_valid_one_held() {
    let run = Run::through(|frame, n| {
        match (frame.kind, n % 30) {
            (Kind::Drive, 5) => frame.values[1] = f64::NAN,
            (Kind::Drive, 10) => frame.values[1] = 1e3,
            (Kind::Drive, 15) => frame.values[0] = 1e9,
            (Kind::Drive, 20) => frame.sequence = u64::MAX,
            (Kind::Drive, 25) => frame.sequence += 1000,
            _ => {}
        }
        Fate::Pass(1)
    });
    let [_, server] = run.counters;
    assert!(server.malformed >= 60 && server.held >= 60, "{server}");
    let mut drives = run.drives.iter();
    assert!(drives.all(|drive| drive.amplitude <= 1e-4 && drive.omega < 52.0));
}

#[test]
fn neither_garbage_nor_a_repeated_hello_keeps_a_session_without_a_drive() {
    let server = serve_rig(Address::Udp, &SCENE, PATIENT);
    let client = socket();
    client.connect(server.address.socket()).unwrap();
    let mut hello = Frame::new(Kind::Hello, 1);
    hello.values[0] = SCENE.sample_time();
    let stop = AtomicBool::new(false);
    let session = thread::scope(|scope| {
        scope.spawn(|| {
            for n in (0_u64..).take_while(|_| !stop.load(Ordering::Relaxed)) {
                let is_hello = n.is_multiple_of(1000);
                let _ = client.send(&if is_hello { hello.encode() } else { [0; 84] });
                sleep(Duration::from_micros(500));
            }
        });
        let session = server.session();
        stop.store(true, Ordering::Relaxed);
        session
    });
    assert_eq!(session.ended, Ended::Silence);
    assert!(session.seconds >= 5.0, "{}", session.seconds);
}

#[test]
fn a_silence_shuts_the_drive_down_until_another_session_and_a_client_that_returns_is_informed() {
    let server = serve_rig(Address::Udp, &SCENE, PATIENT);
    let mut rig = server.rig();
    shake(&mut rig, 50).unwrap();
    let session = server.session();
    assert_eq!(session.ended, Ended::Silence);
    assert!(session.counters.unwrap().held as f64 * session.sample_time > PATIENT);
    let drives = server.drives();
    // Its silence counts from the sample that the last drive belongs to.
    let last = drives.iter().rposition(|given| *given == drive(49)).unwrap() - 49;
    assert!((last as f64 * session.sample_time - PATIENT).abs() < 0.01, "{last}");
    assert_eq!(server.last().amplitude, 0.0);

    let error = (0..).find_map(|_| shake(&mut rig, 1).err()).unwrap();
    let cause = link_error(&error);
    let informed = matches!(cause, LinkError::ShutDown { .. } | LinkError::Silent { .. });
    assert!(
        informed && error.to_string().contains(&format!("{PATIENT} s")),
        "{error}"
    );
    // Latched: no frame of this client moves the rig again.
    let _ = rig.advance(drive(51), SCENE.sample_time());
    sleep(Duration::from_millis(50));
    assert_eq!(server.drives().len(), drives.len());
    // Another session does.
    let mut next = server.rig();
    shake(&mut next, 20).unwrap();
    assert_eq!(server.drives()[drives.len()], drive(0));
    drop(next);
    assert_eq!(server.session().ended, Ended::Farewell);
}

#[test]
fn a_rig_that_stops_answering_ends_the_experiment() {
    let server = serve_rig(Address::Udp, &SCENE, PATIENT);
    let answers = |frame: &mut Frame, n| Fate::Pass(u64::from(frame.kind != Kind::Sensors || n < 50));
    let (address, _used) = proxy(server.address.socket(), answers);
    let mut rig = NetRig::connect(address, SCENE.sample_time(), None).unwrap();
    let error = shake(&mut rig, 100).unwrap_err();
    assert!(matches!(link_error(&error), LinkError::Silent { .. }), "{error}");
}

#[test]
fn a_client_that_falls_behind_is_shut_down_and_no_drive_older_than_the_silence_is_applied() {
    let (step, silence) = (SCENE.sample_time(), 0.2);
    let server = serve_rig(Address::Udp, &SCENE, silence);
    let mut rig = server.rig();
    // Every answer is valid and arrives soon after the one before, but each takes two sample periods.
    let outcome = (0..2000).try_for_each(|n| {
        rig.sense()?;
        sleep(Duration::from_secs_f64(2.0 * step));
        rig.advance(drive(n), step)
    });
    // On a busy machine, the server may be silent as well.
    let error = outcome.unwrap_err();
    let informed = matches!(
        link_error(&error),
        LinkError::ShutDown { .. } | LinkError::Silent { .. }
    );
    assert!(informed, "{error}");
    assert_eq!(server.session().ended, Ended::Silence);
    let oldest = (silence / step).ceil() + 1.0;
    for (n, had) in server.drives().iter().enumerate() {
        let age = n as f64 - 1024.0 * (had.omega - 50.0);
        assert!(had.amplitude < 1e-4 || age <= oldest, "sample {n}: {age} samples old");
    }
}
