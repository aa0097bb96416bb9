//! Random and mutated frames on every connection: no panic, and no drive reaches a rig that was not sent.
//!
//! `scripts/stress --network` runs this with 10^7 frames per connection; FRAMES and SEED set both. The suite takes a small part.

mod noise;

use std::collections::HashMap;
use std::env;
use std::io::{Read, Write};
use std::net::{SocketAddr, TcpStream, UdpSocket};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use vines_net::frame::{Frame, Kind, SIZE};
use vines_net::{Address, Key, NetRig, Role, Served, Server, Service};
use vines_testbench::rig::{Drive, Rig, RigError, Sensors};
use vines_testbench::scene::Definition;

use noise::Noise;

/// Number of frames per connection, and the seed.
fn size() -> (u64, u64) {
    let number = |name, default| env::var(name).map_or(default, |text| text.parse().unwrap());
    (number("FRAMES", 20_000), number("SEED", 1))
}

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
    address: Address,
    stop: Arc<AtomicBool>,
    thread: JoinHandle<u64>,
    sent: Sent,
}

impl Target {
    fn start(address: fn(SocketAddr) -> Address, key: Option<Key>) -> Self {
        let sensors = Definition::default();
        let role = Role::Rig { max_amplitude: LARGEST, sensors };
        let service = Service { role, sample_time: SAMPLE_TIME, silence: 2.0 };
        let address = address(([127, 0, 0, 1], 0).into());
        let mut server = Server::listen(address, service, key).unwrap();
        let address = server.address().unwrap();
        let (stop, sent) = (Arc::new(AtomicBool::new(false)), Sent::default());
        let (flag, known) = (Arc::clone(&stop), Arc::clone(&sent));
        let thread = thread::spawn(move || {
            let mut refused = 0;
            let make = || Ok(Served::Rig(Box::new(Oracle(Arc::clone(&known)))));
            let stop = || flag.load(Ordering::Relaxed);
            let tell = |session: &vines_net::Session| {
                refused += session.counters.map_or(0, |all| all.malformed + all.foreign + all.late);
            };
            server.serve(make, stop, tell).unwrap();
            refused
        });
        Self { address, stop, thread, sent }
    }

    /// A drive that no mutation of another one gives.
    fn drive(&self, noise: &mut Noise) -> Drive {
        let unit = (noise.next() >> 11) as f64 / (1u64 << 53) as f64;
        let drive = Drive { omega: 100.0 + unit, amplitude: 1e-4, displacement: 0.0 };
        self.sent.lock().unwrap().insert(drive.omega.to_bits(), drive.amplitude);
        drive
    }

    /// Ends the server; a panic of it fails the test.
    fn end(self) -> u64 {
        self.stop.store(true, Ordering::Relaxed);
        self.thread.join().unwrap()
    }
}

/// Drive `number` of a session as this protocol has it.
fn frame(session: u64, number: u64, drive: Drive) -> Frame {
    let mut frame = Frame::new(Kind::Drive, session);
    (frame.sequence, frame.time) = (number, number as f64 * SAMPLE_TIME);
    frame.values[..2].copy_from_slice(&[drive.omega, drive.amplitude]);
    frame
}

fn hello(session: u64) -> Frame {
    let mut hello = Frame::new(Kind::Hello, session);
    hello.values[0] = SAMPLE_TIME;
    hello
}

/// A mutated frame, or one of any length.
fn noise_like(noise: &mut Noise, like: &Frame, same_length: bool) -> Vec<u8> {
    let mut bytes = like.encode().to_vec();
    noise.mutate(&mut bytes);
    // Over TCP, a frame of another version ends the session; most are to be read in one.
    if same_length && noise.below(4000) != 0 {
        bytes[..6].copy_from_slice(&like.encode()[..6]);
    }
    if !same_length && noise.below(8) == 0 {
        let length = noise.below(2 * SIZE);
        bytes.resize(length, 0);
    }
    bytes
}

