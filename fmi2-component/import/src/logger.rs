//! The logger: passes the messages of an FMU to the `log` crate.

use std::ffi::{CStr, c_char, c_int, c_void};

use log::Level;

unsafe extern "C" {
    /// In `logger.c`.
    pub(crate) fn fmi2_import_logger(
        environment: *mut c_void,
        instance: *const c_char,
        status: c_int,
        category: *const c_char,
        message: *const c_char,
        ...
    );
}

/// `struct sink` of `logger.c`.
#[repr(C)]
pub(crate) struct Sink {
    pub write: unsafe extern "C" fn(*const c_char, c_int, *const c_char),
}

/// The component environment of every instance.
pub(crate) static SINK: Sink = Sink { write };

/// # Safety
/// `instance` and `text` are NULL or C strings.
unsafe extern "C" fn write(instance: *const c_char, status: c_int, text: *const c_char) {
    // SAFETY: the caller's contract.
    let (instance, text) = unsafe { (lossy(instance), lossy(text)) };
    let level = match status {
        0 => Level::Info,
        1 => Level::Warn,
        2 => Level::Trace,
        _ => Level::Error,
    };
    log::log!(target: &instance, level, "{text}");
}

/// # Safety
/// `text` is NULL or a C string.
unsafe fn lossy(text: *const c_char) -> String {
    if text.is_null() {
        return String::new();
    }
    // SAFETY: not NULL, and the caller's contract.
    unsafe { CStr::from_ptr(text) }.to_string_lossy().into_owned()
}

#[cfg(test)]
mod tests {
    use std::ptr::null;
    use std::sync::Mutex;

    use super::*;

    static HEARD: Mutex<Vec<(String, i32, String)>> = Mutex::new(Vec::new());

    unsafe extern "C" fn hear(instance: *const c_char, status: c_int, text: *const c_char) {
        // SAFETY: the logger passes on what it received.
        let line = unsafe { (lossy(instance), status, lossy(text)) };
        HEARD.lock().unwrap().push(line);
    }

    #[test]
    fn a_message_is_formatted_and_a_missing_category_does_no_harm() {
        let sink = Sink { write: hear };
        let environment = (&raw const sink).cast_mut().cast::<c_void>();
        // SAFETY: the arguments match the format.
        unsafe {
            let message = c"%s = %d %%".as_ptr();
            fmi2_import_logger(environment, c"a".as_ptr(), 3, null(), message, c"x".as_ptr(), 42);
            fmi2_import_logger(environment, c"a".as_ptr(), 3, null(), null());
        }
        let heard = HEARD.lock().unwrap();
        assert_eq!(*heard, [("a".to_owned(), 3, "x = 42 %".to_owned())]);
    }
}
