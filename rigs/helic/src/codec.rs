//! Frames of the control channel and packets of the stream, as bytes. Everything is little-endian.

use std::ffi::CStr;
use std::io::{self, Read};

use thiserror::Error;

const MAGIC: [u8; 2] = *b"HL";
/// Version of the protocol.
pub const VERSION: u8 = 3;
/// Longest payload of a frame, bytes.
pub const MAX_PAYLOAD: usize = 1024;
/// Largest number of values in a packet of a stream: it has 1472 bytes, 20 of them before the values.
pub(crate) const MAX_VALUES: usize = (1472 - 20) / 4;
/// Number of harmonics of a Fourier series, whose coefficients are mean, cosines, sines.
pub(crate) const HARMONICS: usize = 16;
/// The checksum of a frame, "CCITT-FALSE": polynomial 0x1021, initial value 0xffff, most significant bit first.
pub fn checksum(bytes: &[u8]) -> u16 {
    bytes.iter().fold(0xffff, |sum, byte| {
        let shift = |sum: u16| {
            if sum & 0x8000 == 0 {
                sum << 1
            } else {
                (sum << 1) ^ 0x1021
            }
        };
        (0..8).fold(sum ^ (u16::from(*byte) << 8), |sum, _| shift(sum))
    })
}

/// Types of a request. The answer has the type of the request, or [`message::ERROR`].
#[expect(missing_docs, reason = "the names of the protocol")]
pub mod message {
    pub const GET_PARAMS: u8 = 1;
    pub const GET_SOURCES: u8 = 2;
    pub const GET_PAR: u8 = 3;
    pub const SET_PAR: u8 = 4;
    pub const STREAM_SETUP: u8 = 7;
    pub const STREAM_START: u8 = 8;
    pub const STREAM_STOP: u8 = 9;
    pub const STATUS: u8 = 10;
    pub const ERROR: u8 = 255;
}

/// Why a device refuses a request, with the numbers of the protocol, or why bytes cannot be read.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
#[error("the bytes are no answer to the request: is it another version of the protocol?")]
#[expect(missing_docs, reason = "the names of the protocol")]
pub enum ErrorCode {
    BadFrame = 1,
    UnknownType,
    BadIndex,
    BadLength,
    ReadOnly,
    BadValue,
    Busy,
}

impl ErrorCode {
    /// The error with a number.
    pub fn of_number(number: u8) -> Option<Self> {
        use ErrorCode::{BadFrame, BadIndex, BadLength, BadValue, Busy, ReadOnly, UnknownType};
        let all = [BadFrame, UnknownType, BadIndex, BadLength, ReadOnly, BadValue, Busy];
        all.into_iter().find(|code| *code as u8 == number)
    }
}

/// Takes the first bytes.
pub(crate) fn take<const N: usize>(bytes: &mut &[u8]) -> Result<[u8; N], ErrorCode> {
    let (first, rest) = bytes.split_first_chunk().ok_or(ErrorCode::BadLength)?;
    *bytes = rest;
    Ok(*first)
}

/// Takes the text up to its NUL.
pub fn take_text(bytes: &mut &[u8]) -> Result<String, ErrorCode> {
    let text = CStr::from_bytes_until_nul(bytes).map_err(|_| ErrorCode::BadLength)?;
    *bytes = &bytes[text.count_bytes() + 1..];
    text.to_str().map(Into::into).map_err(|_| ErrorCode::BadFrame)
}

/// Size of a value, bytes. Its type is a letter as in Python's `struct`: `f`, `I`, `i`, `H`, `h`, `B`, `b` or `c`.
pub(crate) fn size(code: u8) -> usize {
    match code {
        b'H' | b'h' => 2,
        b'B' | b'b' | b'c' => 1,
        _ => 4,
    }
}

/// The bytes of values of a type; all integers in this program are 0 or above.
pub(crate) fn to_bytes(code: u8, values: &[f64]) -> Vec<u8> {
    let word = |value: &f64| match code {
        b'f' => (*value as f32).to_le_bytes(),
        _ => (*value as u32).to_le_bytes(),
    };
    let bytes = values.iter().map(word);
    bytes.flat_map(|word| word.into_iter().take(size(code))).collect()
}

