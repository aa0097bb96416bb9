//! A proxy that loses, repeats, reorders and changes datagrams in a fixed pattern.

use std::io::ErrorKind;
use std::net::{SocketAddr, UdpSocket};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use vines_net::Address;
use vines_net::frame::{Frame, Kind};

/// Treatment of a datagram.
#[derive(Clone, Copy)]
pub enum Fate {
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

/// Limits of a proxy: time, ...
const LONGEST: Duration = Duration::from_secs(60);
/// ... and datagrams.
const MOST: u64 = 200_000;

/// A running proxy; it stops when it is dropped.
pub struct Proxy {
    /// Address for clients.
    pub address: Address,
    stop: Arc<AtomicBool>,
}

impl Proxy {
    /// Forwards to `server`. `fate` determines the treatment of the n-th frame in a direction; handshake and farewell pass.
    pub fn before(server: SocketAddr, fate: impl FnMut(Kind, u64) -> Fate + Send + 'static) -> Self {
        let [front, back, stranger] = [(); 3].map(|()| {
            let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
            socket.set_read_timeout(Some(Duration::from_millis(2))).unwrap();
            socket
        });
        let address = front.local_addr().unwrap();
        let stop = Arc::new(AtomicBool::new(false));
        let mut worker = Worker { fate, stranger, seen: [0; 2], kept: [None, None] };
        let stopped = Arc::clone(&stop);
        front.set_nonblocking(true).unwrap();
        back.set_nonblocking(true).unwrap();
        std::thread::spawn(move || {
            let end = Instant::now() + LONGEST;
            let (mut client, mut bytes, mut count) = (None, [0; 256], 0);
            while !stopped.load(Ordering::Relaxed) && Instant::now() < end && count < MOST {
                let mut idle = true;
                if let Some((size, from)) = receive(&front, &mut bytes) {
                    client = Some(from);
                    worker.carry(0, &mut bytes[..size], &back, server);
                    (idle, count) = (false, count + 1);
                }
                if let Some((size, _)) = receive(&back, &mut bytes)
                    && let Some(client) = client
                {
                    worker.carry(1, &mut bytes[..size], &front, client);
                    (idle, count) = (false, count + 1);
                }
                if idle {
                    std::thread::sleep(Duration::from_micros(20));
                }
            }
        });
        Self { address: Address::Udp(address), stop }
    }
}

impl Drop for Proxy {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
    }
}

fn receive(socket: &UdpSocket, bytes: &mut [u8]) -> Option<(usize, SocketAddr)> {
    match socket.recv_from(bytes) {
        Ok(received) => Some(received),
        Err(error) if error.kind() == ErrorKind::ConnectionRefused => None,
        Err(error) => {
            assert_eq!(error.kind(), ErrorKind::WouldBlock, "{error}");
            None
        }
    }
}

struct Worker<F> {
    fate: F,
    stranger: UdpSocket,
    seen: [u64; 2],
    kept: [Option<Vec<u8>>; 2],
}

impl<F: FnMut(Kind, u64) -> Fate> Worker<F> {
    fn carry(&mut self, direction: usize, bytes: &mut [u8], via: &UdpSocket, to: SocketAddr) {
        let send = |bytes: &[u8]| {
            via.send_to(bytes, to).unwrap();
        };
        let frame = Frame::decode(bytes).unwrap();
        if !matches!(frame.kind, Kind::Sensors | Kind::Drive | Kind::Report) {
            return send(bytes);
        }
        let fate = (self.fate)(frame.kind, self.seen[direction]);
        self.seen[direction] += 1;
        match fate {
            Fate::Pass => send(bytes),
            Fate::Lose => {}
            Fate::Repeat => {
                send(bytes);
                send(bytes);
            }
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
                let mut changed = frame;
                change(&mut changed);
                send(&changed.encode());
            }
        }
        if let Some(kept) = self.kept[direction].take() {
            send(&kept);
        }
    }
}
