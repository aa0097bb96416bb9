//! Frames of the control channel and packets of the stream, as bytes. Everything is little-endian.

use std::io::{self, Read};

use crc::{CRC_16_IBM_3740, Crc};
use thiserror::Error;

const MAGIC: [u8; 2] = *b"HL";
/// Version of the protocol.
pub const VERSION: u8 = 3;
/// Longest payload of a frame, bytes.
pub const MAX_PAYLOAD: usize = 1024;
/// Longest packet of a stream, bytes.
const MAX_PACKET: usize = 1472;
/// Number of harmonics of a Fourier series.
pub(crate) const HARMONICS: usize = 16;
/// Number of coefficients of a Fourier series: mean, cosines, sines.
pub(crate) const COEFFICIENTS: usize = 2 * HARMONICS + 1;
/// Length of magic, type, sequence and length of a frame, bytes.
const HEADER: usize = 6;
/// Length of everything before the records of a packet, bytes.
const PACKET_HEADER: usize = 20;
/// "CCITT-FALSE": polynomial 0x1021, initial value 0xffff.
const CHECKSUM: Crc<u16> = Crc::<u16>::new(&CRC_16_IBM_3740);

/// Types of a request. The answer has the type of the request, or [`message::ERROR`].
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

/// Why a device refuses a request, with the numbers of the protocol.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
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

/// The bytes are not a frame or a packet.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
#[error("not a frame of the helic protocol")]
pub struct Malformed;

/// Takes the first bytes.
pub(crate) fn take<const N: usize>(bytes: &mut &[u8]) -> Result<[u8; N], Malformed> {
    let (first, rest) = bytes.split_first_chunk().ok_or(Malformed)?;
    *bytes = rest;
    Ok(*first)
}

/// Takes the ASCII text up to its NUL.
pub fn take_text(bytes: &mut &[u8]) -> Result<String, Malformed> {
    let end = bytes.iter().position(|byte| *byte == 0).ok_or(Malformed)?;
    let (text, rest) = bytes.split_at(end);
    *bytes = &rest[1..];
    let ascii = text.is_ascii().then(|| String::from_utf8_lossy(text).into());
    ascii.ok_or(Malformed)
}

/// Size of a value, bytes. Its type is a letter as in Python's `struct`: `f`, `I`, `i`, `H`, `h`, `B`, `b` or `c`.
pub(crate) fn size(code: u8) -> usize {
    match code {
        b'H' | b'h' => 2,
        b'B' | b'b' | b'c' => 1,
        _ => 4,
    }
}

/// The bytes of values of a type.
pub(crate) fn to_bytes(code: u8, values: &[f64]) -> Vec<u8> {
    let bytes = |value: f64| match code {
        b'f' => (value as f32).to_le_bytes(),
        // A conversion from i64 keeps the bits of negative values.
        _ => (value as i64 as u32).to_le_bytes(),
    };
    let words = values.iter().map(|value| bytes(*value));
    words.flat_map(|word| word.into_iter().take(size(code))).collect()
}

/// The values of a type in `bytes`.
pub(crate) fn of_bytes(code: u8, bytes: &[u8]) -> Vec<f64> {
    let value = |bytes: &[u8]| {
        let mut word = [0; 4];
        word[..bytes.len()].copy_from_slice(bytes);
        match code {
            b'f' => f32::from_le_bytes(word).into(),
            _ => u32::from_le_bytes(word).into(),
        }
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
    /// The bytes of the frame.
    pub fn encode(&self) -> Vec<u8> {
        let length = (self.payload.len() as u16).to_le_bytes();
        let mut bytes = [&MAGIC[..], &[self.kind, self.sequence], &length, &self.payload].concat();
        bytes.extend(crc16(&bytes[2..]).to_le_bytes());
        bytes
    }

    /// Waits for the next frame of a connection.
    pub fn read(stream: &mut impl Read) -> io::Result<Self> {
        let mut bytes = vec![0; HEADER];
        stream.read_exact(&mut bytes)?;
        let length = usize::from(u16::from_le_bytes([bytes[4], bytes[5]]));
        bytes.resize(HEADER + length.min(MAX_PAYLOAD) + 2, 0);
        stream.read_exact(&mut bytes[HEADER..])?;
        let frame = Self::take(&mut bytes).map_err(io::Error::other)?;
        frame.ok_or_else(|| io::Error::other(Malformed))
    }

    /// Takes the first frame from the bytes that a connection has received; None if more bytes are needed.
    pub fn take(bytes: &mut Vec<u8>) -> Result<Option<Self>, Malformed> {
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
        let (kind, sequence, payload) = (header[2], header[3], rest[..length].to_vec());
        bytes.drain(..HEADER + length + 2);
        Ok(Some(Self { kind, sequence, payload }))
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
    pub(crate) fn capacity(width: usize) -> usize {
        (MAX_PACKET - PACKET_HEADER) / (4 * width.max(1))
    }

    /// The bytes of the packet.
    pub fn encode(&self) -> Vec<u8> {
        let Self { sequence, first, dropped, decimation, width, values } = self;
        let records = (values.len() / usize::from(*width).max(1)) as u16;
        let words = [sequence, first, dropped].map(|word| word.to_le_bytes()).concat();
        let halves = [*decimation, records].map(u16::to_le_bytes).concat();
        let mut bytes = [&MAGIC[..], &[VERSION, *width], &words, &halves].concat();
        bytes.extend(values.iter().flat_map(|value| value.to_le_bytes()));
        bytes
    }

    /// Reads a datagram.
    pub fn decode(mut bytes: &[u8]) -> Result<Self, Malformed> {
        let bytes = &mut bytes;
        let [h, l, version, width] = take(bytes)?;
        let [sequence, first, dropped] = [take(bytes)?, take(bytes)?, take(bytes)?].map(u32::from_le_bytes);
        let [decimation, records] = [take(bytes)?, take(bytes)?].map(u16::from_le_bytes);
        let expected = 4 * usize::from(width) * usize::from(records);
        if [h, l] != MAGIC || version != VERSION || bytes.len() != expected || decimation == 0 {
            return Err(Malformed);
        }
        let values = of_bytes(b'f', bytes).into_iter().map(|value| value as f32).collect();
        Ok(Self { sequence, first, dropped, decimation, width, values })
    }
}
