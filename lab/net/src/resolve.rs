//! Addresses from text. Without permission, only those of this machine are allowed.

use std::net::{SocketAddr, ToSocketAddrs};

use super::address::{Address, BindScope, is_loopback};
use super::error::LinkError;

impl Address {
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
    let mut found: Vec<_> = text
        .to_socket_addrs()
        .map_err(|error| failed(format!("{error}; expected HOST:PORT")))?
        .collect();
    found.sort_by_key(SocketAddr::is_ipv6);
    let address = *found.first().ok_or_else(|| failed("the name has no address".into()))?;
    if scope == BindScope::Loopback && !is_loopback(address.ip()) {
        return Err(LinkError::Remote { address });
    }
    Ok(address)
}

#[cfg(test)]
#[path = "../tests/unit/resolve.rs"]
mod tests;
