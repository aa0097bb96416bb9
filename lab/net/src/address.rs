//! Addresses. Without permission, only those of this machine are allowed.

use std::fmt::{self, Display, Formatter};
use std::net::{IpAddr, SocketAddr, ToSocketAddrs};

use super::error::LinkError;
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
    #[must_use]
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

impl Address {
    /// The address of `tcp://HOST:PORT` or `udp://HOST:PORT`.
    pub fn parse(text: &str, scope: BindScope) -> Result<Self, LinkError> {
        match text.split_once("://") {
            Some(("tcp", place)) => Ok(Self::Tcp(resolve(place, scope)?)),
            Some(("udp", place)) => Ok(Self::Udp(resolve(place, scope)?)),
            _ => Err(LinkError::Address {
                address: text.into(),
                message: "expected is tcp://HOST:PORT or udp://HOST:PORT".into(),
            }),
        }
    }
}

impl Display for Address {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        match self {
            Self::Tcp(address) => write!(f, "tcp://{address}"),
            Self::Udp(address) => write!(f, "udp://{address}"),
        }
    }
}

/// The address of `HOST:PORT`. If the name has several, an IPv4 address.
pub fn resolve(text: &str, scope: BindScope) -> Result<SocketAddr, LinkError> {
    let failed = |message: String| LinkError::Address { address: text.into(), message };
    let mut found: Vec<_> = text
        .to_socket_addrs()
        .map_err(|error| failed(format!("{error}; expected is HOST:PORT")))?
        .collect();
    found.sort_by_key(SocketAddr::is_ipv6);
    let address = *found.first().ok_or_else(|| failed("the name has no address".into()))?;
    if scope == BindScope::Loopback && !is_loopback(address.ip()) {
        return Err(LinkError::Remote { address });
    }
    Ok(address)
}

pub(super) fn is_loopback(ip: IpAddr) -> bool {
    ip.to_canonical().is_loopback()
}

#[cfg(test)]
#[path = "../tests/unit/address.rs"]
mod tests;
