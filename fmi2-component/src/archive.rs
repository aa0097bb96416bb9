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

    #[test]
    fn what_is_written_is_read_bit_by_bit_and_bytes_that_miss_or_are_left_over_are_refused() {
        let nan = f64::from_bits(0x7ff8_0000_0000_1234);
        let (mut fields, mut bytes) = ((nan, u64::MAX, -7, true, "µm".to_owned()), Vec::new());
        Archive::writer(&mut bytes).whole(&mut fields).unwrap();
        let read = |bytes: &[u8]| {
            let (mut read, mut archive) = ((0.0_f64, 0_u64, 0_i32, false, String::new()), Archive::reader(bytes));
            archive.whole(&mut read).and_then(|()| archive.finish()).map(|()| read)
        };
        let same = read(&bytes).unwrap();
        assert_eq!((same.0.to_bits(), same.1, same.2), (nan.to_bits(), u64::MAX, -7));
        assert_eq!((same.3, same.4.as_str()), (true, "µm"));
        assert!((0..bytes.len()).all(|end| read(&bytes[..end]).is_err()));
        assert!(read(&[&bytes[..], &[0]].concat()).is_err());
    }
}
