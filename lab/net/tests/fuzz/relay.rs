//! The real-time rig with a key, behind a relay that forges and repeats what it has heard.

use std::net::{SocketAddr, UdpSocket};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use vines_net::frame::{Frame, Kind, SIZE};
use vines_net::{Address, Key, NetRig};
use vines_testbench::rig::Rig;

use super::noise::Noise;
use super::size;
use super::vines::{SAMPLE_TIME, Target};

/// Frames that the relay remembers.
const HEARD: usize = 4096;

/// Passes all frames between a client and a server, and sends from the client's address.
struct Relay {
    front: UdpSocket,
    back: UdpSocket,
    server: SocketAddr,
    client: Option<SocketAddr>,
    heard: Vec<Vec<u8>>,
    noise: Noise,
}

impl Relay {
    fn new(server: SocketAddr, seed: u64) -> Self {
        let [front, back] = [(); 2].map(|()| UdpSocket::bind("127.0.0.1:0").unwrap());
        front.set_nonblocking(true).unwrap();
        back.set_nonblocking(true).unwrap();
        Self {
            front,
            back,
            server,
            client: None,
            heard: Vec::new(),
            noise: Noise(seed),
        }
    }

    /// Passes what has arrived; whether there was anything.
    fn pass(&mut self) -> bool {
        let (mut bytes, mut any) = ([0; 256], false);
        while let Ok((length, from)) = self.front.recv_from(&mut bytes) {
            (self.client, any) = (Some(from), true);
            let _ = self.back.send_to(&bytes[..length], self.server);
            let frame = bytes[..length].to_vec();
            if self.heard.len() < HEARD {
                self.heard.push(frame);
            } else {
                self.heard[self.noise.below(HEARD)] = frame;
            }
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
        let _ = self.back.send_to(&forged, self.server);
        true
    }

    /// Forges `frames` frames, sets `finished`, and serves the genuine client until it is `over`.
    fn run(mut self, frames: u64, finished: &AtomicBool, over: &AtomicBool) -> u64 {
        let mut done = 0;
        while done < frames && !over.load(Ordering::Relaxed) {
            self.pass();
            done += (0..16).filter(|_| self.forge()).count() as u64;
        }
        finished.store(true, Ordering::Relaxed);
        while !over.load(Ordering::Relaxed) {
            if !self.pass() {
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
