//! Frames over TCP and UDP, with a deadline for receiving.

use std::hint;
use std::io::{self, ErrorKind, Read, Write};
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr, TcpListener, TcpStream, UdpSocket};
use std::thread;
use std::time::{Duration, Instant};

use crate::address::{Address, is_loopback};
use crate::frame::{Frame, FrameError};
use crate::seal::{Key, Seal, Side};

/// Shorter waits use polling: the time-outs of the system may be as coarse as 16 ms, which is several samples.
const FINE: Duration = Duration::from_millis(20);
/// Polling interval: a twentieth of a sample at 1000 samples a second.
pub const POLL: Duration = Duration::from_micros(50);
/// Shorter waits do not sleep: the system wakes a program up later than it asks for, by about this.
const SPIN: Duration = Duration::from_micros(100);
/// Interval at which a server without a connection looks for one: short against the time for loading a rig.
const ACCEPT: Duration = Duration::from_millis(5);
/// Longest time for sending a frame over TCP to a peer that does not read: the longest silence in lock-step (protocol, "Faults").
const SEND: Duration = Duration::from_secs(5);
/// Longest time for a TCP client to say Hello: half of the time after which another one gives up.
const HELLO: Duration = Duration::from_secs(1);

/// A frame, or why the bytes are none.
pub(crate) type Received = Result<Frame, FrameError>;

/// One end of a connection: of a client, or of a server and all of its connections.
#[derive(Debug)]
pub(crate) struct Link {
    socket: Socket,
    pub seal: Seal,
}

#[derive(Debug)]
enum Socket {
    Tcp(Connections),
    Udp(UdpSocket),
}

/// One TCP connection; while a server has one, it closes others at once.
#[derive(Debug)]
struct Connections {
    /// None at the end of a client.
    listener: Option<TcpListener>,
    peer: Option<Connection>,
}

impl Link {
    /// The client's end of a connection to the server at `peer`.
    pub fn connect(peer: Address, patience: Duration, key: Option<Key>) -> io::Result<Self> {
        let seal = Seal::new(key, Side::Client);
        let socket = match peer {
            Address::Tcp(to) => {
                let connection = Connection::new(TcpStream::connect_timeout(&to, patience)?, to, seal.size())?;
                Socket::Tcp(Connections { listener: None, peer: Some(connection) })
            }
            Address::Udp(to) => {
                // Bound to loopback if the peer is on loopback.
                let own = match to.ip() {
                    ip if is_loopback(ip) => ip,
                    IpAddr::V4(_) => Ipv4Addr::UNSPECIFIED.into(),
                    IpAddr::V6(_) => Ipv6Addr::UNSPECIFIED.into(),
                };
                let socket = UdpSocket::bind((own, 0))?;
                // Datagrams of other senders do not arrive from now on.
                socket.connect(to)?;
                Socket::Udp(socket)
            }
        };
        Ok(Self { socket, seal })
    }

    /// The server's end of all connections to `address`.
    pub fn bind(address: Address, key: Option<Key>) -> io::Result<Self> {
        let socket = match address {
            Address::Udp(address) => Socket::Udp(UdpSocket::bind(address)?),
            Address::Tcp(address) => {
                let listener = TcpListener::bind(address)?;
                listener.set_nonblocking(true)?;
                Socket::Tcp(Connections { listener: Some(listener), peer: None })
            }
        };
        Ok(Self { socket, seal: Seal::new(key, Side::Server) })
    }

    pub fn is_real_time(&self) -> bool {
        matches!(self.socket, Socket::Udp(_))
    }

    /// Own address of a server.
    pub fn address(&self) -> io::Result<Address> {
        match &self.socket {
            Socket::Udp(socket) => Ok(Address::Udp(socket.local_addr()?)),
            Socket::Tcp(all) => match &all.listener {
                Some(listener) => Ok(Address::Tcp(listener.local_addr()?)),
                None => Err(ErrorKind::NotConnected.into()),
            },
        }
    }

    /// Waits for a frame until `deadline`, or less. A frame that has arrived is returned even after the deadline.
    pub fn receive(&mut self, deadline: Instant) -> io::Result<Option<(Received, SocketAddr)>> {
        match &mut self.socket {
            Socket::Udp(socket) => receive_from(socket, deadline, &self.seal),
            Socket::Tcp(all) => all.receive(deadline, &self.seal),
        }
    }

    /// Sends a frame. A frame that cannot be sent shows when no answer arrives, or when `receive` finds the connection closed.
    pub fn send(&mut self, frame: &Frame, to: SocketAddr) -> io::Result<()> {
        let bytes = self.seal.encode(frame);
        match &mut self.socket {
            // A client's socket is connected: some systems then refuse an address.
            Socket::Udp(socket) if self.seal.side == Side::Client => delivered(socket.send(&bytes)),
            Socket::Udp(socket) => delivered(socket.send_to(&bytes, to)),
            Socket::Tcp(all) => match &mut all.peer {
                Some(peer) if peer.from == to => peer.send(&bytes),
                _ => Ok(()),
            },
        }
    }

    pub fn close(&mut self, client: SocketAddr) {
        if let Socket::Tcp(all) = &mut self.socket {
            all.peer.take_if(|peer| peer.from == client);
        }
    }
}

