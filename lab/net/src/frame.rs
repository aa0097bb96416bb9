//! The frame: 84 bytes, little-endian, one layout for all kinds. The specification is `docs/network-protocol.md`.

use thiserror::Error;

/// Version of the protocol.
pub const VERSION: u16 = 2;
/// Size of every frame, bytes.
pub const SIZE: usize = 84;
/// First four bytes of every frame in every version.
pub const MAGIC: [u8; 4] = *b"VINE";
/// Number of values in a frame.
pub const VALUES: usize = 6;

const CHECKSUM_AT: usize = SIZE - 4;

/// Kind of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// A client requests a session.
    Hello = 1,
    /// The server accepts it.
    Welcome = 2,
    /// The server refuses it.
    Refusal = 3,
    /// Readings: from a rig server, or to a controller server.
    Sensors = 4,
    /// A drive: to a rig server, or from a controller server.
    Drive = 5,
    /// The client ends the session with a rig in real time.
    Farewell = 6,
    /// The rig in real time confirms the farewell, and reports its timing.
    Report = 7,
    /// A move of the response amplitude, to a controller server.
    Move = 8,
}

impl Kind {
    fn from_code(code: u8) -> Option<Self> {
        use Kind::{Drive, Farewell, Hello, Move, Refusal, Report, Sensors, Welcome};
        [Hello, Welcome, Refusal, Sensors, Drive, Farewell, Report, Move]
            .into_iter()
            .find(|kind| *kind as u8 == code)
    }
}

/// Booleans of a frame. A bit without a meaning in a kind is 0.
pub mod flag {
    /// Sensors, to a controller: the drive is requested.
    pub const ACTIVE: u8 = 1;
    /// Drive, from a controller: its lock has settled.
    pub const SETTLED: u8 = 2;
    /// Sensors: there is a reference channel.
    pub const REFERENCE: u8 = 4;
    /// Sensors: the rig is a simulation, and its last four values describe the impacts.
    pub const GROUND_TRUTH: u8 = 8;
    /// Sensors, from a rig in real time: the drive has been shut down for this session.
    pub const SHUT_DOWN: u8 = 16;
    /// Drive: the rig holds the displacement, instead of its oscillator with frequency and amplitude.
    pub const HOLD: u8 = 128;
    /// Drive, from a controller: its phase error cannot be measured.
    pub const NO_PHASE: u8 = 32;
    /// Hello and Welcome: the server is, or should be, a controller; otherwise a rig.
    pub const CONTROLLER: u8 = 64;
}

/// One frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Frame {
    /// Kind.
    pub kind: Kind,
    /// Bits of [`flag`].
    pub flags: u8,
    /// Number of the session, chosen at random by the client.
    pub session: u64,
    /// Number of the sample.
    pub sequence: u64,
    /// Time of that sample since the start of the session, s.
    pub time: f64,
    /// Values; their meaning depends on the kind.
    pub values: [f64; VALUES],
}

/// Reason why a datagram is not a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum FrameError {
    /// It does not begin with [`MAGIC`].
    #[error("not a frame of this protocol")]
    Magic,
    /// It has another version.
    #[error("version {0} of the protocol")]
    Version(u16),
    /// It is too long or too short.
    #[error("{0} bytes instead of {SIZE}")]
    Size(usize),
    /// The checksum does not match the content.
    #[error("wrong checksum")]
    Checksum,
    /// It has no valid authentication code.
    #[error("not authenticated with the key")]
    Tag,
    /// There will be no more frames.
    #[error("the connection is closed")]
    Closed,
    /// Its kind is unknown.
    #[error("unknown kind {0}")]
    Kind(u8),
}

impl Frame {
    /// A frame of session `session` without samples.
    #[must_use]
    pub fn new(kind: Kind, session: u64) -> Self {
        Self {
            kind,
            flags: 0,
            session,
            sequence: 0,
            time: 0.0,
            values: [0.0; VALUES],
        }
    }

    /// Whether a bit of [`flag`] is set.
    #[must_use]
    pub fn has(&self, flag: u8) -> bool {
        self.flags & flag != 0
    }

    /// The bytes of the frame.
    #[must_use]
    pub fn encode(&self) -> [u8; SIZE] {
        let mut bytes = [0; SIZE];
        bytes[..4].copy_from_slice(&MAGIC);
        bytes[4..6].copy_from_slice(&VERSION.to_le_bytes());
        bytes[6] = self.kind as u8;
        bytes[7] = self.flags;
        bytes[8..16].copy_from_slice(&self.session.to_le_bytes());
        bytes[16..24].copy_from_slice(&self.sequence.to_le_bytes());
        bytes[24..32].copy_from_slice(&self.time.to_le_bytes());
        for (slot, value) in bytes[32..CHECKSUM_AT].chunks_exact_mut(8).zip(self.values) {
            slot.copy_from_slice(&value.to_le_bytes());
        }
        let checksum = crc32fast::hash(&bytes[..CHECKSUM_AT]);
        bytes[CHECKSUM_AT..].copy_from_slice(&checksum.to_le_bytes());
        bytes
    }

