//! Addresses, which of them are allowed, and the errors of a connection.

use std::fmt::{self, Display, Formatter};
use std::io;
use std::net::{IpAddr, SocketAddr, ToSocketAddrs};

use thiserror::Error;
use vines_rig::{ControllerError, RigError};

use crate::frame::Refusal;
use crate::seal::Key;

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

impl Address {
    /// The address of the socket, without the transport.
    pub fn socket(self) -> SocketAddr {
        match self {
            Self::Tcp(socket) | Self::Udp(socket) => socket,
        }
    }

    /// The address of `tcp://HOST:PORT` or `udp://HOST:PORT`.
    pub fn parse(text: &str, scope: BindScope) -> Result<Self, LinkError> {
        match text.split_once("://") {
            Some(("tcp", place)) => Ok(Self::Tcp(resolve(place, scope)?)),
            Some(("udp", place)) => Ok(Self::Udp(resolve(place, scope)?)),
            _ => Err(LinkError::Address {
                address: text.into(),
                message: "expected tcp://HOST:PORT or udp://HOST:PORT".into(),
            }),
        }
    }
}

/// The address of `HOST:PORT`. If the name has several, an IPv4 address.
pub fn resolve(text: &str, scope: BindScope) -> Result<SocketAddr, LinkError> {
    let failed = |message: String| LinkError::Address { address: text.into(), message };
    let addresses = text.to_socket_addrs();
    let addresses = addresses.map_err(|error| failed(format!("{error}; expected HOST:PORT")))?;
    let address = addresses.min_by_key(SocketAddr::is_ipv6);
    let address = address.ok_or_else(|| failed("the name has no address".into()))?;
    if scope == BindScope::Loopback && !is_loopback(address.ip()) {
        return Err(LinkError::Remote(address));
    }
    Ok(address)
}

/// Reason why a connection cannot be opened, or cannot continue. Times are in s; the messages explain the fields.
#[derive(Debug, Error)]
#[expect(missing_docs, reason = "the messages explain the fields")]
pub enum LinkError {
    #[error("{address} cannot be used: {message}")]
    Address { address: String, message: String },
    #[error("{0} is not a loopback address: everyone who can reach it could drive the rig")]
    Remote(SocketAddr),
    #[error("cannot listen on {address}: {source}")]
    Listen { address: Address, source: io::Error },
    #[error("no answer from {peer} within {seconds} s")]
    Unreachable {
        peer: Address,
        /// Whether a controller should be there, not a rig.
        controller: bool,
        seconds: f64,
    },
    #[error("{peer} refuses: {reason}")]
    Refused { peer: Address, reason: Refusal },
    #[error(
        "{peer} measures {theirs}, the [resonance] section of the scene needs {ours}: use the same scene for both, or set resonance.sensor, \
         resonance.reference and their quantities to what the rig measures"
    )]
    Sensors {
        peer: Address,
        theirs: String,
        ours: String,
    },
    #[error(
        "nothing has arrived from {peer} for {seconds} s, at t = {time:.3} s of the experiment: it is too slow or has ended, or the network is down"
    )]
    Silent { peer: Address, seconds: f64, time: f64 },
    #[error(
        "{samples} readings of {peer} were lost in the network or came too late, {seconds:.3} s, at t = {time:.3} s of the experiment; gaps of \
         up to {allowed} s are bridged"
    )]
    Blackout {
        peer: Address,
        samples: u64,
        seconds: f64,
        allowed: f64,
        time: f64,
    },
    #[error(
        "{peer} has shut down its drive, at t = {time:.3} s of the experiment: it was stopped, or no drive of this program reached it for \
         more than {seconds} s, because the network lost them, or this machine was too slow"
    )]
    ShutDown { peer: Address, time: f64, seconds: f64 },
    #[error(
        "{peer} has closed the connection, at t = {time:.3} s of the experiment: it has another client or another key, was stopped, or received nothing \
         for too long"
    )]
    Closed { peer: Address, time: f64 },
    #[error("{peer} has ended with an error, at t = {time:.3} s of the experiment: {message}")]
    Failed { peer: Address, time: f64, message: String },
    #[error(
        "{peer} sent a frame that is not the answer to a reading, at t = {time} s of the experiment: another kind, or of a later sample"
    )]
    Invalid { peer: Address, time: f64 },
    #[error("the network: {0}")]
    System(#[from] io::Error),
}

impl From<LinkError> for RigError {
    fn from(error: LinkError) -> Self {
        Self::Failed(error.into())
    }
}

impl From<LinkError> for ControllerError {
    fn from(error: LinkError) -> Self {
        Self::Failed(error.into())
    }
}

/// Why a server cannot continue.
#[derive(Debug, Error)]
#[expect(missing_docs, reason = "the messages explain the variants")]
pub enum ServerError {
    #[error(transparent)]
    Rig(#[from] RigError),
    #[error(transparent)]
    Controller(#[from] ControllerError),
    #[error("{0}")]
    Refused(#[from] Refusal),
    #[error("the network: {0}")]
    System(#[from] io::Error),
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn loopback_is_always_allowed_other_addresses_only_with_permission_and_text_that_is_not_an_address_is_named() {
        for here in ["127.0.0.1:5000", "127.8.8.8:1", "[::1]:9"] {
            assert!(resolve(here, BindScope::Loopback).is_ok(), "{here}");
        }
        for beyond in ["0.0.0.0:5000", "192.0.2.1:5000", "[::]:5000", "[2001:db8::1]:1"] {
            let refused = resolve(beyond, BindScope::Loopback).unwrap_err();
            assert!(matches!(refused, LinkError::Remote(_)), "{refused}");
            assert!(resolve(beyond, BindScope::Remote).is_ok(), "{beyond}");
        }
        for text in " udp:// tcp://127.0.0.1 udp://127.0.0.1:99999 http://127.0.0.1:1 127.0.0.1:1".split(' ') {
            let refused = Address::parse(text, BindScope::Remote).unwrap_err().to_string();
            assert!(refused.contains("HOST:PORT"), "{refused}");
        }
        let udp = Address::parse("udp://127.0.0.1:1", BindScope::Loopback).unwrap();
        assert_eq!(udp.to_string(), "udp://127.0.0.1:1");
    }
}
