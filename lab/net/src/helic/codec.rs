//! Frames of the control channel and packets of the stream, as bytes. Everything is little-endian.

use crc::{CRC_16_IBM_3740, Crc};
use thiserror::Error;

/// First two bytes of every frame and packet.
pub const MAGIC: [u8; 2] = *b"HL";
/// Version of the protocol.
pub const VERSION: u8 = 3;
/// Longest payload of a frame, bytes.
pub const MAX_PAYLOAD: usize = 1024;
/// Longest packet of a stream, bytes.
pub const MAX_PACKET: usize = 1472;
/// Request of the discovery beacon.
pub const BEACON_REQUEST: [u8; 3] = [b'H', b'L', 1];

/// Magic, type, sequence and length.
const HEADER: usize = 6;
const PACKET_HEADER: usize = 20;
/// "CCITT-FALSE": polynomial 0x1021, initial value 0xffff.
const CHECKSUM: Crc<u16> = Crc::<u16>::new(&CRC_16_IBM_3740);

/// Types of a request; the answer has the same one, or [`message::ERROR`].
#[expect(missing_docs, reason = "the names of the protocol")]
pub mod message {
    pub const GET_PARAMS: u8 = 1;
    pub const GET_SOURCES: u8 = 2;
    pub const GET_PAR: u8 = 3;
    pub const SET_PAR: u8 = 4;
    pub const SET_BLOCK: u8 = 5;
    pub const COMMIT: u8 = 6;
    pub const STREAM_SETUP: u8 = 7;
    pub const STREAM_START: u8 = 8;
    pub const STREAM_STOP: u8 = 9;
    pub const STATUS: u8 = 10;
    pub const ERROR: u8 = 255;
}

/// Why a device refuses a request.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
#[repr(u8)]
#[expect(missing_docs, reason = "the messages explain the variants")]
pub enum ErrorCode {
    #[error("bad frame")]
    BadFrame = 1,
    #[error("unknown type of request")]
    UnknownType = 2,
    #[error("bad index of a parameter")]
    BadIndex = 3,
    #[error("bad length")]
    BadLength = 4,
    #[error("the parameter is read-only")]
    ReadOnly = 5,
    #[error("bad value")]
    BadValue = 6,
    #[error("the device is busy")]
    Busy = 7,
}

impl ErrorCode {
    /// The error with a number.
    pub fn of_number(number: u8) -> Option<Self> {
        use ErrorCode::{BadFrame, BadIndex, BadLength, BadValue, Busy, ReadOnly, UnknownType};
        [BadFrame, UnknownType, BadIndex, BadLength, ReadOnly, BadValue, Busy]
            .into_iter()
            .find(|code| *code as u8 == number)
    }
}

/// The bytes are not a frame or a packet.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
#[error("not a frame of the helic protocol")]
pub struct Malformed;

/// A frame of the control channel.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Frame {
    /// Type: one of [`message`].
    pub kind: u8,
    /// Number that the host chooses and the device returns.
    pub sequence: u8,
    /// Content, at most [`MAX_PAYLOAD`] bytes.
    pub payload: Vec<u8>,
}

impl Frame {
    /// The bytes of the frame.
    pub fn encode(&self) -> Vec<u8> {
        let length = self.payload.len() as u16;
        let mut bytes = [
            &MAGIC[..],
            &[self.kind, self.sequence],
            &length.to_le_bytes(),
            &self.payload,
        ]
        .concat();
        bytes.extend(crc16(&bytes[2..]).to_le_bytes());
        bytes
    }

    /// The frame at the beginning of `bytes` and its length, or None if more bytes are needed.
    pub fn decode(bytes: &[u8]) -> Result<Option<(Self, usize)>, Malformed> {
        if !MAGIC.starts_with(&bytes[..bytes.len().min(2)]) {
            return Err(Malformed);
        }
        let Some((header, rest)) = bytes.split_at_checked(HEADER) else {
            return Ok(None);
        };
        let length = usize::from(u16::from_le_bytes([header[4], header[5]]));
        if length > MAX_PAYLOAD {
            return Err(Malformed);
        }
        let Some(checksum) = rest.get(length..length + 2) else {
            return Ok(None);
        };
        if crc16(&bytes[2..HEADER + length]).to_le_bytes() != checksum {
            return Err(Malformed);
        }
        let frame = Self {
            kind: header[2],
            sequence: header[3],
            payload: rest[..length].to_vec(),
        };
        Ok(Some((frame, HEADER + length + 2)))
    }
}

/// The checksum of a frame.
pub fn crc16(bytes: &[u8]) -> u16 {
    CHECKSUM.checksum(bytes)
}