    /// Reads a datagram.
    ///
    /// # Errors
    /// A datagram that is not a frame. The version is checked first, because everything after it may differ between versions.
    pub fn decode(bytes: &[u8]) -> Result<Self, FrameError> {
        if bytes.len() < 6 || bytes[..4] != MAGIC {
            return Err(FrameError::Magic);
        }
        let version = u16::from_le_bytes([bytes[4], bytes[5]]);
        if version != VERSION {
            return Err(FrameError::Version(version));
        }
        let bytes: &[u8; SIZE] = bytes.try_into().map_err(|_| FrameError::Size(bytes.len()))?;
        let word = |at: usize| {
            let mut eight = [0; 8];
            eight.copy_from_slice(&bytes[at..at + 8]);
            u64::from_le_bytes(eight)
        };
        let mut checksum = [0; 4];
        checksum.copy_from_slice(&bytes[CHECKSUM_AT..]);
        if crc32fast::hash(&bytes[..CHECKSUM_AT]) != u32::from_le_bytes(checksum) {
            return Err(FrameError::Checksum);
        }
        Ok(Self {
            kind: Kind::from_code(bytes[6]).ok_or(FrameError::Kind(bytes[6]))?,
            flags: bytes[7],
            session: word(8),
            sequence: word(16),
            time: f64::from_bits(word(24)),
            values: std::array::from_fn(|n| f64::from_bits(word(32 + 8 * n))),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn frames() -> impl Strategy<Value = Frame> {
        let numbers = prop::array::uniform6(any::<u64>());
        (1u8..=8, any::<u8>(), any::<u64>(), any::<u64>(), any::<u64>(), numbers).prop_map(
            |(kind, flags, session, sequence, time, values)| Frame {
                kind: Kind::from_code(kind).unwrap(),
                flags,
                session,
                sequence,
                time: f64::from_bits(time),
                values: values.map(f64::from_bits),
            },
        )
    }

    proptest! {
        #[test]
        fn every_frame_is_decoded_to_the_same_bits(frame in frames()) {
            let bytes = frame.encode();
            let back = Frame::decode(&bytes).unwrap();
            // NaN is not equal to itself; its bits are.
            prop_assert_eq!(back.encode(), bytes);
        }

        #[test]
        fn a_frame_with_up_to_three_inverted_bits_is_refused(frame in frames(), turned in prop::collection::btree_set(0..SIZE * 8, 1..=3)) {
            let mut bytes = frame.encode();
            for bit in turned {
                bytes[bit / 8] ^= 1 << (bit % 8);
            }
            prop_assert!(Frame::decode(&bytes).is_err());
        }

        #[test]
        fn no_datagram_makes_the_decoder_panic(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
            prop_assert!(Frame::decode(&bytes).is_err());
        }

        #[test]
        fn a_frame_of_another_size_is_refused(frame in frames(), length in 0..2 * SIZE) {
            prop_assume!(length != SIZE);
            let mut bytes = frame.encode().to_vec();
            bytes.resize(length, 0);
            prop_assert!(Frame::decode(&bytes).is_err());
        }
    }

    #[test]
    fn the_layout_is_the_documented_one() {
        let frame = Frame {
            kind: Kind::Drive,
            flags: flag::SETTLED,
            session: 0x0102_0304_0506_0708,
            sequence: 9,
            time: 0.5,
            values: [1.0, 2.0, 0.0, 0.0, 0.0, -1.0],
        };
        let bytes = frame.encode();
        assert_eq!(&bytes[..8], b"VINE\x02\x00\x05\x02");
        assert_eq!(bytes[8..16], [8, 7, 6, 5, 4, 3, 2, 1]);
        assert_eq!(bytes[16..24], [9, 0, 0, 0, 0, 0, 0, 0]);
        assert_eq!(bytes[24..32], 0.5f64.to_le_bytes());
        assert_eq!(bytes[72..80], (-1.0f64).to_le_bytes());
        // The value of zlib.crc32 in Python.
        assert_eq!(bytes[80..], 0xe40e_f90du32.to_le_bytes());
    }

    #[test]
    fn another_version_is_recognised_in_a_datagram_of_any_size() {
        let longer = [&b"VINE\x07\x00"[..], &[0; 100]].concat();
        assert_eq!(Frame::decode(&longer), Err(FrameError::Version(7)));
        assert_eq!(Frame::decode(b"VINE"), Err(FrameError::Magic));
        assert_eq!(Frame::decode(b"VINE\x02\x00 short"), Err(FrameError::Size(12)));
    }
}
