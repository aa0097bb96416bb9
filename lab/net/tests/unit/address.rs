//! Guards addresses from text, and which of them are allowed.

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
