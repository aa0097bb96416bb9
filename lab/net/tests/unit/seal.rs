//! Guards authenticated frames: replays, reflections and other keys are refused.

use super::*;

fn pair() -> [Seal; 2] {
    let key = Key::of(b"0123456789abcdef");
    [Side::Client, Side::Server].map(|side| Seal::new(key, side))
}

fn drive(session: u64) -> Frame {
    Frame::new(Kind::Drive, session)
}

#[test]
fn a_secret_needs_sixteen_bytes() {
    assert!(Key::of(b"0123456789abcde\n\n\n").is_none());
    assert_eq!(Key::of(b"0123456789abcdef\n"), Key::of(b"0123456789abcdef"));
}

#[test]
fn a_drive_is_valid_in_its_session_only() {
    let [mut client, mut server] = pair();
    let hello = client.encode(&Frame::new(Kind::Hello, 7));
    assert!(server.decode(&hello).is_ok());
    // No code without the server's number.
    assert_eq!(client.encode(&drive(7)).len(), SIZE);
    let drawn = server.draw().unwrap();
    assert_ne!(drawn, server.draw().unwrap());
    client.begin(7, drawn);
    server.begin(7, drawn);
    let bytes = client.encode(&drive(7));
    assert_eq!(bytes.len(), server.size());
    assert_eq!(server.decode(&bytes), Ok(drive(7)));
    // Sent back to its sender, in another session with the same number, and after the session.
    assert_eq!(client.decode(&bytes), Err(FrameError::Malformed));
    server.begin(7, server.draw().unwrap());
    assert_eq!(server.decode(&bytes), Err(FrameError::Malformed));
    server.begin(8, drawn);
    assert_eq!(server.decode(&bytes), Err(FrameError::Malformed));
}

#[test]
fn another_key_a_changed_byte_and_a_missing_code_are_refused() {
    let [client, server] = pair();
    let bytes = client.encode(&Frame::new(Kind::Hello, 1));
    let other = Seal::new(Key::of(b"fedcba9876543210"), Side::Server);
    assert_eq!(other.decode(&bytes), Err(FrameError::Malformed));
    assert_eq!(server.decode(&bytes[..SIZE]), Err(FrameError::Malformed));
    for at in 0..bytes.len() {
        let mut changed = bytes.clone();
        changed[at] ^= 1;
        assert!(server.decode(&changed).is_err(), "byte {at}");
    }
}