/// The values of a type in `bytes`.
pub(crate) fn of_bytes(code: u8, bytes: &[u8]) -> Vec<f64> {
    let value = |bytes: &[u8]| match (code, bytes) {
        (b'f', &[a, b, c, d]) => f32::from_le_bytes([a, b, c, d]).into(),
        _ => bytes.iter().rfold(0.0, |sum, byte| 256.0 * sum + f64::from(*byte)),
    };
    bytes.chunks_exact(size(code)).map(value).collect()
}

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
    /// A request without a number.
    pub fn new(kind: u8, payload: impl Into<Vec<u8>>) -> Self {
        Self { kind, sequence: 0, payload: payload.into() }
    }

    /// The bytes of the frame.
    pub fn encode(&self) -> Vec<u8> {
        let length = (self.payload.len() as u16).to_le_bytes();
        let mut bytes = [&MAGIC[..], &[self.kind, self.sequence], &length, &self.payload].concat();
        bytes.extend(checksum(&bytes[2..]).to_le_bytes());
        bytes
    }

    /// Waits for the next frame of a connection; `bytes` are those that have arrived and not been used.
    pub fn read(stream: &mut impl Read, bytes: &mut Vec<u8>) -> io::Result<Self> {
        let mut more = [0; 2048];
        loop {
            let length = match bytes[..] {
                [_, _, _, _, low, high, ..] => usize::from(u16::from_le_bytes([low, high])),
                _ => 0,
            };
            let whole = bytes.get(..length + 8).and_then(<[u8]>::split_last_chunk);
            let is_damaged = whole.is_some_and(|(frame, sum)| checksum(&frame[2..]).to_le_bytes() != *sum);
            if !MAGIC.starts_with(&bytes[..bytes.len().min(2)]) || length > MAX_PAYLOAD || is_damaged {
                return Err(io::Error::other(ErrorCode::BadFrame));
            }
            if let Some((frame, _)) = whole {
                let (kind, sequence, payload) = (frame[2], frame[3], frame[6..].into());
                bytes.drain(..length + 8);
                return Ok(Self { kind, sequence, payload });
            }
            match stream.read(&mut more) {
                Ok(0) => return Err(io::ErrorKind::UnexpectedEof.into()),
                // A signal: whoever catches it decides what it means.
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                size => bytes.extend(&more[..size?]),
            }
        }
    }
}

/// A packet of the stream.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Packet {
    /// Number of the packet.
    pub sequence: u32,
    /// Number of the sample of the first record.
    pub first: u32,
    /// Samples per record.
    pub decimation: u16,
    /// Values per record.
    pub width: u8,
    /// The records, one after the other.
    pub values: Vec<f32>,
}

impl Packet {
    /// The bytes of the packet.
    pub fn encode(&self) -> Vec<u8> {
        let Self { sequence, first, decimation, width, values } = self;
        let records = (values.len() / usize::from(*width).max(1)) as u16;
        // No record is lost before it is sent.
        let words = [*sequence, *first, 0].map(u32::to_le_bytes).concat();
        let halves = [*decimation, records].map(u16::to_le_bytes).concat();
        let mut bytes = [&MAGIC[..], &[VERSION, *width], &words, &halves].concat();
        bytes.extend(values.iter().flat_map(|value| value.to_le_bytes()));
        bytes
    }

    /// Reads a datagram.
    pub fn decode(mut bytes: &[u8]) -> Result<Self, ErrorCode> {
        let bytes = &mut bytes;
        let [h, l, version, width] = take(bytes)?;
        let [sequence, first, _] = [take(bytes)?, take(bytes)?, take(bytes)?].map(u32::from_le_bytes);
        let [decimation, records] = [take(bytes)?, take(bytes)?].map(u16::from_le_bytes);
        let expected = 4 * usize::from(width) * usize::from(records);
        if [h, l] != MAGIC || version != VERSION || bytes.len() != expected || decimation == 0 {
            return Err(ErrorCode::BadFrame);
        }
        let values = bytes.as_chunks().0.iter().map(|word| f32::from_le_bytes(*word));
        let values = values.collect();
        Ok(Self { sequence, first, decimation, width, values })
    }
}
