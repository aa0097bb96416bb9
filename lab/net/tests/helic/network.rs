//! The device on loopback. Nothing here depends on how fast the machine is.

use std::io::{Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};

use vines_net::helic::codec::{Frame, message};
use vines_net::helic::{Channels, HelicRig, HelicServer, Network};
use vines_net::{Ended, Session};
use vines_testbench::rig::{Drive, Rig};

use super::host::{device, scene};

/// A server in a thread.
struct Served {
    address: SocketAddr,
    stop: Arc<AtomicBool>,
    thread: JoinHandle<Vec<Session>>,
}

impl Served {
    fn start() -> Self {
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
    let (scene, server) = (scene(), Served::start());
    let network = Network::connect(server.address).unwrap();
    let mut rig = HelicRig::new(network, Channels::default(), scene.sample_time(), 100.0).unwrap();
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
    let mut answer = [0; 20];
    host.read_exact(&mut answer).unwrap();
    assert_eq!(Frame::decode(&answer).unwrap().unwrap().0.sequence, 9);
    drop(host);
    let sessions = server.end();
    assert!(
        sessions.iter().all(|session| session.ended == Ended::Farewell),
        "{sessions:?}"
    );
}

#[test]
fn bad_framing_ends_that_connection_only() {
    let server = Served::start();
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
