//! A UDP socket for frames, with a deadline for receiving.

use std::io::{self, ErrorKind};
use std::net::{Ipv4Addr, Ipv6Addr, SocketAddr, UdpSocket};
use std::thread;
use std::time::{Duration, Instant};

use super::error::LinkError;
use super::frame::{Frame, FrameError};

/// Shorter waits use polling: the time-outs of the system may be as coarse as 16 ms, which is several samples.
const FINE: Duration = Duration::from_millis(20);
/// Polling interval.
const POLL: Duration = Duration::from_micros(50);

/// A received frame and its sender.
pub(super) type Datagram = (Result<Frame, FrameError>, SocketAddr);

/// A socket.
#[derive(Debug)]
pub(super) struct FrameSocket {
    socket: UdpSocket,
}

impl FrameSocket {
    /// A socket that listens on `address`; port 0 takes a free one.
    pub fn listen(address: SocketAddr) -> Result<Self, LinkError> {
        let socket = UdpSocket::bind(address).map_err(|source| LinkError::Listen { address, source })?;
        Ok(Self { socket })
    }

    /// A socket for a connection to `peer`. It is bound to loopback if the peer is on loopback.
    pub fn towards(peer: SocketAddr) -> Result<Self, LinkError> {
        let ip = match (peer, peer.ip().to_canonical().is_loopback()) {
            (SocketAddr::V4(_), true) => Ipv4Addr::LOCALHOST.into(),
            (SocketAddr::V4(_), false) => Ipv4Addr::UNSPECIFIED.into(),
            (SocketAddr::V6(_), true) => Ipv6Addr::LOCALHOST.into(),
            (SocketAddr::V6(_), false) => Ipv6Addr::UNSPECIFIED.into(),
        };
        Self::listen(SocketAddr::new(ip, 0))
    }

    /// Address of this socket.
    pub fn address(&self) -> io::Result<SocketAddr> {
        self.socket.local_addr()
    }

    /// Sends a frame. A frame that cannot be sent now counts as lost in the network.
    pub fn send(&self, frame: &Frame, to: SocketAddr) -> io::Result<()> {
        match self.socket.send_to(&frame.encode(), to) {
            Err(error) if !is_passing(&error) => Err(error),
            _ => Ok(()),
        }
    }

    /// Waits for a datagram until `deadline`. A datagram that has arrived is returned even after the deadline.
    pub fn receive(&self, deadline: Instant) -> io::Result<Option<Datagram>> {
        loop {
            let left = deadline.saturating_duration_since(Instant::now());
            let coarse = left.checked_sub(FINE).filter(|wait| !wait.is_zero());
            self.socket.set_nonblocking(coarse.is_none())?;
            if coarse.is_some() {
                self.socket.set_read_timeout(coarse)?;
            }
            // Longer than a frame: a datagram that is too long must not be cut to the valid length.
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

/// No datagram, a full buffer, or a report that an earlier datagram was not delivered: UDP continues after these.
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
