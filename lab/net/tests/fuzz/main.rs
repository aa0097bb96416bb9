//! Guards every connection against random and mutated frames: no panic, and no drive reaches a rig that was not sent.
//!
//! `scripts/stress --network` runs this with 10^7 frames per connection; FRAMES and SEED set both. The suite takes a small part.

mod noise;

use std::collections::HashMap;
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
    let (mut noise, peer) = (Noise(seed), target.address.socket());
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
    let (mut noise, peer) = (Noise(seed ^ 2), target.address.socket());
    let (mut done, mut sessions) = (0, 0u64);
    while done < frames {
        let mut stream = TcpStream::connect(peer).expect("the server has not ended");
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

/// Passes all frames between a client and a server until it is `over`, and sends `frames` forged or repeated ones from the client's address;
/// then sets `finished`. Returns the number of forged frames.
fn attack(
    [front, back]: [UdpSocket; 2],
    mut noise: Noise,
    frames: u64,
    finished: &AtomicBool,
    over: &AtomicBool,
) -> u64 {
    let (mut client, mut heard, mut bytes, mut done) = (None, Vec::new(), [0; 256], 0);
    while !over.load(Ordering::Relaxed) {
        let mut is_idle = true;
        while let Ok((length, from)) = front.recv_from(&mut bytes) {
            (client, is_idle) = (Some(from), false);
            let _ = back.send(&bytes[..length]);
            if heard.len() == HEARD {
                heard.swap_remove(noise.below(HEARD));
            }
            heard.push(bytes[..length].to_vec());
        }
        while let (Ok(length), Some(client)) = (back.recv(&mut bytes), client) {
            is_idle = false;
            let _ = front.send_to(&bytes[..length], client);
        }
        if done < frames {
            let forged = (0..16).filter_map(|_| forge(heard.get(noise.below(heard.len()))?.clone(), &mut noise));
            done += forged.inspect(|forged| drop(back.send(forged))).count() as u64;
        } else if is_idle {
            finished.store(true, Ordering::Relaxed);
            thread::sleep(Duration::from_micros(50));
        }
    }
    done
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

/// With a key, not even a frame with a correct checksum, session and number is taken, nor one of another session.
#[test]
fn with_a_key_forged_and_replayed_datagrams_never_drive_a_rig() {
    let ((frames, seed), key) = (size(), Key::of(b"a shared secret of the fuzzer"));
    let (target, mut noise) = (Target::start(Address::Udp, key), Noise(seed ^ 3));
    let sockets = [(); 2].map(|()| UdpSocket::bind("127.0.0.1:0").unwrap());
    sockets.iter().for_each(|socket| socket.set_nonblocking(true).unwrap());
    sockets[1].connect(target.address.socket()).unwrap();
    let address = Address::Udp(sockets[0].local_addr().unwrap());
    let (own, [over, finished]) = (Noise(noise.next()), [(); 2].map(|()| Arc::new(AtomicBool::new(false))));
    let flags = [Arc::clone(&finished), Arc::clone(&over)];
    let attacker = thread::spawn(move || attack(sockets, own, frames, &flags[0], &flags[1]));
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
    let refused = target.end();
    println!(
        "UDP with a key: {done} frames beside {sent} drives in {sessions} sessions, {refused} counted by the server"
    );
    assert!(sent > 0);
}