/// A packet of the stream.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Packet {
    /// Number of the packet.
    pub sequence: u32,
    /// Number of the sample of the first record.
    pub first: u32,
    /// Records lost before they were sent, in total.
    pub dropped: u32,
    /// Samples per record.
    pub decimation: u16,
    /// Values per record.
    pub width: u8,
    /// The records, one after the other.
    pub values: Vec<f32>,
}

impl Packet {
    /// Largest number of records of `width` values.
    pub fn most(width: usize) -> usize {
        (MAX_PACKET - PACKET_HEADER) / (4 * width.max(1))
    }

    /// The bytes of the packet.
    pub fn encode(&self) -> Vec<u8> {
        let records = (self.values.len() / usize::from(self.width).max(1)) as u16;
        let mut bytes = [&MAGIC[..], &[VERSION, self.width]].concat();
        for word in [self.sequence, self.first, self.dropped] {
            bytes.extend(word.to_le_bytes());
        }
        bytes.extend(self.decimation.to_le_bytes());
        bytes.extend(records.to_le_bytes());
        bytes.extend(self.values.iter().flat_map(|value| value.to_le_bytes()));
        bytes
    }

    /// Reads a datagram.
    pub fn decode(bytes: &[u8]) -> Result<Self, Malformed> {
        let (header, values) = bytes.split_at_checked(PACKET_HEADER).ok_or(Malformed)?;
        let (half, width) = (|at: usize| u16::from_le_bytes([header[at], header[at + 1]]), header[3]);
        let expected = 4 * usize::from(width) * usize::from(half(18));
        if header[..2] != MAGIC || header[2] != VERSION || values.len() != expected || half(16) == 0 {
            return Err(Malformed);
        }
        let word = |at: usize| u32::from(half(at)) | u32::from(half(at + 2)) << 16;
        Ok(Self {
            sequence: word(4),
            first: word(8),
            dropped: word(12),
            decimation: half(16),
            width,
            values: reals(values),
        })
    }
}

/// The numbers in `bytes`; a rest of less than four bytes is ignored.
pub fn reals(bytes: &[u8]) -> Vec<f32> {
    let four = |bytes: &[u8]| f32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]);
    bytes.chunks_exact(4).map(four).collect()
}

/// What a device answers to Status.
#[derive(Debug, Clone, Copy, PartialEq)]
#[expect(missing_docs, reason = "the names of the protocol")]
pub struct Status {
    pub version: u8,
    pub parameters: u16,
    pub sources: u8,
    /// Hz
    pub sample_rate: f32,
    /// ms, modulo 2^32
    pub uptime: u32,
}

impl Status {
    /// The payload.
    pub fn encode(&self) -> Vec<u8> {
        let mut bytes = vec![self.version];
        bytes.extend(self.parameters.to_le_bytes());
        bytes.push(self.sources);
        bytes.extend(self.sample_rate.to_le_bytes());
        bytes.extend(self.uptime.to_le_bytes());
        bytes
    }

    /// Reads a payload.
    ///
    /// # Errors
    /// Another length. The version comes first, because everything after it may differ between versions.
    pub fn decode(payload: &[u8]) -> Result<Self, Malformed> {
        let &[version, a, b, sources, c, d, e, f, g, h, i, j] = payload else {
            return Err(Malformed);
        };
        Ok(Self {
            version,
            parameters: u16::from_le_bytes([a, b]),
            sources,
            sample_rate: f32::from_le_bytes([c, d, e, f]),
            uptime: u32::from_le_bytes([g, h, i, j]),
        })
    }
}

/// The text at the beginning of `bytes` up to its NUL, and what follows.
///
/// # Errors
/// Text without an end, or not ASCII.
pub fn text(bytes: &[u8]) -> Result<(String, &[u8]), Malformed> {
    let end = bytes.iter().position(|byte| *byte == 0).ok_or(Malformed)?;
    let text = bytes[..end]
        .is_ascii()
        .then(|| String::from_utf8_lossy(&bytes[..end]).into());
    Ok((text.ok_or(Malformed)?, &bytes[end + 1..]))
}

/// The answer to the discovery beacon.
pub fn beacon(control_port: u16, experiment: &str, firmware: &str) -> Vec<u8> {
    /// A locally administered address: the device is a program.
    const MAC: [u8; 6] = [2, b'H', b'L', 0, 0, 1];
    let name = |text: &str| {
        let mut name = [0; 16];
        name.iter_mut().zip(text.bytes()).for_each(|(to, from)| *to = from);
        name
    };
    let port = control_port.to_le_bytes();
    [
        &MAGIC[..],
        &[2, VERSION],
        &port,
        &MAC,
        &name(experiment),
        &name(firmware),
    ]
    .concat()
}
