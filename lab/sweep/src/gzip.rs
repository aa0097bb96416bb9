//! Files with a checksum: gzip (RFC 1952), which ends with the CRC-32 and the length of its content.

use std::io::{self, Read, Write};

use flate2::{Compression, bufread::GzDecoder, write::GzEncoder};

/// Compression level: the default of gzip.
pub(crate) const LEVEL: u32 = 6;

/// The header that encoder and Zarr codec write: no name, no time. The checksum does not cover it.
const HEADER: [u8; 10] = [0x1f, 0x8b, 8, 0, 0, 0, 0, 0, 0, 0xff];

/// What is wrong with a file.
#[derive(Debug, thiserror::Error)]
pub(crate) enum Fault {
    #[error("is missing")]
    Missing,
    #[error("is empty")]
    Empty,
    #[error("is truncated")]
    Truncated,
    #[error("has a damaged header")]
    Header,
    #[error("continues after its end")]
    Trailing,
    #[error("has a damaged content or checksum")]
    Checksum,
    #[error("is not what the sweep wrote")]
    Content,
    #[error("cannot be read ({0})")]
    Unreadable(io::Error),
}

impl From<io::Error> for Fault {
    fn from(error: io::Error) -> Self {
        match error.kind() {
            io::ErrorKind::NotFound => Self::Missing,
            _ => Self::Unreadable(error),
        }
    }
}

/// Compresses a content.
pub(crate) fn pack(content: &[u8]) -> io::Result<Vec<u8>> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::new(LEVEL));
    encoder.write_all(content)?;
    encoder.finish()
}

/// The content of a file whose checksum is right.
pub(crate) fn unpack(file: &[u8]) -> Result<Vec<u8>, Fault> {
    if file.is_empty() {
        return Err(Fault::Empty);
    }
    if !HEADER.starts_with(&file[..file.len().min(HEADER.len())]) {
        return Err(Fault::Header);
    }
    let mut decoder = GzDecoder::new(file);
    let mut content = Vec::new();
    match decoder.read_to_end(&mut content) {
        Ok(_) if decoder.into_inner().is_empty() => Ok(content),
        Ok(_) => Err(Fault::Trailing),
        Err(error) if error.kind() == io::ErrorKind::UnexpectedEof => Err(Fault::Truncated),
        Err(_) => Err(Fault::Checksum),
    }
}
