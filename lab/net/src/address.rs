//! Addresses. Without permission, only those of this machine are allowed.

use std::net::{IpAddr, SocketAddr, ToSocketAddrs};

use super::error::LinkError;

/// Which addresses are allowed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BindScope {
    /// Loopback addresses only: 127.0.0.0/8 and `[::1]`.
    Loopback,
    /// All addresses. Everyone who can send to the address can drive the rig.
    Remote,
}

/// The address of `HOST:PORT` or `udp://HOST:PORT`. If the name has several, an IPv4 address.
///
/// # Errors
/// Text that is not an address, an unknown name, or an address outside `scope`.
pub fn resolve(text: &str, scope: BindScope) -> Result<SocketAddr, LinkError> {
    let failed = |message: String| LinkError::Address { address: text.into(), message };
    let place = text.strip_prefix("udp://").unwrap_or(text);
    let mut found: Vec<_> = place
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

fn is_loopback(ip: IpAddr) -> bool {
    ip.to_canonical().is_loopback()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn loopback_is_always_allowed_and_other_addresses_only_with_permission() {
        for here in ["127.0.0.1:5000", "udp://127.8.8.8:1", "[::1]:9"] {
            assert!(resolve(here, BindScope::Loopback).is_ok(), "{here}");
        }
        for beyond in ["0.0.0.0:5000", "192.0.2.1:5000", "[::]:5000", "[2001:db8::1]:1"] {
            let refused = resolve(beyond, BindScope::Loopback).unwrap_err();
            assert!(refused.to_string().contains("--allow-remote"), "{refused}");
            assert!(resolve(beyond, BindScope::Remote).is_ok(), "{beyond}");
        }
    }

    #[test]
    fn text_that_is_not_an_address_is_named() {
        for text in ["", "udp://", "127.0.0.1", "127.0.0.1:99999", "127.0.0.1:rig"] {
            let refused = resolve(text, BindScope::Remote).unwrap_err().to_string();
            assert!(refused.contains("HOST:PORT"), "{refused}");
        }
    }
}
