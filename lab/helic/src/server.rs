//! A device at a network address: control channel, stream and beacon, with the clock of the device.

use std::io::{self, ErrorKind, Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream, UdpSocket};
use std::thread;
use std::time::{Duration, Instant};

use super::codec::{BEACON_REQUEST, Frame, beacon};
use super::device::Device;
use super::registry::{EXPERIMENT, FIRMWARE};
use vines_net::{Ended, RealTimeClock, ServerError, Session, is_loopback};

/// Port of the control channel; stream and beacon have the next two.
pub const DEFAULT_PORT: u16 = 2350;
/// Polling interval.
const POLL: Duration = Duration::from_micros(50);

/// The server of a device.
pub struct HelicServer {
    control: TcpListener,
    stream: UdpSocket,
    /// Absent where another device of this machine has the port.
    beacon: Option<UdpSocket>,
    device: Device,
    sample_time: f64,
}

/// The host.
struct Connection {
    stream: TcpStream,
    peer: SocketAddr,
    bytes: Vec<u8>,
    opened: Instant,
    first: u64,
}

impl HelicServer {
    /// Listens on `address` (TCP), and with the next two ports for primers of the stream and for the beacon. With port 0 the system
    /// chooses all ports.
    pub fn listen(address: SocketAddr, device: Device, sample_time: f64) -> io::Result<Self> {
        let beside = |offset: u16| match address.port() {
            0 => address,
            port => SocketAddr::new(address.ip(), port.saturating_add(offset)),
        };
        let control = TcpListener::bind(address)?;
        // On this machine, the host itself binds that port.
        let source = if is_loopback(address.ip()) {
            SocketAddr::new(address.ip(), 0)
        } else {
            beside(1)
        };
        let (stream, beacon) = (UdpSocket::bind(source)?, UdpSocket::bind(beside(2)).ok());
        control.set_nonblocking(true)?;
        stream.set_nonblocking(true)?;
        if let Some(beacon) = &beacon {
            beacon.set_nonblocking(true)?;
        }
        Ok(Self { control, stream, beacon, device, sample_time })
    }

    /// Address of the control channel.
    pub fn address(&self) -> io::Result<SocketAddr> {
        self.control.local_addr()
    }

    /// Serves until `stop` returns true. `tell` receives a report when a host has left.
    pub fn serve(&mut self, mut stop: impl FnMut() -> bool, mut tell: impl FnMut(&Session)) -> Result<(), ServerError> {
        let mut clock = RealTimeClock::start(self.sample_time);
        let mut host: Option<Connection> = None;
        let mut tick = 0;
        loop {
            let stopped = stop();
            if host.is_none()
                && let Ok((stream, peer)) = self.control.accept()
            {
                stream.set_nodelay(true)?;
                stream.set_nonblocking(true)?;
                clock.punctuality = Default::default();
                host = Some(Connection {
                    stream,
                    peer,
                    bytes: Vec::new(),
                    opened: Instant::now(),
                    first: tick,
                });
            }
            let uptime = clock.due(0).elapsed().as_millis() as u32;
            let left = host
                .as_mut()
                .is_some_and(|host| !host.exchange(&mut self.device, uptime));
            if let Some(host) = host.take_if(|_| left || stopped) {
                self.device.disconnect();
                tell(&Session {
                    peer: host.peer,
                    ended: if left { Ended::Farewell } else { Ended::Stopped },
                    samples: tick - host.first,
                    sample_time: self.sample_time,
                    seconds: host.opened.elapsed().as_secs_f64(),
                    punctuality: Some(clock.punctuality.clone()),
                    counters: None,
                });
            }
            if stopped {
                return Ok(());
            }
            self.answer_beacon();
            while Instant::now() >= clock.due(tick + 1) {
                tick += 1;
                clock.serve(tick);
                if let (Some((port, bytes)), Some(host)) = (self.device.tick()?, &host) {
                    // What cannot be sent now is lost in the network.
                    let _ = self.stream.send_to(&bytes, (host.peer.ip(), port));
                }
            }
            thread::sleep(clock.due(tick + 1).saturating_duration_since(Instant::now()).min(POLL));
        }
    }

    fn answer_beacon(&self) {
        // The content of primers has no meaning; they must only not fill the buffer.
        let mut bytes = [0; 64];
        while self.stream.recv_from(&mut bytes).is_ok() {}
        let Some(beacon_socket) = &self.beacon else {
            return;
        };
        while let Ok((size, from)) = beacon_socket.recv_from(&mut bytes) {
            if bytes[..size] == BEACON_REQUEST {
                let port = self.address().map_or(DEFAULT_PORT, |address| address.port());
                let _ = beacon_socket.send_to(&beacon(port, EXPERIMENT, FIRMWARE), from);
            }
        }
    }
}

impl Connection {
    /// Answers what has arrived; false if the host has left, or has sent what is not a frame.
    fn exchange(&mut self, device: &mut Device, uptime: u32) -> bool {
        let mut more = [0; 2048];
        match self.stream.read(&mut more) {
            Ok(0) => return false,
            Ok(size) => self.bytes.extend(&more[..size]),
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted) => return true,
            Err(_) => return false,
        }
        while let Ok(request) = Frame::take(&mut self.bytes) {
            let Some(request) = request else {
                return true;
            };
            let answer = device.handle(&request, uptime).encode();
            if self.stream.write_all(&answer).is_err() || device.has_rebooted() {
                return false;
            }
        }
        false
    }
}
