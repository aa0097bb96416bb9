//! A UDP socket that sends frames and waits for them with a deadline.

use std::io::{self, ErrorKind};
use std::net::{Ipv4Addr, Ipv6Addr, SocketAddr, UdpSocket};
use std::thread;
use std::time::{Duration, Instant};

use super::error::LinkError;
use super::frame::{Frame, FrameError};

/// Waits below this are polled: the system's own time-outs may be as coarse as 16 ms, several samples long.
const FINE: Duration = Duration::from_millis(20);
/// Time from poll to poll.
const POLL: Duration = Duration::from_micros(50);

/// What came in, and from where.
pub(super) type Datagram = (Result<Frame, FrameError>, SocketAddr);

/// A socket.
#[derive(Debug)]
pub(super) struct Port {
    socket: UdpSocket,
}

impl Port {
    /// A socket that listens on `address`; port 0 takes a free one.
    pub fn listen(address: SocketAddr) -> Result<Self, LinkError> {
        let socket =
            UdpSocket::bind(address).map_err(|source| LinkError::Listen { address, source })?;
        Ok(Self { socket })
    }

    /// A socket to talk to `peer` from: of this machine alone where the peer is.
    pub fn towards(peer: SocketAddr) -> Result<Self, LinkError> {
        let ip = match (peer, peer.ip().to_canonical().is_loopback()) {
            (SocketAddr::V4(_), true) => Ipv4Addr::LOCALHOST.into(),
            (SocketAddr::V4(_), false) => Ipv4Addr::UNSPECIFIED.into(),
            (SocketAddr::V6(_), true) => Ipv6Addr::LOCALHOST.into(),
            (SocketAddr::V6(_), false) => Ipv6Addr::UNSPECIFIED.into(),
        };
        Self::listen(SocketAddr::new(ip, 0))
    }

    /// Where this socket can be reached.
    pub fn address(&self) -> io::Result<SocketAddr> {
        self.socket.local_addr()
    }

    /// Sends a frame. That it cannot be sent just now counts as lost on the way.
    pub fn send(&self, frame: &Frame, to: SocketAddr) -> io::Result<()> {
        match self.socket.send_to(&frame.encode(), to) {
            Err(error) if !is_passing(&error) => Err(error),
            _ => Ok(()),
        }
    }

    /// Waits for a datagram until `deadline`; one that is already there is always returned.
    pub fn receive(&self, deadline: Instant) -> io::Result<Option<Datagram>> {
        loop {
            let left = deadline.saturating_duration_since(Instant::now());
            let coarse = left.checked_sub(FINE).filter(|wait| !wait.is_zero());
            self.socket.set_nonblocking(coarse.is_none())?;
            if coarse.is_some() {
                self.socket.set_read_timeout(coarse)?;
            }
            // Longer than any frame, so that a datagram that is too long is not cut to the right length.
            let mut bytes = [0; 256];
            match self.socket.recv_from(&mut bytes) {
                Ok((size, from)) => return Ok(Some((Frame::decode(&bytes[..size]), from))),
                Err(error) if !is_passing(&error) => return Err(error),
                Err(_) if left.is_zero() => return Ok(None),
                Err(_) if coarse.is_none() => thread::sleep(left.min(POLL)),
                Err(_) => {}
            }
        }
    }
}

/// Nothing there, a full buffer, or the echo of a datagram that nobody took: UDP goes on after these.
fn is_passing(error: &io::Error) -> bool {
    matches!(
        error.kind(),
        ErrorKind::WouldBlock
            | ErrorKind::TimedOut
            | ErrorKind::Interrupted
            | ErrorKind::ConnectionRefused
            | ErrorKind::ConnectionReset
    )
}
