//! Guards every connection against random and mutated frames: no panic, and no drive reaches a rig that was not sent.
//!
//! `scripts/stress --network` runs this with 10^7 frames per connection; FRAMES and SEED set both. The suite takes a small part.

#[path = "../fixture/mod.rs"]
mod fixture;
mod noise;

use std::collections::HashMap;
use std::io::{Read, Write};
use std::net::{SocketAddr, TcpStream, UdpSocket};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::Duration;

use vines_bench::rig::{Drive, Rig, RigError, Sensors};
use vines_bench::scene::Definition;
use vines_net::frame::{Frame, Kind, SIZE, flag};
use vines_net::{Address, Key, NetRig, Role, Served, Service};

use fixture::{Running, socket};
use noise::{Noise, size};

const SAMPLE_TIME: f64 = 1e-3;
const LARGEST: f64 = 1e-3;

/// Drives that were sent: amplitude by the bits of the frequency, which is another one in every drive.
type Sent = Arc<Mutex<HashMap<u64, f64>>>;

/// A rig that refuses what was not sent.
struct Oracle(Sent);

impl Rig for Oracle {
    fn sense(&mut self) -> Result<Sensors, RigError> {
        Ok(Sensors { response: 0.0, reference: Some(0.0) })
    }

    fn advance(&mut self, drive: Drive, _: f64) -> Result<(), RigError> {
        let sent = self.0.lock().unwrap().get(&drive.omega.to_bits()).copied();
        let is_sent = sent.is_some_and(|amplitude| drive.amplitude <= amplitude);
        assert!(drive == Drive::default() || is_sent, "{drive:?} was not sent");
        Ok(())
    }
}

struct Target {
    server: Running,
    sent: Sent,
}

impl Target {
    fn start(address: fn(SocketAddr) -> Address, key: Option<Key>) -> Self {
        let role = Role::Rig { max_amplitude: LARGEST, sensors: Definition::default() };
        let service = Service { role, sample_time: SAMPLE_TIME, silence: 2.0 };
        let sent = Sent::default();
        let known = Arc::clone(&sent);
        let make = move || Served::Rig(Box::new(Oracle(Arc::clone(&known))));
        Self { server: Running::start(address, service, key, make), sent }
    }

    /// Ends the server; a panic of it fails the test.
    fn end(mut self, what: &str) {
        self.server.end();
        let counters = self.server.sessions.try_iter().filter_map(|session| session.counters);
        let refused: u64 = counters.map(|all| all.malformed + all.foreign + all.late).sum();
        let sent = self.sent.lock().unwrap().len();
        println!("{what} beside {sent} drives, {refused} counted by the server");
        assert!(sent > 0);
    }
}

/// A drive that no mutation of another one gives.
fn unique_drive(sent: &Sent, noise: &mut Noise) -> Drive {
    let unit = (noise.next() >> 11) as f64 / (1u64 << 53) as f64;
    let drive = Drive { omega: 100.0 + unit, amplitude: 1e-4, ..Drive::default() };
    sent.lock().unwrap().insert(drive.omega.to_bits(), drive.amplitude);
    drive
}

/// A frame of a session as this protocol has it, with its first values.
fn frame(kind: Kind, session: u64, sequence: u64, values: [f64; 2]) -> Frame {
    let mut frame = Frame {
        sequence,
        time: sequence as f64 * SAMPLE_TIME,
        ..Frame::new(kind, session)
    };
    frame.values[..2].copy_from_slice(&values);
    frame
}

/// The client's end of a connection, and another sender of datagrams.
enum Wire {
    Udp([UdpSocket; 2]),
    Tcp(TcpStream),
}

impl Wire {
    fn connect(to: SocketAddr, is_tcp: bool) -> Self {
        if is_tcp {
            let stream = TcpStream::connect(to).expect("the server has not ended");
            stream.set_read_timeout(Some(Duration::from_secs(60))).unwrap();
            return Self::Tcp(stream);
        }
        Self::Udp([(); 2].map(|()| {
            let socket = socket();
            socket.connect(to).unwrap();
            socket
        }))
    }

    /// Sends bytes; a datagram also as another sender. Returns whether the connection is open.
    fn send(&mut self, bytes: &[u8], as_stranger: bool) -> bool {
        match self {
            Self::Udp(sockets) => sockets[usize::from(as_stranger)].send(bytes).is_ok(),
            Self::Tcp(stream) => stream.write_all(bytes).is_ok(),
        }
    }

    /// The next frame of a session; None if there is none any more.
    fn receive(&mut self, session: u64) -> Option<Frame> {
        let mut bytes = [0; SIZE];
        loop {
            match self {
                Self::Udp(sockets) => drop(sockets[0].recv(&mut bytes).ok()?),
                Self::Tcp(stream) => stream.read_exact(&mut bytes).ok()?,
            }
            if let Some(frame) = Frame::decode(&bytes).ok().filter(|frame| frame.session == session) {
                return Some(frame);
            }
        }
    }
}

