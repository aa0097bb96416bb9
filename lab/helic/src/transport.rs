//! The connection to a device: requests and answers over TCP, packets over UDP, and a thread that stops the drive when the host hangs.

use std::io::{self, ErrorKind, Read, Write};
use std::net::{Shutdown, SocketAddr, TcpStream, UdpSocket};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};
use std::thread;
use std::time::{Duration, Instant};

use super::codec::Frame;
use vines_net::is_loopback;

/// Longest time for an answer while the device is set up and nothing is driven: the time after which a client of the other protocol gives up.
const PATIENCE: Duration = Duration::from_secs(2);
/// Longest silence of a driven device, and of a host that drives it. The drive stops within 0.2 s, with 50 ms for the network.
pub const LONGEST_SILENCE: Duration = Duration::from_millis(150);

/// The connection to a device.
pub trait Transport {
    /// Sends a request and returns the answer.
    fn request(&mut self, request: &Frame) -> io::Result<Frame>;

    /// The next datagram of the stream.
    fn datagram(&mut self) -> io::Result<Vec<u8>>;

    /// Port on which the datagrams arrive.
    fn port(&self) -> io::Result<u16>;

    /// Longest silence of either side while the device is driven.
    fn silence(&self) -> Duration {
        LONGEST_SILENCE
    }

    /// From now on the device is driven: when the host takes no datagram for too long, the transport sends the requests `stop`, which stop
    /// the drive, and closes the control channel. Without requests, it is not driven any more. A transport without a clock does nothing.
    fn guard(&mut self, _stop: &[Frame]) -> io::Result<()> {
        Ok(())
    }

    /// Sends the requests that stop the drive, if there is one, and closes the control channel.
    fn close(&mut self) {}
}

/// A device on the network.
#[derive(Debug)]
pub struct Network {
    control: TcpStream,
    stream: UdpSocket,
    bytes: Vec<u8>,
    silence: Duration,
    watchdog: Arc<Mutex<Watchdog>>,
}

/// What the thread that watches over the host knows.
#[derive(Debug)]
struct Watchdog {
    /// The requests that stop the drive; empty while there is none.
    stop: Vec<u8>,
    last_reading: Instant,
    fired: Option<Instant>,
}

impl Network {
    /// Connects to the control channel at `peer`, and sends the device's stream port the datagram that opens firewalls. The drive stops after
    /// a silence of either side that is longer than `silence`; [`LONGEST_SILENCE`] fits a device that sends a packet every 5 ms.
    pub fn connect(peer: SocketAddr, silence: Duration) -> io::Result<Self> {
        let control = TcpStream::connect_timeout(&peer, PATIENCE)?;
        control.set_nodelay(true)?;
        let stream = UdpSocket::bind((control.local_addr()?.ip(), 0))?;
        stream.set_read_timeout(Some(silence))?;
        if !is_loopback(peer.ip()) {
            stream.send_to(b"vines", (peer.ip(), peer.port().saturating_add(1)))?;
        }
        let (stop, last_reading) = (Vec::new(), Instant::now());
        let watchdog = Arc::new(Mutex::new(Watchdog { stop, last_reading, fired: None }));
        let (shared, channel) = (Arc::downgrade(&watchdog), control.try_clone()?);
        thread::Builder::new().spawn(move || watch(&shared, channel, silence))?;
        let network = Self { control, stream, bytes: Vec::new(), silence, watchdog };
        network.patience(PATIENCE)?;
        Ok(network)
    }

    /// Sets the longest time for an answer.
    fn patience(&self, patience: Duration) -> io::Result<()> {
        self.control.set_read_timeout(Some(patience))?;
        self.control.set_write_timeout(Some(patience))
    }

