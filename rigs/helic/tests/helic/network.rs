//! Guards the device on loopback: sessions, and the drive that stops when the stream, the host or the control channel hangs.
//! A host or a device on a machine that is too busy stops the drive as well, and says so: then the test tries again.

use std::io::{Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle, sleep};
use std::time::{Duration, Instant};

use vines_bench::rig::{Drive, Rig, RigError};
use vines_bench::scene::Names;
use vines_helic::codec::{Frame, message};
use vines_helic::{HelicRig, Network, Transport, listen, serve};
use vines_net::{Ended, Session};

use super::host::{Base, scene};

/// Longest silence: longer than the pauses of a busy machine.
const PATIENT: Duration = Duration::from_secs(2);

/// A server in a thread, and its rig.
struct Served {
    address: SocketAddr,
    base: Base,
    stop: Arc<AtomicBool>,
    thread: JoinHandle<Vec<Session>>,
}

impl Served {
    fn start() -> Self {
        let (base, stop) = (Base::default(), Arc::new(AtomicBool::new(false)));
        let (flag, rig, (tell, told)) = (Arc::clone(&stop), base.clone(), std::sync::mpsc::channel());
        let thread = thread::spawn(move || {
            let (address, step) = (([127, 0, 0, 1], 0).into(), scene().sample_time());
            let sockets = listen(address).unwrap();
            tell.send(sockets.0.local_addr().unwrap()).unwrap();
            let mut sessions = Vec::new();
            let report = |session: &Session| sessions.push(session.clone());
            serve(sockets, rig.device(1e-2), step, || flag.load(Ordering::Relaxed), report).unwrap();
            sessions
        });
        Self { address: told.recv().unwrap(), base, stop, thread }
    }

    /// Whether the base stands still. One value may be zero by chance.
    fn is_off(&self) -> bool {
        (0..20).all(|_| {
            sleep(Duration::from_millis(3));
            self.base.get() == 0.0
        })
    }

    /// Waits until the base stands still.
    fn comes_to_rest(&self) {
        let began = Instant::now();
        while !self.is_off() {
            assert!(began.elapsed() < Duration::from_secs(60), "the base is still driven");
        }
    }

    fn end(self) -> Vec<Session> {
        self.stop.store(true, Ordering::Relaxed);
        self.thread.join().unwrap()
    }
}

fn connect(address: SocketAddr) -> Result<HelicRig<Network>, RigError> {
    let network = Network::connect(address, PATIENT).unwrap();
    HelicRig::new(network, &Names::default(), scene().sample_time(), 100.0)
}

/// Repeats an attempt that ended because the machine is too busy for a rig in real time; any other error fails the test.
fn eventually(mut attempt: impl FnMut() -> Result<(), String>) {
    let began = Instant::now();
    while let Err(error) = attempt() {
        println!("{error}");
        let busy = [
            "took no reading for 2 s",
            "no packet of its stream has arrived for 2.",
            "no answer for 2.",
            "of the helic device did not arrive",
            "output of the helic device is off",
        ];
        assert!(busy.iter().any(|part| error.contains(part)), "{error}");
        assert!(began.elapsed() < Duration::from_secs(600), "{error}");
    }
}

/// Drives the device for `samples` samples with a frequency that always changes; returns the largest base displacement.
fn drive(rig: &mut HelicRig<Network>, samples: u32) -> Result<f64, RigError> {
    (0..samples).try_fold(0.0, |largest: f64, n| {
        let base = rig.sense()?.reference.unwrap().abs();
        let omega = 55.0 + 1e-3 * f64::from(n);
        rig.advance(
            Drive { omega, amplitude: 9e-5, ..Drive::default() },
            scene().sample_time(),
        )?;
        Ok(largest.max(base))
    })
}

/// Drives the device until its base moves with the whole amplitude: commands and readings may be late.
fn drive_until_it_moves(rig: &mut HelicRig<Network>) -> Result<(), RigError> {
    loop {
        let share = drive(rig, 50)? / 9e-5;
        assert!(share < 1.05, "{share}");
        if share > 0.95 {
            return Ok(());
        }
    }
}

#[test]
fn a_device_on_the_network_is_driven_and_disarmed_when_its_host_leaves() {
    eventually(|| {
        let server = Served::start();
        let driven = connect(server.address).and_then(|mut rig| drive_until_it_moves(&mut rig));
        server.comes_to_rest();
        let sessions = server.end();
        assert_eq!(sessions.len(), 1);
        assert_eq!(sessions[0].ended, Ended::Farewell);
        driven.map_err(|error| error.to_string())
    });
}

#[test]
fn bad_framing_ends_that_connection_only() {
    let server = Served::start();
    let mut bytes = Frame { sequence: 9, ..Frame::new(message::STATUS, []) }.encode();
    let mut bad = TcpStream::connect(server.address).unwrap();
    *bytes.last_mut().unwrap() ^= 255;
    bad.write_all(&bytes).unwrap();
    assert_eq!(bad.read(&mut [0; 8]).unwrap(), 0);
    *bytes.last_mut().unwrap() ^= 255;
    // In pieces: TCP has no frames.
    let mut good = TcpStream::connect(server.address).unwrap();
    bytes.iter().for_each(|byte| good.write_all(&[*byte]).unwrap());
    assert_eq!(Frame::read(&mut good, &mut Vec::new()).unwrap().sequence, 9);
    drop(good);
    server.end();
}

/// Carries the control channel to `server` until `dead` is set, and then nothing any more, not even the end of the connection.
fn carrier(server: SocketAddr, dead: Arc<AtomicBool>) -> SocketAddr {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap();
    thread::spawn(move || {
        let ends = [listener.accept().unwrap().0, TcpStream::connect(server).unwrap()];
        for end in &ends {
            end.set_nodelay(true).unwrap();
            end.set_read_timeout(Some(Duration::from_millis(1))).unwrap();
        }
        let mut bytes = [0; 2048];
        for turn in 0..120_000 {
            let [mut from, mut to] = [&ends[turn % 2], &ends[1 - turn % 2]];
            if dead.load(Ordering::Relaxed) {
                sleep(Duration::from_millis(1));
            } else if let Ok(size) = from.read(&mut bytes) {
                if size == 0 {
                    return;
                }
                to.write_all(&bytes[..size]).unwrap();
            }
        }
    });
    address
}

#[test]
fn a_stream_a_host_and_a_control_channel_that_hang_end_the_drive_and_say_so() {
    for message in [
        "no packet of its stream has arrived for ",
        "took no reading for 2 s",
        "no answer for ",
    ] {
        eventually(|| {
            let (server, dead) = (Served::start(), Arc::new(AtomicBool::new(false)));
            let carried = message
                .starts_with("no answer")
                .then(|| carrier(server.address, Arc::clone(&dead)));
            let hang = || {
                let mut rig = connect(carried.unwrap_or(server.address))?;
                drive_until_it_moves(&mut rig)?;
                match &message[..4] {
                    "no p" => drop(rig.transport.request(&Frame::new(message::STREAM_STOP, []))),
                    "took" => sleep(2 * PATIENT),
                    // Nothing reaches the device any more: its own watchdog stops it.
                    _ => dead.store(true, Ordering::Relaxed),
                }
                let outcome = drive(&mut rig, u32::MAX);
                // The host has not left: it is the end of the drive that brings the base to rest.
                server.comes_to_rest();
                outcome
            };
            let error = hang().unwrap_err().to_string();
            server.end();
            error.contains(message).then_some(()).ok_or(error)
        });
    }
}
