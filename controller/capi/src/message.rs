//! Messages in a buffer of the caller.

use core::ffi::c_char;
use core::fmt::{Display, Write};

/// A buffer of fixed length; text that does not fit is omitted.
struct Buffer<'a> {
    bytes: &'a mut [u8],
    used: usize,
}

impl Write for Buffer<'_> {
    fn write_str(&mut self, text: &str) -> core::fmt::Result {
        let free = self.bytes.len() - 1 - self.used;
        let mut taken = text.len().min(free);
        while !text.is_char_boundary(taken) {
            taken -= 1;
        }
        self.bytes[self.used..self.used + taken].copy_from_slice(&text.as_bytes()[..taken]);
        self.used += taken;
        Ok(())
    }
}

/// Writes as much of `text` as fits into `length` bytes, with a terminating zero.
///
/// # Safety
/// `to` is NULL or points to `length` bytes that may be written.
pub unsafe fn write(text: impl Display, to: *mut c_char, length: usize) {
    if to.is_null() || length == 0 {
        return;
    }
    // SAFETY: the caller's contract.
    let bytes = unsafe { core::slice::from_raw_parts_mut(to.cast::<u8>(), length) };
    bytes.fill(0);
    let mut buffer = Buffer { bytes, used: 0 };
    // A full buffer is not an error.
    let _ = write!(buffer, "{text}");
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_message_that_does_not_fit_is_cut_at_a_character_and_terminated() {
        let mut bytes = [0x7f_u8; 8];
        // SAFETY: as many bytes as the array has.
        unsafe { write("größe", bytes.as_mut_ptr().cast(), 4) };
        assert_eq!(&bytes[..4], b"gr\0\0");
        assert_eq!(bytes[4], 0x7f);
    }
}
