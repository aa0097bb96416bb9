//! The connection to a device: requests over TCP, the stream over UDP, and a thread that stops the drive when this program hangs.

use std::io::{self, ErrorKind, Write};
use std::net::{Shutdown, SocketAddr, TcpStream, UdpSocket};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, Sender};
use std::thread;
use std::time::{Duration, Instant};

use vines_net::{CONNECT, is_loopback};

use crate::codec::Frame;

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

/// What the thread that watches over the host learns: a datagram was taken, or the device is driven and these requests stop it.
enum Sign {
    Reading,
    Driven(Vec<u8>),
}

/// A device on the network.
#[derive(Debug)]
pub struct Network {
    control: TcpStream,
    stream: UdpSocket,
    silence: Duration,
    /// The requests that stop the drive; empty while there is none.
    stop: Vec<u8>,
    watchdog: Sender<Sign>,
    fired: Arc<AtomicBool>,
}

impl Network {
    /// Connects to the control channel at `peer`, and sends the device's stream port the datagram that opens firewalls. The drive stops after
    /// a silence of either side that is longer than `silence`; [`LONGEST_SILENCE`] fits a device that sends a packet every 5 ms.
    pub fn connect(peer: SocketAddr, silence: Duration) -> io::Result<Self> {
        let control = TcpStream::connect_timeout(&peer, CONNECT)?;
        control.set_nodelay(true)?;
        let stream = UdpSocket::bind((control.local_addr()?.ip(), 0))?;
        stream.set_read_timeout(Some(silence))?;
        if !is_loopback(peer.ip()) {
            stream.send_to(b"vines", (peer.ip(), peer.port().saturating_add(1)))?;
        }
        let ((watchdog, signs), fired) = (mpsc::channel(), Arc::new(AtomicBool::new(false)));
        let (channel, has_fired) = (control.try_clone()?, Arc::clone(&fired));
        thread::Builder::new().spawn(move || watch(&signs, channel, silence, &has_fired))?;
        let mut network = Self { control, stream, silence, stop: Vec::new(), watchdog, fired };
        network.guard(&[])?;
        Ok(network)
    }

    fn has_fired(&self) -> bool {
        self.fired.load(Ordering::SeqCst)
    }

    /// Calls what waits for the device; its errors say for how long, or that this program was too slow before.
    fn waiting<T>(&mut self, what: &str, call: impl FnOnce(&mut Self) -> io::Result<T>) -> io::Result<T> {
        let (was_slow, began) = (self.has_fired(), Instant::now());
        call(self).map_err(|error| {
            let is_late = matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) || self.has_fired();
            io::Error::other(match (was_slow, is_late) {
                (true, _) => format!(
                    "this program took no reading for {} s, so the drive was stopped and the connection closed; is the machine too busy?",
                    self.silence.as_secs_f64()
                ),
                (_, true) => format!("{what} for {:.2} s", began.elapsed().as_secs_f64()),
                _ if error.kind() == ErrorKind::UnexpectedEof => "the connection is closed".into(),
                _ => error.to_string(),
            })
        })
    }
}

impl Transport for Network {
    fn request(&mut self, request: &Frame) -> io::Result<Frame> {
        self.waiting("no answer", |network| {
            network.control.write_all(&request.encode())?;
            Frame::read(&mut network.control)
        })
    }

    fn datagram(&mut self) -> io::Result<Vec<u8>> {
        self.waiting("no packet of its stream has arrived", |network| {
            let mut bytes = vec![0; 2048];
            let size = loop {
                match network.stream.recv(&mut bytes) {
                    // A signal: whoever catches it decides what it means.
                    Err(error) if error.kind() == ErrorKind::Interrupted => {}
                    received => break received?,
                }
            };
            bytes.truncate(size);
            // Without effect after the thread has closed the connection.
            let _ = network.watchdog.send(Sign::Reading);
            Ok(bytes)
        })
    }

    fn port(&self) -> io::Result<u16> {
        Ok(self.stream.local_addr()?.port())
    }

    fn silence(&self) -> Duration {
        self.silence
    }

    fn guard(&mut self, stop: &[Frame]) -> io::Result<()> {
        let patience = Some(if stop.is_empty() { CONNECT } else { self.silence });
        self.control.set_read_timeout(patience)?;
        self.control.set_write_timeout(patience)?;
        self.stop = stop.iter().flat_map(Frame::encode).collect();
        let _ = self.watchdog.send(Sign::Driven(self.stop.clone()));
        Ok(())
    }

    fn close(&mut self) {
        stop_and_close(&mut self.control, &self.stop);
    }
}

/// Sends the requests `stop` without waiting for their answers, and closes the control channel.
fn stop_and_close(control: &mut TcpStream, stop: &[u8]) {
    // What cannot be sent does not arrive; the end of the connection may.
    let _ = control.write_all(stop);
    let _ = control.shutdown(Shutdown::Both);
}

/// Stops the drive when the host takes no reading for longer than `silence`, whether it waits for an answer, for a disk or for a terminal.
/// Ends with the connection.
fn watch(signs: &Receiver<Sign>, mut control: TcpStream, silence: Duration, fired: &AtomicBool) {
    let mut stop = Vec::new();
    loop {
        let sign = match stop.is_empty() {
            true => signs.recv().map_err(RecvTimeoutError::from),
            false => signs.recv_timeout(silence),
        };
        match sign {
            Ok(Sign::Reading) => {}
            Ok(Sign::Driven(requests)) => stop = requests,
            Err(RecvTimeoutError::Timeout) => {
                fired.store(true, Ordering::SeqCst);
                return stop_and_close(&mut control, &stop);
            }
            Err(RecvTimeoutError::Disconnected) => return,
        }
    }
}
