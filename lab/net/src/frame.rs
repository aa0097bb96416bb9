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
    /// Drive: the rig holds the displacement, instead of its oscillator with frequency and amplitude. Move: the control of the response ends.
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
#[expect(missing_docs, reason = "the messages explain the variants")]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum FrameError {
    #[error("not a frame of this protocol")]
    Magic,
    #[error("version {0} of the protocol")]
    Version(u16),
    #[error("{0} bytes instead of {SIZE}")]
    Size(usize),
    #[error("wrong checksum")]
    Checksum,
    #[error("not authenticated with the key")]
    Tag,
    #[error("the connection is closed")]
    Closed,
    #[error("unknown kind {0}")]
    Kind(u8),
}

impl Frame {
    /// A frame of session `session` without samples.
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
    pub fn has(&self, flag: u8) -> bool {
        self.flags & flag != 0
    }

    /// The bytes of the frame.
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
#[path = "../tests/unit/frame.rs"]
mod tests;