/// Sends mutated copies of every drive before it.
fn mutated_frames_never_drive_a_rig(address: fn(SocketAddr) -> Address, is_tcp: bool) {
    let ((frames, seed), target) = (size(), Target::start(address, None));
    let (mut noise, mut done, mut sessions) = (Noise::new(seed ^ u64::from(is_tcp)), 0, 0);
    while done < frames {
        let mut wire = Wire::connect(target.server.address.socket(), is_tcp);
        let session = noise.next();
        sessions += 1;
        wire.send(&frame(Kind::Hello, session, 0, [SAMPLE_TIME, 0.0]).encode(), false);
        // A frame that is cut, or refused, ends the session.
        while done < frames
            && let Some(answer) = wire.receive(session)
        {
            match answer.kind {
                Kind::Welcome => continue,
                Kind::Sensors if !answer.has(flag::SHUT_DOWN) => {}
                _ => break,
            }
            let drive = unique_drive(&target.sent, &mut noise);
            let genuine = frame(Kind::Drive, session, answer.sequence, [drive.omega, drive.amplitude]).encode();
            for _ in 0..64 {
                let mut bytes = genuine.to_vec();
                noise.mutate(&mut bytes);
                // Over TCP, a frame of another version ends the session, and one of another length all frames after it.
                if is_tcp && noise.below(4000) != 0 {
                    bytes[..6].copy_from_slice(&genuine[..6]);
                } else if noise.below(8) == 0 {
                    bytes.resize(noise.below(2 * SIZE), 0);
                }
                done += 1;
                wire.send(&bytes, noise.below(4) == 0);
            }
            if !wire.send(&genuine, false) {
                break;
            }
        }
        // The server gives up a session that has no end.
        wire.send(&frame(Kind::Farewell, session, 0, [0.0; 2]).encode(), false);
    }
    target.end(&format!("{done} frames in {sessions} sessions"));
}

#[test]
fn mutated_datagrams_never_drive_a_rig_in_real_time() {
    mutated_frames_never_drive_a_rig(Address::Udp, false);
}

#[test]
fn mutated_frames_never_drive_a_rig_in_lock_step() {
    mutated_frames_never_drive_a_rig(Address::Tcp, true);
}

/// Frames that the attacker remembers.
const HEARD: usize = 4096;

/// A drive as it was, one with another content and a correct checksum, or a mutated frame.
fn forge(mut forged: Vec<u8>, noise: &mut Noise) -> Option<Vec<u8>> {
    match (noise.below(3), Frame::decode(&forged[..SIZE])) {
        // A genuine farewell would end the session.
        (0, Ok(frame)) if frame.kind == Kind::Drive => {}
        (1, Ok(mut frame)) if frame.kind == Kind::Drive => {
            frame.sequence = frame.sequence.wrapping_add(noise.below(5) as u64);
            frame.values[noise.below(3)] = 1e-4 * noise.below(100) as f64;
            forged[..SIZE].copy_from_slice(&frame.encode());
        }
        _ => {
            let genuine = forged.clone();
            noise.mutate(&mut forged);
            // A repeated Hello drives nothing, but keeps the server busy.
            return (forged != genuine).then_some(forged);
        }
    }
    Some(forged)
}

/// With a key, not even a frame with a correct checksum, session and number is taken, nor one of another session: between a client and the
/// server, an attacker passes all frames, and sends forged or repeated ones from the client's address.
#[test]
fn with_a_key_forged_and_replayed_datagrams_never_drive_a_rig() {
    let ((frames, seed), key) = (size(), Key::of(b"a shared secret of the fuzzer"));
    let (target, [mut noise, mut own]) = (
        Target::start(Address::Udp, key),
        [3, 6].map(|salt| Noise::new(seed ^ salt)),
    );
    let [front, back] = [(); 2].map(|()| {
        let socket = socket();
        socket.set_nonblocking(true).unwrap();
        socket
    });
    back.connect(target.server.address.socket()).unwrap();
    let (address, finished) = (Address::Udp(front.local_addr().unwrap()), AtomicBool::new(false));
    let (mut peer, mut heard, mut bytes, mut done) = (None, Vec::new(), [0; 256], 0);
    thread::scope(|scope| {
        let client = scope.spawn(|| {
            for attempt in 0..3 + frames / 100_000 {
                if attempt > 1 && finished.load(Ordering::Relaxed) {
                    break;
                }
                let Ok(mut rig) = NetRig::connect(address, SAMPLE_TIME, key) else {
                    continue;
                };
                let _ = (0..(frames / 40).clamp(100, 5000)).try_for_each(|_| {
                    rig.sense()?;
                    rig.advance(unique_drive(&target.sent, &mut noise), SAMPLE_TIME)
                });
            }
        });
        while !client.is_finished() {
            while let Ok((length, from)) = front.recv_from(&mut bytes) {
                peer = Some(from);
                let _ = back.send(&bytes[..length]);
                if heard.len() == HEARD {
                    heard.swap_remove(own.below(HEARD));
                }
                heard.push(bytes[..length].to_vec());
            }
            while let (Ok(length), Some(peer)) = (back.recv(&mut bytes), peer) {
                let _ = front.send_to(&bytes[..length], peer);
            }
            if done < frames {
                let forged = (0..16).filter_map(|_| forge(heard.get(own.below(heard.len()))?.clone(), &mut own));
                done += forged.inspect(|forged| drop(back.send(forged))).count() as u64;
            } else {
                finished.store(true, Ordering::Relaxed);
                thread::sleep(Duration::from_micros(50));
            }
        }
    });
    target.end(&format!("{done} frames with a key"));
}
