//! A component's state as bytes: one list of fields writes it and reads it.

use serde::{Serialize, de::DeserializeOwned};

use crate::refusal::Refusal;

/// Bytes being written or read. Numbers are kept bit by bit, in little-endian order on every platform.
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

    /// Whether fields are being read: what follows from them is to be computed anew afterwards.
    pub fn is_reading(&self) -> bool {
        matches!(self.0, Mode::Read(_))
    }

    /// A real number.
    ///
    /// # Errors
    /// The bytes have come to their end; so for every type.
    pub fn f64(&mut self, value: &mut f64) -> Result<(), Refusal> {
        let mut bits = value.to_bits();
        self.u64(&mut bits)?;
        *value = f64::from_bits(bits);
        Ok(())
    }

    /// Several real numbers.
    ///
    /// # Errors
    /// The bytes have come to their end.
    pub fn f64s<'b>(
        &mut self,
        values: impl IntoIterator<Item = &'b mut f64>,
    ) -> Result<(), Refusal> {
        values.into_iter().try_for_each(|value| self.f64(value))
    }

    /// A count.
    ///
    /// # Errors
    /// The bytes have come to their end.
    pub fn u64(&mut self, value: &mut u64) -> Result<(), Refusal> {
        let mut bytes = value.to_le_bytes();
        self.bytes(&mut bytes)?;
        *value = u64::from_le_bytes(bytes);
        Ok(())
    }

    /// An integer.
    ///
    /// # Errors
    /// The bytes have come to their end.
    pub fn i32(&mut self, value: &mut i32) -> Result<(), Refusal> {
        let mut bytes = value.to_le_bytes();
        self.bytes(&mut bytes)?;
        *value = i32::from_le_bytes(bytes);
        Ok(())
    }

    /// A small number, for example that of an enum's variant.
    ///
    /// # Errors
    /// The bytes have come to their end.
    pub fn u8(&mut self, value: &mut u8) -> Result<(), Refusal> {
        self.bytes(std::slice::from_mut(value))
    }

    /// A truth value.
    ///
    /// # Errors
    /// The bytes have come to their end, or hold neither 0 nor 1.
    pub fn bool(&mut self, value: &mut bool) -> Result<(), Refusal> {
        let mut byte = u8::from(*value);
        self.u8(&mut byte)?;
        *value = match byte {
            0 => false,
            1 => true,
            other => return Err(Refusal::error(format!("{other} is no truth value"))),
        };
        Ok(())
    }

    /// Text.
    ///
    /// # Errors
    /// The bytes have come to their end, or are not UTF-8.
    pub fn string(&mut self, value: &mut String) -> Result<(), Refusal> {
        let mut length = value.len() as u64;
        self.u64(&mut length)?;
        match &mut self.0 {
            Mode::Write(out) => out.extend_from_slice(value.as_bytes()),
            Mode::Read(rest) => {
                let length = usize::try_from(length)?;
                let (text, after) = rest.split_at_checked(length).ok_or_else(truncated)?;
                *value = std::str::from_utf8(text)?.into();
                *rest = after;
            }
        }
        Ok(())
    }

    /// A whole value by its `serde` description, in the compact format of `postcard` (bit by bit, no names).
    ///
    /// # Errors
    /// The bytes have come to their end, or make no such value.
    pub fn whole<T: Serialize + DeserializeOwned>(&mut self, value: &mut T) -> Result<(), Refusal> {
        match &mut self.0 {
            Mode::Write(out) => {
                let bytes = postcard::to_stdvec(value)?;
                let mut length = bytes.len() as u64;
                Archive::writer(out).u64(&mut length)?;
                out.extend_from_slice(&bytes);
            }
            Mode::Read(rest) => {
                let mut length = 0;
                let mut front = Archive::reader(rest);
                front.u64(&mut length)?;
                let length = usize::try_from(length)?;
                let (_, body) = rest.split_at(size_of::<u64>());
                let (bytes, after) = body.split_at_checked(length).ok_or_else(truncated)?;
                *value = postcard::from_bytes(bytes)?;
                *rest = after;
            }
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

    fn bytes(&mut self, bytes: &mut [u8]) -> Result<(), Refusal> {
        match &mut self.0 {
            Mode::Write(out) => out.extend_from_slice(bytes),
            Mode::Read(rest) => {
                let (front, after) = rest.split_at_checked(bytes.len()).ok_or_else(truncated)?;
                bytes.copy_from_slice(front);
                *rest = after;
            }
        }
        Ok(())
    }
}

fn truncated() -> Refusal {
    Refusal::error("the serialised state ends too soon")
}

#[cfg(test)]
mod tests {
    use super::*;

    type Fields = (f64, u64, i32, bool, String);

    fn fields(archive: &mut Archive<'_>, f: &mut Fields) -> Result<(), Refusal> {
        archive.f64(&mut f.0)?;
        archive.u64(&mut f.1)?;
        archive.i32(&mut f.2)?;
        archive.bool(&mut f.3)?;
        archive.string(&mut f.4)
    }

    #[test]
    fn what_is_written_is_read_bit_by_bit() {
        let nan = f64::from_bits(0x7ff8_0000_0000_1234);
        let mut written: Fields = (nan, u64::MAX, -7, true, "µm".into());
        let mut bytes = Vec::new();
        fields(&mut Archive::writer(&mut bytes), &mut written).unwrap();
        let mut read = Fields::default();
        let mut archive = Archive::reader(&bytes);
        fields(&mut archive, &mut read).unwrap();
        archive.finish().unwrap();
        assert_eq!(read.0.to_bits(), nan.to_bits());
        assert_eq!((read.1, read.2, read.3), (u64::MAX, -7, true));
        assert_eq!(read.4, "µm");
    }

    #[test]
    fn every_truncation_is_refused() {
        let mut bytes = Vec::new();
        let mut written: Fields = (1.0, 2, 3, false, "four".into());
        fields(&mut Archive::writer(&mut bytes), &mut written).unwrap();
        for end in 0..bytes.len() {
            let mut archive = Archive::reader(&bytes[..end]);
            assert!(fields(&mut archive, &mut Fields::default()).is_err());
        }
    }
}
