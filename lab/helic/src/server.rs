//! The server of a device: control channel, stream, and the clock of the device.

use std::io::{self, ErrorKind, Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream, UdpSocket};
use std::thread;
use std::time::Instant;

use vines_net::{Ended, POLL, RealTimeClock, ServerError, Session, is_loopback};

use crate::codec::Frame;
use crate::device::Device;

/// Port of the control channel; the stream has the next one.
pub const DEFAULT_PORT: u16 = 2350;

/// The server of a device, one host at a time.
pub struct HelicServer {
    control: TcpListener,
    stream: UdpSocket,
    device: Device,
    sample_time: f64,
}

/// The connection to a host.
struct Connection {
    control: TcpStream,
    peer: SocketAddr,
    bytes: Vec<u8>,
    opened: Instant,
    /// Number of its first sample.
    first: u64,
}

impl Connection {
    /// Answers the requests that have arrived; an error if the host has left, or has sent bytes that are not a frame.
    fn exchange(&mut self, device: &mut Device, uptime: u32) -> io::Result<()> {
        let mut more = [0; 2048];
        match self.control.read(&mut more) {
            Ok(0) => return Err(ErrorKind::UnexpectedEof.into()),
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted) => return Ok(()),
            size => self.bytes.extend(&more[..size?]),
        }
        while let Some(request) = Frame::take(&mut self.bytes).map_err(io::Error::other)? {
            self.control.write_all(&device.handle(&request, uptime).encode())?;
        }
        Ok(())
    }
}

impl HelicServer {
    /// Listens on `address` (TCP), and sends the stream from the next port. With port 0 the system chooses both ports.
    pub fn listen(address: SocketAddr, device: Device, sample_time: f64) -> io::Result<Self> {
        let control = TcpListener::bind(address)?;
        control.set_nonblocking(true)?;
        // A host on this machine may use the next port itself.
        let any_port = address.port() == 0 || is_loopback(address.ip());
        let port = if any_port { 0 } else { address.port().saturating_add(1) };
        let stream = UdpSocket::bind((address.ip(), port))?;
        stream.set_nonblocking(true)?;
        Ok(Self { control, stream, device, sample_time })
    }

    /// Address of the control channel.
    pub fn address(&self) -> io::Result<SocketAddr> {
        self.control.local_addr()
    }

    /// Serves until `stop` returns true. `report` receives the report when a host has left.
    pub fn serve(
        &mut self,
        mut stop: impl FnMut() -> bool,
        mut report: impl FnMut(&Session),
    ) -> Result<(), ServerError> {
        let mut clock = RealTimeClock::start(self.sample_time);
        let mut host: Option<Connection> = None;
        let mut tick = 0;
        loop {
            let stopped = stop();
            if host.is_none()
                && let Ok((control, peer)) = self.control.accept()
            {
                control.set_nodelay(true)?;
                control.set_nonblocking(true)?;
                clock.forget();
                let (bytes, opened) = (Vec::new(), Instant::now());
                host = Some(Connection { control, peer, bytes, opened, first: tick });
            }
            let uptime = clock.due(0).elapsed().as_millis() as u32;
            let device = &mut self.device;
            let left = host.as_mut().is_some_and(|host| host.exchange(device, uptime).is_err());
            if let Some(host) = host.take_if(|_| left || stopped) {
                device.disconnect();
                report(&Session {
                    peer: host.peer,
                    ended: if left { Ended::Farewell } else { Ended::Stopped },
                    samples: tick - host.first,
                    sample_time: self.sample_time,
                    seconds: host.opened.elapsed().as_secs_f64(),
                    timing: Some(clock.timing(0)),
                    histogram: clock.classes(),
                    counters: None,
                });
            }
            if stopped {
                return Ok(());
            }
            while Instant::now() >= clock.due(tick + 1) {
                tick += 1;
                clock.serve(tick);
                if let (Some((port, bytes)), Some(host)) = (self.device.tick()?, &host) {
                    // A packet that cannot be sent now counts as lost in the network.
                    let _ = self.stream.send_to(&bytes, (host.peer.ip(), port));
                }
            }
            thread::sleep(clock.due(tick + 1).saturating_duration_since(Instant::now()).min(POLL));
        }
    }
}
