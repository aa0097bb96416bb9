//! Addresses, and the rule that nothing leaves this machine unless told to.

use std::net::{IpAddr, SocketAddr, ToSocketAddrs};

use super::error::LinkError;

/// Whether addresses beyond this machine are allowed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reach {
    /// Loopback only: 127.0.0.1 and its like, or `[::1]`.
    Loopback,
    /// Any address. Whoever can send to it can drive the rig.
    Remote,
}

/// The address that `HOST:PORT` or `udp://HOST:PORT` names; of several, an IPv4 one.
///
/// # Errors
/// Text that is no address, a name that is not known, or an address that `reach` does not cover.
pub fn resolve(text: &str, reach: Reach) -> Result<SocketAddr, LinkError> {
    let failed = |message: String| LinkError::Address {
        address: text.into(),
        message,
    };
    let place = text.strip_prefix("udp://").unwrap_or(text);
    let mut found: Vec<_> = place
        .to_socket_addrs()
        .map_err(|error| failed(format!("{error}; HOST:PORT is wanted")))?
        .collect();
    found.sort_by_key(SocketAddr::is_ipv6);
    let address = *found
        .first()
        .ok_or_else(|| failed("the name has no address".into()))?;
    if reach == Reach::Loopback && !is_loopback(address.ip()) {
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
    fn loopback_is_always_allowed_and_anything_else_only_when_told() {
        for here in ["127.0.0.1:5000", "udp://127.8.8.8:1", "[::1]:9"] {
            assert!(resolve(here, Reach::Loopback).is_ok(), "{here}");
        }
        for beyond in [
            "0.0.0.0:5000",
            "192.0.2.1:5000",
            "[::]:5000",
            "[2001:db8::1]:1",
        ] {
            let refused = resolve(beyond, Reach::Loopback).unwrap_err();
            assert!(refused.to_string().contains("--allow-remote"), "{refused}");
            assert!(resolve(beyond, Reach::Remote).is_ok(), "{beyond}");
        }
    }

    #[test]
    fn what_is_no_address_is_named() {
        for text in [
            "",
            "udp://",
            "127.0.0.1",
            "127.0.0.1:99999",
            "127.0.0.1:rig",
        ] {
            let refused = resolve(text, Reach::Remote).unwrap_err().to_string();
            assert!(refused.contains("HOST:PORT"), "{refused}");
        }
    }
}