    /// `error` in words, after waiting since `began`.
    fn explained(&self, error: io::Error, waited: &str, began: Instant) -> io::Error {
        let (fired, kind) = (lock(&self.watchdog).fired, error.kind());
        let silence = self.silence.as_secs_f64();
        io::Error::other(if fired.is_some_and(|fired| fired < began) {
            format!(
                "this program took no reading for {silence} s, so the drive was stopped and the connection closed; is the machine too busy?"
            )
        } else if fired.is_some() || matches!(kind, ErrorKind::WouldBlock | ErrorKind::TimedOut) {
            format!("{waited} for {:.2} s", began.elapsed().as_secs_f64())
        } else if matches!(
            kind,
            ErrorKind::ConnectionAborted | ErrorKind::BrokenPipe | ErrorKind::ConnectionReset
        ) {
            "the connection is closed".into()
        } else {
            return error;
        })
    }

    fn answer(&mut self, request: &Frame) -> io::Result<Frame> {
        self.control.write_all(&request.encode())?;
        let mut more = [0; 2048];
        loop {
            let answer = Frame::take(&mut self.bytes);
            if let Some(answer) = answer.map_err(|error| io::Error::new(ErrorKind::InvalidData, error))? {
                return Ok(answer);
            }
            match uninterrupted(|| self.control.read(&mut more))? {
                0 => return Err(ErrorKind::ConnectionAborted.into()),
                size => self.bytes.extend(&more[..size]),
            }
        }
    }
}

impl Transport for Network {
    fn request(&mut self, request: &Frame) -> io::Result<Frame> {
        let began = Instant::now();
        let answer = self.answer(request);
        answer.map_err(|error| self.explained(error, "no answer", began))
    }

    fn datagram(&mut self) -> io::Result<Vec<u8>> {
        let (began, mut bytes) = (Instant::now(), vec![0; 2048]);
        let size = uninterrupted(|| self.stream.recv(&mut bytes))
            .map_err(|error| self.explained(error, "no packet of its stream has arrived", began))?;
        bytes.truncate(size);
        lock(&self.watchdog).last_reading = Instant::now();
        Ok(bytes)
    }

    fn port(&self) -> io::Result<u16> {
        Ok(self.stream.local_addr()?.port())
    }

    fn silence(&self) -> Duration {
        self.silence
    }

    fn guard(&mut self, stop: &[Frame]) -> io::Result<()> {
        self.patience(if stop.is_empty() { PATIENCE } else { self.silence })?;
        let mut watchdog = lock(&self.watchdog);
        watchdog.stop = stop.iter().flat_map(Frame::encode).collect();
        watchdog.last_reading = Instant::now();
        Ok(())
    }

    fn close(&mut self) {
        stop_and_close(&mut self.control, &lock(&self.watchdog).stop);
    }
}

/// Repeats a call that a signal has interrupted: whoever catches signals decides what they mean.
fn uninterrupted<T>(mut call: impl FnMut() -> io::Result<T>) -> io::Result<T> {
    loop {
        match call() {
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            outcome => return outcome,
        }
    }
}

/// Sends the requests `stop` without waiting for their answers, and closes the control channel.
fn stop_and_close(control: &mut TcpStream, stop: &[u8]) {
    // What cannot be sent does not arrive; the end of the connection may.
    let _ = control.write_all(stop);
    let _ = control.shutdown(Shutdown::Both);
}

fn lock(watchdog: &Mutex<Watchdog>) -> MutexGuard<'_, Watchdog> {
    watchdog.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Stops the drive when the host takes no reading for longer than `silence`, whether it waits for an answer, for a disk or for a terminal.
/// Ends with the connection.
fn watch(shared: &Weak<Mutex<Watchdog>>, mut control: TcpStream, silence: Duration) {
    let mut left = silence;
    loop {
        thread::sleep(left);
        let Some(watchdog) = shared.upgrade() else {
            return;
        };
        let mut watchdog = lock(&watchdog);
        left = (watchdog.last_reading + silence).saturating_duration_since(Instant::now());
        if watchdog.stop.is_empty() {
            left = silence;
        } else if left.is_zero() {
            watchdog.fired = Some(Instant::now());
            return stop_and_close(&mut control, &watchdog.stop);
        }
    }
}
