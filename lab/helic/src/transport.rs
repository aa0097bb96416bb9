//! The way to a device: requests and answers over TCP, packets over UDP, and a thread that stops the drive when the host hangs.

use std::io::{self, ErrorKind, Read, Write};
use std::net::{Shutdown, SocketAddr, TcpStream, UdpSocket};
use std::sync::{Arc, Mutex, PoisonError, mpsc};
use std::thread;
use std::time::{Duration, Instant};

use super::codec::Frame;
use vines_net::is_loopback;

/// Longest time for an answer while the device is set up.
const PATIENCE: Duration = Duration::from_secs(2);
/// Longest silence of a driven device, and of a host that drives it. The drive stops within 0.2 s, with some time for the way.
pub const LONGEST_SILENCE: Duration = Duration::from_millis(150);

/// The way to a device.
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

    /// From now on the device is driven: when the host takes no datagram for too long, the transport sends these requests, which stop the drive, and closes
    /// the control channel. With None, it is not driven any more. A transport without a clock does nothing.
    fn guard(&mut self, _stop: Option<Vec<Frame>>) -> io::Result<()> {
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
    watchdog: Option<Watchdog>,
    /// The requests that stop the drive, while there is one.
    stop: Vec<u8>,
}

impl Network {
    /// Connects to the control channel at `peer`, and sends the device's stream port the datagram that opens firewalls. The drive stops after
    /// a silence of either side that is longer than `silence`; [`LONGEST_SILENCE`] fits a device that sends a packet every 5 ms.
    pub fn connect(peer: SocketAddr, silence: Duration) -> io::Result<Self> {
        let control = TcpStream::connect_timeout(&peer, PATIENCE)?;
        control.set_nodelay(true)?;
        let mut own = control.local_addr()?;
        own.set_port(0);
        let stream = UdpSocket::bind(own)?;
        stream.set_read_timeout(Some(silence))?;
        if !is_loopback(peer.ip()) {
            stream.send_to(b"vines", (peer.ip(), peer.port().saturating_add(1)))?;
        }
        let (bytes, watchdog, stop) = (Vec::new(), None, Vec::new());
        let network = Self { control, stream, bytes, silence, watchdog, stop };
        network.patience(PATIENCE)?;
        Ok(network)
    }

    /// Sets the longest time for an answer.
    fn patience(&self, patience: Duration) -> io::Result<()> {
        self.control.set_read_timeout(Some(patience))?;
        self.control.set_write_timeout(Some(patience))
    }

    /// `error` in words, after waiting since `began`: a host that the watchdog stopped before is to blame itself.
    fn explained(&self, error: io::Error, waited: &str, began: Instant) -> io::Error {
        let said = |message| io::Error::new(ErrorKind::TimedOut, message);
        let fired = self.watchdog.as_ref().and_then(Watchdog::fired);
        if fired.is_some_and(|fired| fired < began) {
            let seconds = self.silence.as_secs_f64();
            return said(format!(
                "this program took no reading for {seconds} s, so the drive was stopped and the connection closed; is the machine too busy?"
            ));
        }
        match error.kind() {
            ErrorKind::WouldBlock | ErrorKind::TimedOut => {}
            _ if fired.is_some() => {}
            ErrorKind::ConnectionAborted | ErrorKind::BrokenPipe | ErrorKind::ConnectionReset => {
                return io::Error::new(ErrorKind::ConnectionAborted, "the connection is closed");
            }
            _ => return error,
        }
        said(format!("{waited} for {:.2} s", began.elapsed().as_secs_f64()))
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
        self.answer(request)
            .map_err(|error| self.explained(error, "no answer", began))
    }

    fn datagram(&mut self) -> io::Result<Vec<u8>> {
        let (began, mut bytes) = (Instant::now(), vec![0; 2048]);
        let size = uninterrupted(|| self.stream.recv(&mut bytes))
            .map_err(|error| self.explained(error, "no packet of its stream has arrived", began))?;
        bytes.truncate(size);
        if let Some(watchdog) = &self.watchdog {
            watchdog.state().last = Instant::now();
        }
        Ok(bytes)
    }

    fn port(&self) -> io::Result<u16> {
        Ok(self.stream.local_addr()?.port())
    }

    fn silence(&self) -> Duration {
        self.silence
    }

    fn guard(&mut self, stop: Option<Vec<Frame>>) -> io::Result<()> {
        self.patience(if stop.is_some() { self.silence } else { PATIENCE })?;
        self.stop = stop.iter().flatten().flat_map(Frame::encode).collect();
        self.watchdog = None;
        if stop.is_some() {
            let control = self.control.try_clone()?;
            self.watchdog = Some(Watchdog::start(control, self.stop.clone(), self.silence)?);
        }
        Ok(())
    }

    fn close(&mut self) {
        stop_and_close(&mut self.control, &self.stop);
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

/// The watchdog of a host that drives a device: a thread that stops the drive when the host takes no readings any more, whether it waits
/// for an answer, for a disk or for a terminal. It ends when it is dropped.
#[derive(Debug)]
struct Watchdog {
    state: Arc<Mutex<Beats>>,
    /// The thread ends when this is dropped.
    _alive: mpsc::Sender<()>,
}

/// Times of the last reading, and of the end of the drive.
#[derive(Debug)]
struct Beats {
    last: Instant,
    fired: Option<Instant>,
}

impl Watchdog {
    /// After a silence longer than `silence`, sends `stop` on `control` and closes it.
    fn start(mut control: TcpStream, stop: Vec<u8>, silence: Duration) -> io::Result<Self> {
        let state = Arc::new(Mutex::new(Beats { last: Instant::now(), fired: None }));
        let (alive, dropped) = mpsc::channel();
        let watchdog = Self { state: Arc::clone(&state), _alive: alive };
        thread::Builder::new().spawn(move || {
            let mut left = silence;
            while dropped.recv_timeout(left) == Err(mpsc::RecvTimeoutError::Timeout) {
                let mut beats = state.lock().unwrap_or_else(PoisonError::into_inner);
                left = (beats.last + silence).saturating_duration_since(Instant::now());
                if left.is_zero() {
                    beats.fired = Some(Instant::now());
                    drop(beats);
                    return stop_and_close(&mut control, &stop);
                }
            }
        })?;
        Ok(watchdog)
    }

    fn state(&self) -> std::sync::MutexGuard<'_, Beats> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// When the drive was stopped.
    fn fired(&self) -> Option<Instant> {
        self.state().fired
    }
}
