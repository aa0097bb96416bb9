//! The way to a device: requests and answers over TCP, packets over UDP.

use std::io::{self, ErrorKind, Read, Write};
use std::net::{SocketAddr, TcpStream, UdpSocket};
use std::time::Duration;

use super::codec::Frame;
use crate::address::is_loopback;

/// Longest time for an answer, and for the next packet.
const PATIENCE: Duration = Duration::from_secs(2);

/// The way to a device.
pub trait Transport {
    /// Sends a request and returns the answer.
    fn request(&mut self, request: &Frame) -> io::Result<Frame>;

    /// The next datagram of the stream.
    fn datagram(&mut self) -> io::Result<Vec<u8>>;

    /// Port on which the datagrams arrive.
    fn port(&self) -> io::Result<u16>;
}

/// A device on the network.
#[derive(Debug)]
pub struct Network {
    control: TcpStream,
    stream: UdpSocket,
    bytes: Vec<u8>,
}

impl Network {
    /// Connects to the control channel at `peer`, and sends the device's stream port the datagram that opens firewalls.
    pub fn connect(peer: SocketAddr) -> io::Result<Self> {
        let control = TcpStream::connect_timeout(&peer, PATIENCE)?;
        control.set_nodelay(true)?;
        control.set_read_timeout(Some(PATIENCE))?;
        control.set_write_timeout(Some(PATIENCE))?;
        let mut own = control.local_addr()?;
        own.set_port(0);
        let stream = UdpSocket::bind(own)?;
        stream.set_read_timeout(Some(PATIENCE))?;
        let port = peer.port().saturating_add(1);
        if !is_loopback(peer.ip()) {
            stream.send_to(b"vines", SocketAddr::new(peer.ip(), port))?;
        }
        Ok(Self { control, stream, bytes: Vec::new() })
    }
}

impl Transport for Network {
    fn request(&mut self, request: &Frame) -> io::Result<Frame> {
        self.control.write_all(&request.encode())?;
        let mut more = [0; 2048];
        loop {
            match Frame::decode(&self.bytes).map_err(|error| io::Error::new(ErrorKind::InvalidData, error))? {
                Some((answer, length)) => {
                    self.bytes.drain(..length);
                    return Ok(answer);
                }
                None => match self.control.read(&mut more)? {
                    0 => return Err(ErrorKind::ConnectionAborted.into()),
                    size => self.bytes.extend(&more[..size]),
                },
            }
        }
    }

    fn datagram(&mut self) -> io::Result<Vec<u8>> {
        let mut bytes = vec![0; 2048];
        let size = self.stream.recv(&mut bytes)?;
        bytes.truncate(size);
        Ok(bytes)
    }

    fn port(&self) -> io::Result<u16> {
        Ok(self.stream.local_addr()?.port())
    }
}