impl Connections {
    fn receive(&mut self, deadline: Instant, seal: &Seal) -> io::Result<Option<(Received, SocketAddr)>> {
        loop {
            while let Some(Ok((stream, from))) = self.listener.as_ref().map(TcpListener::accept) {
                if self.peer.is_none() {
                    self.peer = Connection::new(stream, from, seal.size()).ok();
                }
            }
            if let Some(peer) = &mut self.peer {
                let received = peer.receive(deadline, seal)?.map(|frame| (frame, peer.from));
                let is_over = match &received {
                    Some((Err(FrameError::Closed), _)) => true,
                    // Another version gets an answer.
                    Some((Err(error), _)) => !peer.has_spoken && !matches!(error, FrameError::Version(_)),
                    Some((Ok(_), _)) => false,
                    None => !peer.has_spoken && peer.since.elapsed() > HELLO,
                };
                peer.has_spoken |= matches!(received, Some((Ok(_), _)));
                // A server forgets the connection; a client reads again that it is closed.
                self.peer.take_if(|_| is_over && self.listener.is_some());
                return Ok(received);
            }
            let left = deadline.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return Ok(None);
            }
            thread::sleep(left.min(ACCEPT));
        }
    }
}

/// A TCP connection.
#[derive(Debug)]
struct Connection {
    stream: TcpStream,
    from: SocketAddr,
    since: Instant,
    /// Whether a valid frame has arrived.
    has_spoken: bool,
    bytes: Vec<u8>,
    /// Number of bytes of the next frame that have arrived.
    filled: usize,
}

impl Connection {
    fn new(stream: TcpStream, from: SocketAddr, size: usize) -> io::Result<Self> {
        // Without this, the system collects small messages before it sends them.
        stream.set_nodelay(true)?;
        stream.set_write_timeout(Some(SEND))?;
        let (since, bytes) = (Instant::now(), vec![0; size]);
        Ok(Self { stream, from, since, has_spoken: false, bytes, filled: 0 })
    }

    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.stream.set_nonblocking(false)?;
        // If this fails, the connection has been closed, which the next read reports.
        let _ = self.stream.write_all(bytes);
        Ok(())
    }

    fn receive(&mut self, deadline: Instant, seal: &Seal) -> io::Result<Option<Received>> {
        let Self { stream, bytes, filled, .. } = self;
        while *filled < bytes.len() {
            let block = |time: Option<Duration>| {
                stream.set_nonblocking(time.is_none())?;
                time.map_or(Ok(()), |_| stream.set_read_timeout(time))
            };
            match wait(deadline, block, || (&*stream).read(&mut bytes[*filled..])) {
                Ok(None) => return Ok(None),
                Ok(Some(0)) | Err(_) => return Ok(Some(Err(FrameError::Closed))),
                Ok(Some(more)) => *filled += more,
            }
        }
        *filled = 0;
        Ok(Some(seal.decode(bytes)))
    }
}

fn receive_from(socket: &UdpSocket, deadline: Instant, seal: &Seal) -> io::Result<Option<(Received, SocketAddr)>> {
    // Longer than a frame: a datagram that is too long must not be cut to the valid length.
    let mut bytes = [0; 256];
    let block = |time: Option<Duration>| {
        socket.set_nonblocking(time.is_none())?;
        time.map_or(Ok(()), |_| socket.set_read_timeout(time))
    };
    let received = wait(deadline, block, || socket.recv_from(&mut bytes).map_err(undelivered))?;
    Ok(received.map(|(size, from)| (seal.decode(&bytes[..size]), from)))
}

/// Calls `receive` until it succeeds, or None at `deadline`. `block` sets the time-out of the socket; None: it does not wait.
fn wait<T>(
    deadline: Instant,
    block: impl Fn(Option<Duration>) -> io::Result<()>,
    mut receive: impl FnMut() -> io::Result<T>,
) -> io::Result<Option<T>> {
    loop {
        let left = deadline.saturating_duration_since(Instant::now());
        let coarse = left.checked_sub(FINE).filter(|wait| !wait.is_zero());
        block(coarse)?;
        match receive() {
            Ok(received) => return Ok(Some(received)),
            Err(error) if !is_passing(&error) => return Err(error),
            Err(_) if left.is_zero() => return Ok(None),
            Err(_) if left < SPIN => hint::spin_loop(),
            Err(_) if coarse.is_none() => thread::sleep(POLL),
            Err(_) => {}
        }
    }
}

/// Nothing to read yet, or a full buffer.
fn is_passing(error: &io::Error) -> bool {
    matches!(
        error.kind(),
        ErrorKind::WouldBlock | ErrorKind::TimedOut | ErrorKind::Interrupted
    )
}

/// UDP continues after a report that an earlier datagram was not delivered.
fn undelivered(error: io::Error) -> io::Error {
    match error.kind() {
        ErrorKind::ConnectionRefused | ErrorKind::ConnectionReset => ErrorKind::WouldBlock.into(),
        _ => error,
    }
}

/// A datagram that cannot be sent now counts as lost in the network.
fn delivered(sent: io::Result<usize>) -> io::Result<()> {
    match sent.map_err(undelivered) {
        Err(error) if !is_passing(&error) => Err(error),
        _ => Ok(()),
    }
}