#[test]
fn mutated_datagrams_never_drive_a_rig_in_real_time() {
    let ((frames, seed), target) = (size(), Target::start(Address::Udp, None));
    let (mut noise, Address::Udp(peer)) = (Noise(seed), target.address) else {
        panic!()
    };
    let [client, stranger] = [(); 2].map(|()| UdpSocket::bind("127.0.0.1:0").unwrap());
    client.set_nonblocking(true).unwrap();
    let (mut session, mut number, mut last) = (noise.next(), 0, None);
    client.send_to(&hello(session).encode(), peer).unwrap();
    let mut done = 0;
    while done < frames {
        let like = last.unwrap_or(hello(session));
        for _ in 0..32 {
            let bytes = noise_like(&mut noise, &like, false);
            let from = if noise.below(4) == 0 { &stranger } else { &client };
            let _ = from.send_to(&bytes, peer);
            done += 1;
        }
        let mut bytes = [0; 256];
        while let Ok(length) = client.recv(&mut bytes) {
            match Frame::decode(&bytes[..length]) {
                Ok(frame) if frame.session == session && frame.kind == Kind::Sensors && !frame.has(16) => {
                    number = frame.sequence;
                    last = Some(self::frame(session, number, target.drive(&mut noise)));
                    client.send_to(&last.unwrap().encode(), peer).unwrap();
                }
                Ok(frame) if frame.session == session && frame.has(16) => {
                    (session, last) = (noise.next(), None);
                    client.send_to(&hello(session).encode(), peer).unwrap();
                }
                _ => {}
            }
        }
    }
    let sent = target.sent.lock().unwrap().len();
    println!(
        "UDP: {done} frames sent, {} counted by the server beside {sent} drives, sample {number}",
        target.end()
    );
    assert!(sent > 0);
}

#[test]
fn mutated_frames_never_drive_a_rig_in_lock_step() {
    let ((frames, seed), target) = (size(), Target::start(Address::Tcp, None));
    let (mut noise, Address::Tcp(peer)) = (Noise(seed ^ 2), target.address) else {
        panic!()
    };
    let (mut done, mut sessions) = (0, 0u64);
    while done < frames {
        let Ok(mut stream) = TcpStream::connect(peer) else {
            panic!("the server has ended")
        };
        stream.set_read_timeout(Some(Duration::from_secs(5))).unwrap();
        let session = noise.next();
        sessions += 1;
        let mut answer = [0; SIZE];
        let mut number = 0;
        let mut send = hello(session);
        // A frame that is cut, or refused, ends the session.
        while done < frames && stream.write_all(&send.encode()).is_ok() {
            let answers = if number == 0 { 2 } else { 1 };
            if (0..answers).any(|_| stream.read_exact(&mut answer).is_err()) {
                break;
            }
            let good = Frame::decode(&answer).is_ok_and(|frame| matches!(frame.kind, Kind::Welcome | Kind::Sensors));
            if !good {
                break;
            }
            send = frame(session, number, target.drive(&mut noise));
            number += 1;
            let many: Vec<u8> = (0..64).flat_map(|_| noise_like(&mut noise, &send, true)).collect();
            done += 64;
            let cut = if noise.below(4000) == 0 { noise.below(SIZE) } else { 0 };
            if stream.write_all(&many[cut..]).is_err() || cut > 0 {
                break;
            }
        }
    }
    let sent = target.sent.lock().unwrap().len();
    println!("TCP: {done} frames in {sessions} sessions beside {sent} drives");
    target.end();
    assert!(sent > 0);
}

/// Frames that the relay remembers.
const HEARD: usize = 4096;

/// Passes all frames between a client and a server, and sends from the client's address.
struct Relay {
    front: UdpSocket,
    back: UdpSocket,
    client: Option<SocketAddr>,
    heard: Vec<Vec<u8>>,
    noise: Noise,
}

