//! The authentication of frames with a shared key.

use std::fmt::{self, Debug, Formatter};

use hmac::{Hmac, KeyInit, Mac};
use sha2::{Digest, Sha256};

use crate::frame::{Frame, FrameError, Kind, SIZE};

/// Shortest secret, bytes: 128 bits, which cannot be guessed.
const SECRET: usize = 16;

/// A shared key.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Key([u8; 32]);

impl Key {
    /// The key of a secret; None if it is shorter than 16 bytes. Space at its end does not count.
    pub fn of(secret: &[u8]) -> Option<Self> {
        let secret = secret.trim_ascii_end();
        (secret.len() >= SECRET).then(|| Self(Sha256::digest(secret).into()))
    }
}

impl Debug for Key {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        f.write_str("Key")
    }
}

/// One side of a connection: which frames it sends.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Side {
    Client = 1,
    Server = 2,
}

/// Encodes and decodes frames, with a code if there is a key.
///
/// The code covers the sender's side, a number that the server draws for the session, and the frame, in which the client's number of
/// the session and the number of the sample are counters against a replay. Hello, Welcome and the refusal of a session come before the
/// number of the server, and are covered without it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Seal {
    key: Option<Key>,
    pub side: Side,
    /// The client's number of the session, and the server's.
    session: Option<(u64, [f64; 2])>,
}

impl Seal {
    pub fn new(key: Option<Key>, side: Side) -> Self {
        Self { key, side, session: None }
    }

    /// Length of a frame, bytes, with its authentication code, HMAC-SHA-256.
    pub fn size(&self) -> usize {
        SIZE + self.key.map_or(0, |_| Sha256::output_size())
    }

    /// Draws the server's number of a session: integers that are exact as values of a frame, or zeros without a key.
    pub fn draw(&self) -> Result<[f64; 2], getrandom::Error> {
        let number = || Ok((getrandom::u64()? >> 12) as f64);
        self.key.map_or(Ok([0.0; 2]), |_| Ok([number()?, number()?]))
    }

    /// From now on, frames of this session need its numbers.
    pub fn begin(&mut self, session: u64, drawn: [f64; 2]) {
        self.session = Some((session, drawn));
    }

    /// The bytes of a frame.
    pub fn encode(&self, frame: &Frame) -> Vec<u8> {
        let mut bytes = frame.encode().to_vec();
        if let Some(mac) = self.mac(frame, &bytes, self.side) {
            bytes.extend(mac.finalize().into_bytes());
        }
        bytes
    }

    /// Reads a datagram of the other side.
    pub fn decode(&self, bytes: &[u8]) -> Result<Frame, FrameError> {
        if self.key.is_none() {
            return Frame::decode(bytes);
        }
        let (bytes, tag) = bytes.split_at(bytes.len().min(SIZE));
        let frame = Frame::decode(bytes)?;
        let from = if self.side == Side::Client {
            Side::Server
        } else {
            Side::Client
        };
        let mac = self.mac(&frame, bytes, from).ok_or(FrameError::Malformed)?;
        // In constant time.
        mac.verify_slice(tag).map_err(|_| FrameError::Malformed)?;
        Ok(frame)
    }

    fn mac(&self, frame: &Frame, bytes: &[u8], from: Side) -> Option<Hmac<Sha256>> {
        let opens = matches!(frame.kind, Kind::Hello | Kind::Welcome);
        let session = self.session.filter(|(number, _)| *number == frame.session && !opens);
        // Only the start of a session is valid without the server's number.
        if session.is_none() && !opens && frame.kind != Kind::Refusal {
            return None;
        }
        let mut mac = Hmac::<Sha256>::new_from_slice(&self.key?.0).ok()?;
        mac.update(&[from as u8, session.is_some().into()]);
        for number in session.map_or([0.0; 2], |(_, drawn)| drawn) {
            mac.update(&number.to_le_bytes());
        }
        mac.update(bytes);
        Some(mac)
    }
}

#[cfg(test)]
mod tests {
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
}
