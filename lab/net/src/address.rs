//! Addresses, and which of them are allowed.

use std::fmt::{self, Display, Formatter};
use std::net::{IpAddr, SocketAddr};

use super::seal::Key;

/// Which addresses are allowed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BindScope {
    /// Loopback addresses only: 127.0.0.0/8 and `[::1]`.
    Loopback,
    /// All addresses. Everyone who can send to the address can drive the rig.
    Remote,
    /// All addresses, for peers with this key.
    Keyed(Key),
}

impl BindScope {
    /// The key, if there is one.
    pub fn key(self) -> Option<Key> {
        match self {
            Self::Keyed(key) => Some(key),
            Self::Loopback | Self::Remote => None,
        }
    }
}

/// An address on the network. The transport decides who sets the pace.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Address {
    /// `tcp://`: a controller, or a rig in lock-step.
    Tcp(SocketAddr),
    /// `udp://`: a rig in real time.
    Udp(SocketAddr),
}

impl Display for Address {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        match self {
            Self::Tcp(address) => write!(f, "tcp://{address}"),
            Self::Udp(address) => write!(f, "udp://{address}"),
        }
    }
}

/// Whether an address is on this machine.
pub fn is_loopback(ip: IpAddr) -> bool {
    ip.to_canonical().is_loopback()
}
