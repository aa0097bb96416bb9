//! Shared libraries of FMI 2.0: where they are in an FMU, and how they are loaded.

use std::env::consts::{ARCH, OS};
use std::path::Path;

use libloading::{Error, Library};

/// Folders below `binaries/` for this machine. FMI 2.0 names none for ARM except `darwin64`: the others are those of
/// FMI 3.0.
pub fn folders() -> &'static [&'static str] {
    match (OS, ARCH) {
        ("windows", "x86") => &["win32"],
        ("windows", "aarch64") => &["aarch64-windows"],
        ("windows", _) => &["win64"],
        ("macos", "aarch64") => &["aarch64-darwin", "darwin64"],
        ("macos", _) => &["darwin64"],
        (_, "x86") => &["linux32"],
        (_, "aarch64") => &["aarch64-linux"],
        _ => &["linux64"],
    }
}

/// Loads a library that has the function which makes instances.
///
/// # Errors
/// What the system's loader says.
pub fn load(path: &Path) -> Result<Library, String> {
    // The loader looks for a bare name elsewhere.
    let path = std::path::absolute(path).unwrap_or_else(|_| path.into());
    let reason = |error: Error| std::error::Error::source(&error).map_or(error.to_string(), ToString::to_string);
    // SAFETY: a library of FMI 2.0 runs nothing of its own when it is loaded.
    let library = unsafe { Library::new(path) }.map_err(reason)?;
    // SAFETY: the function is not called.
    unsafe { library.get::<unsafe extern "C" fn()>(b"fmi2Instantiate") }.map_err(reason)?;
    Ok(library)
}
