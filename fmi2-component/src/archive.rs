//! A component's state as bytes: one description of it writes and reads.

use serde::{Serialize, de::DeserializeOwned};

use crate::refusal::Refusal;

/// Bytes being written or read, in the compact format of `postcard`: numbers bit by bit, no names, the same on every
/// platform.
#[derive(Debug)]
pub struct Archive<'a>(Mode<'a>);

#[derive(Debug)]
enum Mode<'a> {
    Write(&'a mut Vec<u8>),
    Read(&'a [u8]),
}

impl<'a> Archive<'a> {
    /// Appends to `bytes`.
    pub fn writer(bytes: &'a mut Vec<u8>) -> Self {
        Self(Mode::Write(bytes))
    }

    /// Reads from the front of `bytes`.
    pub fn reader(bytes: &'a [u8]) -> Self {
        Self(Mode::Read(bytes))
    }

    /// Writes a whole value, or reads it: the component itself, or one field after the other.
    ///
    /// # Errors
    /// Too few bytes, or bytes of another value.
    pub fn whole<T: Serialize + DeserializeOwned>(&mut self, value: &mut T) -> Result<(), Refusal> {
        match &mut self.0 {
            Mode::Write(out) => out.extend(postcard::to_stdvec(value)?),
            Mode::Read(rest) => (*value, *rest) = postcard::take_from_bytes(rest)?,
        }
        Ok(())
    }

    /// Ends the reading.
    ///
    /// # Errors
    /// Bytes are left over.
    pub(crate) fn finish(self) -> Result<(), Refusal> {
        match self.0 {
            Mode::Read(rest) if !rest.is_empty() => Err(Refusal::error(format!(
                "the serialised state is {} bytes too long",
                rest.len()
            ))),
            _ => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    type Fields = (f64, u64, i32, bool, String);

    fn bytes_of(mut fields: Fields) -> Vec<u8> {
        let mut bytes = Vec::new();
        Archive::writer(&mut bytes).whole(&mut fields).unwrap();
        bytes
    }

    #[test]
    fn what_is_written_is_read_bit_by_bit() {
        let nan = f64::from_bits(0x7ff8_0000_0000_1234);
        let bytes = bytes_of((nan, u64::MAX, -7, true, "µm".into()));
        let mut read = Fields::default();
        let mut archive = Archive::reader(&bytes);
        archive.whole(&mut read).unwrap();
        archive.finish().unwrap();
        assert_eq!(read.0.to_bits(), nan.to_bits());
        assert_eq!((read.1, read.2, read.3), (u64::MAX, -7, true));
        assert_eq!(read.4, "µm");
    }

    #[test]
    fn every_truncation_is_refused() {
        let bytes = bytes_of((1.0, 2, 3, false, "four".into()));
        for end in 0..bytes.len() {
            let mut archive = Archive::reader(&bytes[..end]);
            assert!(archive.whole(&mut Fields::default()).is_err());
        }
    }

    #[test]
    fn bytes_left_over_are_refused() {
        let mut bytes = bytes_of(Fields::default());
        bytes.push(0);
        let mut archive = Archive::reader(&bytes);
        archive.whole(&mut Fields::default()).unwrap();
        assert!(archive.finish().is_err());
    }
}
