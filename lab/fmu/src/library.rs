//! Shared libraries of FMI 2.0.

use std::path::Path;

use libloading::{Error, Library};

/// Loads the library, and looks for the function that makes instances.
///
/// # Errors
/// What the system's loader says.
pub fn check(path: &Path) -> Result<(), String> {
    // The loader looks for a bare name elsewhere.
    let path = std::path::absolute(path).unwrap_or_else(|_| path.into());
    let reason = |error: Error| std::error::Error::source(&error).map_or(error.to_string(), ToString::to_string);
    // SAFETY: a library of FMI 2.0 runs nothing of its own when it is loaded.
    let library = unsafe { Library::new(path) }.map_err(reason)?;
    // SAFETY: the function is not called.
    let function = unsafe { library.get::<unsafe extern "C" fn()>(b"fmi2Instantiate") };
    function.map(drop).map_err(reason)
}
