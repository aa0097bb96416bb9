//! The watchdog of a host that drives a device: a thread that stops the drive when the host takes no readings any more, whether it waits
//! for an answer, for a disk or for a terminal.

use std::io::{self, Write};
use std::net::{Shutdown, TcpStream};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, mpsc};
use std::thread;
use std::time::{Duration, Instant};

/// What host and thread share.
#[derive(Debug)]
struct Shared {
    start: Instant,
    /// Time of the last reading, µs after the start.
    last: AtomicU64,
    fired: AtomicBool,
}

impl Shared {
    /// Time of the last reading.
    fn last(&self) -> Instant {
        self.start + Duration::from_micros(self.last.load(Ordering::Relaxed))
    }
}

/// A watchdog; it ends when it is dropped.
#[derive(Debug)]
pub struct Watchdog {
    shared: Arc<Shared>,
    /// The thread ends when this is dropped.
    _alive: mpsc::Sender<()>,
}

impl Watchdog {
    /// After a silence longer than `silence`, sends `stop` on `control` and closes it.
    pub fn start(mut control: TcpStream, stop: Vec<u8>, silence: Duration) -> io::Result<Self> {
        let shared = Arc::new(Shared {
            start: Instant::now(),
            last: AtomicU64::new(0),
            fired: AtomicBool::new(false),
        });
        let (alive, dropped) = mpsc::channel();
        let own = Arc::clone(&shared);
        thread::Builder::new().spawn(move || {
            let mut left = silence;
            while dropped.recv_timeout(left) == Err(mpsc::RecvTimeoutError::Timeout) {
                left = (own.last() + silence).saturating_duration_since(Instant::now());
                if left.is_zero() {
                    own.fired.store(true, Ordering::Relaxed);
                    // What cannot be sent does not arrive; the end of the connection may.
                    stop_and_close(&mut control, &stop);
                    return;
                }
            }
        })?;
        Ok(Self { shared, _alive: alive })
    }

    /// The host has taken a reading. After the drive was stopped, this is too late, and does not count.
    pub fn beat(&self) {
        if self.has_fired() {
            return;
        }
        let now = self.shared.start.elapsed().as_micros() as u64;
        self.shared.last.store(now, Ordering::Relaxed);
    }

    /// Time of the last reading.
    pub fn last(&self) -> Instant {
        self.shared.last()
    }

    /// Whether the drive was stopped.
    pub fn has_fired(&self) -> bool {
        self.shared.fired.load(Ordering::Relaxed)
    }
}

/// Sends the requests `stop` without waiting for their answers, and closes the control channel.
pub fn stop_and_close(control: &mut TcpStream, stop: &[u8]) {
    // What cannot be sent does not arrive; the end of the connection may.
    let _ = control.write_all(stop);
    let _ = control.shutdown(Shutdown::Both);
}
