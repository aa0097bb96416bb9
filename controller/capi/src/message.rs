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

    #[test]
    fn the_message_for_a_very_large_value_says_what_is_allowed() {
        let mut config = phase_lock::Config::for_resonance(55.0, 1e-4);
        config.sample_time = -1e300;
        let mut bytes = [0_u8; 200];
        // SAFETY: as many bytes as the array has.
        unsafe { write(config.build().unwrap_err(), bytes.as_mut_ptr().cast(), bytes.len()) };
        let text = core::ffi::CStr::from_bytes_until_nul(&bytes).unwrap().to_str().unwrap();
        assert!(text.ends_with("allowed is above 0 (1e-30 to 1e30)"), "{text}");
        assert!(text.starts_with("sample_time = -1e300 s"), "{text}");
    }
}