impl Relay {
    fn new(server: SocketAddr, seed: u64) -> Self {
        let [front, back] = [(); 2].map(|()| UdpSocket::bind("127.0.0.1:0").unwrap());
        back.connect(server).unwrap();
        front.set_nonblocking(true).unwrap();
        back.set_nonblocking(true).unwrap();
        let (client, heard, noise) = (None, Vec::new(), Noise(seed));
        Self { front, back, client, heard, noise }
    }

    /// Passes what has arrived; whether there was anything.
    fn pass(&mut self) -> bool {
        let (mut bytes, mut any) = ([0; 256], false);
        while let Ok((length, from)) = self.front.recv_from(&mut bytes) {
            (self.client, any) = (Some(from), true);
            let _ = self.back.send(&bytes[..length]);
            if self.heard.len() == HEARD {
                self.heard.swap_remove(self.noise.below(HEARD));
            }
            self.heard.push(bytes[..length].to_vec());
        }
        while let (Ok(length), Some(client)) = (self.back.recv(&mut bytes), self.client) {
            any = true;
            let _ = self.front.send_to(&bytes[..length], client);
        }
        any
    }

    /// Sends a forged or repeated frame; whether it did.
    fn forge(&mut self) -> bool {
        let noise = &mut self.noise;
        let Some(mut forged) = self.heard.get(noise.below(self.heard.len())).cloned() else {
            return false;
        };
        match (noise.below(3), Frame::decode(&forged[..SIZE])) {
            // As it was; a genuine farewell would end the session.
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
                if forged == genuine {
                    return false;
                }
            }
        }
        let _ = self.back.send(&forged);
        true
    }

    /// Forges `frames` frames, sets `finished`, and serves the genuine client until it is `over`.
    fn run(mut self, frames: u64, finished: &AtomicBool, over: &AtomicBool) -> u64 {
        let mut done = 0;
        while !over.load(Ordering::Relaxed) {
            if done < frames {
                self.pass();
                done += (0..16).filter(|_| self.forge()).count() as u64;
            } else if !self.pass() {
                finished.store(true, Ordering::Relaxed);
                thread::sleep(Duration::from_micros(50));
            }
        }
        done
    }
}

/// With a key, not even a frame with a correct checksum, session and number is taken, nor one of another session.
#[test]
fn with_a_key_forged_and_replayed_datagrams_never_drive_a_rig() {
    let ((frames, seed), key) = (size(), Key::of(b"a shared secret of the fuzzer"));
    let target = Target::start(Address::Udp, key);
    let (mut noise, Address::Udp(server)) = (Noise(seed ^ 3), target.address) else {
        panic!()
    };
    let relay = Relay::new(server, noise.next());
    let address = Address::Udp(relay.front.local_addr().unwrap());
    let [over, finished] = [(); 2].map(|()| Arc::new(AtomicBool::new(false)));
    let flags = [Arc::clone(&finished), Arc::clone(&over)];
    let attacker = thread::spawn(move || relay.run(frames, &flags[0], &flags[1]));
    let mut sessions = 0;
    for attempt in 0..3 + frames / 100_000 {
        if attempt > 1 && finished.load(Ordering::Relaxed) {
            break;
        }
        let Ok(mut rig) = NetRig::connect(address, SAMPLE_TIME, key) else {
            continue;
        };
        sessions += 1;
        for _ in 0..(frames / 40).clamp(100, 5000) {
            let drive = target.drive(&mut noise);
            if rig.sense().and_then(|_| rig.advance(drive, SAMPLE_TIME)).is_err() {
                break;
            }
        }
    }
    over.store(true, Ordering::Relaxed);
    let done = attacker.join().unwrap();
    let sent = target.sent.lock().unwrap().len();
    println!("UDP with a key: {done} frames beside {sent} drives in {sessions} sessions");
    let refused = target.end();
    println!("  {refused} of them counted by the server");
    assert!(sent > 0);
}
