//! Guards the device on loopback: sessions, and the drive that stops when the stream, the host or the control channel hangs.
//! Nothing here depends on how fast the machine is.

use std::io::{Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use vines_helic::codec::{Frame, message};
use vines_helic::{Device, HelicRig, HelicServer, Network, Transport};
use vines_net::{Ended, Session};
use vines_testbench::rig::{Drive, Rig, RigError, Sensors};
use vines_testbench::scene::Names;

use super::host::{device, scene};

/// A silence longer than the pauses of a busy machine.
const PATIENT: Duration = Duration::from_secs(2);

/// A server in a thread.
struct Served {
    address: SocketAddr,
    stop: Arc<AtomicBool>,
    thread: JoinHandle<Vec<Session>>,
}

impl Served {
    fn start(device: impl FnOnce() -> Device + Send + 'static) -> Self {
        let stop = Arc::new(AtomicBool::new(false));
        let (flag, (tell, told)) = (Arc::clone(&stop), std::sync::mpsc::channel());
        let thread = thread::spawn(move || {
            let address = ([127, 0, 0, 1], 0).into();
            let mut server = HelicServer::listen(address, device(), scene().sample_time()).unwrap();
            tell.send(server.address().unwrap()).unwrap();
            let mut sessions = Vec::new();
            server
                .serve(
                    || flag.load(Ordering::Relaxed),
                    |session| sessions.push(session.clone()),
                )
                .unwrap();
            sessions
        });
        Self { address: told.recv().unwrap(), stop, thread }
    }

    fn end(self) -> Vec<Session> {
        self.stop.store(true, Ordering::Relaxed);
        self.thread.join().unwrap()
    }
}

#[test]
fn a_device_on_the_network_is_driven_and_disarmed_when_its_host_leaves() {
    let (scene, server) = (scene(), Served::start(device));
    let network = Network::connect(server.address, PATIENT).unwrap();
    let mut rig = HelicRig::new(network, &Names::default(), scene.sample_time(), 100.0).unwrap();
    let drive = Drive { omega: 55.0, amplitude: 9e-5, displacement: 0.0 };
    let mut largest = 0.0_f64;
    for _ in 0..400 {
        largest = largest.max(rig.sense().unwrap().reference.unwrap().abs());
        rig.advance(drive, scene.sample_time()).unwrap();
    }
    assert!((largest / 9e-5 - 1.0).abs() < 0.05, "{largest}");
    drop(rig);
    // The next host finds the output off.
    let mut host = TcpStream::connect(server.address).unwrap();
    let status = Frame { kind: message::STATUS, sequence: 9, payload: vec![] };
    host.write_all(&status.encode()).unwrap();
    let mut answer = vec![0; 20];
    host.read_exact(&mut answer).unwrap();
    assert_eq!(Frame::take(&mut answer).unwrap().unwrap().sequence, 9);
    drop(host);
    let sessions = server.end();
    assert!(
        sessions.iter().all(|session| session.ended == Ended::Farewell),
        "{sessions:?}"
    );
}

#[test]
fn bad_framing_ends_that_connection_only() {
    let server = Served::start(device);
    let mut bad = TcpStream::connect(server.address).unwrap();
    let mut bytes = Frame { kind: message::STATUS, sequence: 1, payload: vec![] }.encode();
    *bytes.last_mut().unwrap() ^= 255;
    bad.write_all(&bytes).unwrap();
    assert_eq!(bad.read(&mut [0; 8]).unwrap(), 0);
    let mut good = TcpStream::connect(server.address).unwrap();
    *bytes.last_mut().unwrap() ^= 255;
    // In pieces: TCP has no frames.
    for byte in bytes {
        good.write_all(&[byte]).unwrap();
    }
    good.read_exact(&mut [0; 20]).unwrap();
    drop(good);
    server.end();
}

/// A silence after which the drive must be off.
const SHORT: Duration = Duration::from_millis(500);

/// A rig that shows the displacement of its base.
struct Base(Arc<Mutex<f64>>);

impl Rig for Base {
    fn sense(&mut self) -> Result<Sensors, RigError> {
        Ok(Sensors { response: 0.0, reference: Some(*self.0.lock().unwrap()) })
    }

    fn advance(&mut self, _: Drive, _: f64) -> Result<(), RigError> {
        unreachable!()
    }

    fn hold(&mut self, drive: Drive, _: f64) -> Result<(), RigError> {
        *self.0.lock().unwrap() = drive.displacement;
        Ok(())
    }
}

fn base() -> (Served, Arc<Mutex<f64>>) {
    let base = Arc::<Mutex<f64>>::default();
    let rig = Base(Arc::clone(&base));
    let device = || Device::new(Box::new(rig), scene().sample_time(), 1e-2).unwrap();
    (Served::start(device), base)
}

/// Drives the device for `samples` samples with a frequency that always changes.
fn drive(rig: &mut HelicRig<Network>, samples: u32) -> Result<(), RigError> {
    (0..samples).try_for_each(|n| {
        rig.sense()?;
        let drive = Drive {
            omega: 55.0 + 1e-3 * f64::from(n),
            amplitude: 9e-5,
            displacement: 0.0,
        };
        rig.advance(drive, scene().sample_time())
    })
}

fn connected(address: SocketAddr) -> HelicRig<Network> {
    let network = Network::connect(address, SHORT).unwrap();
    HelicRig::new(network, &Names::default(), scene().sample_time(), 100.0).unwrap()
}

fn is_off(base: &Mutex<f64>) -> bool {
    // One value may be zero by chance.
    (0..20).all(|_| {
        thread::sleep(Duration::from_millis(3));
        *base.lock().unwrap() == 0.0
    })
}

#[test]
fn a_stream_that_stops_ends_the_drive_and_says_so() {
    let (server, base) = base();
    let mut rig = connected(server.address);
    drive(&mut rig, 200).unwrap();
    assert!(!is_off(&base));
    let stop = Frame { kind: message::STREAM_STOP, sequence: 0, payload: vec![] };
    rig.transport().request(&stop).unwrap();
    // More than a busy machine has waiting.
    let message = drive(&mut rig, 5000).unwrap_err().to_string();
    assert!(
        message.contains("no packet of its stream has arrived for 0.5"),
        "{message}"
    );
    assert!(is_off(&base));
    drop(rig);
    server.end();
}

#[test]
fn a_host_that_takes_no_readings_any_more_ends_the_drive_and_learns_why() {
    let (server, base) = base();
    let mut rig = connected(server.address);
    drive(&mut rig, 200).unwrap();
    assert!(!is_off(&base));
    thread::sleep(2 * SHORT);
    assert!(is_off(&base));
    let message = drive(&mut rig, 2000).unwrap_err().to_string();
    assert!(message.contains("took no reading for 0.5 s"), "{message}");
    drop(rig);
    server.end();
}

/// Carries the control channel to `server` until `dead` is set, and then nothing any more, not even the end of the connection.
fn carrier(server: SocketAddr, dead: Arc<AtomicBool>) -> SocketAddr {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap();
    thread::spawn(move || {
        let host = listener.accept().unwrap().0;
        let device = TcpStream::connect(server).unwrap();
        let ways = [(&host, &device), (&device, &host)];
        let mut bytes = [0; 2048];
        for way in [&host, &device] {
            way.set_nodelay(true).unwrap();
            way.set_read_timeout(Some(Duration::from_millis(1))).unwrap();
        }
        let mut open = 0;
        while open < 60_000 {
            open += 1;
            for (mut from, mut to) in ways {
                if dead.load(Ordering::Relaxed) {
                    thread::sleep(Duration::from_millis(1));
                } else if let Ok(size) = from.read(&mut bytes) {
                    if size == 0 {
                        return;
                    }
                    to.write_all(&bytes[..size]).unwrap();
                }
            }
        }
    });
    address
}

#[test]
fn a_dead_control_channel_ends_the_drive_of_a_device_with_a_watchdog() {
    let (server, base) = base();
    let dead = Arc::new(AtomicBool::new(false));
    let mut rig = connected(carrier(server.address, Arc::clone(&dead)));
    drive(&mut rig, 200).unwrap();
    assert!(!is_off(&base));
    dead.store(true, Ordering::Relaxed);
    let message = drive(&mut rig, 5000).unwrap_err().to_string();
    println!("{message}");
    assert!(message.contains("no answer for 0."), "{message}");
    // Nothing reaches the device: its own watchdog has stopped it.
    thread::sleep(SHORT);
    assert!(is_off(&base));
    drop(rig);
    server.end();
}
